"""What a bench outside of this process asks of the machine that drives it, from before its first output to its end."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from hil.bench.bound import BoundBench
from hil.bench.gate import Gate
from hil.bench.port_identity import port_gates
from hil.clock.live import LiveClock
from hil.executive.live.guarding import Guarding
from hil.executive.live.inhibitor import Inhibitor
from hil.executive.run.record import Record
from hil.executive.run.stop import StopFlags
from hil.executive.setup.configuration import Configuration
from hil.executive.watch.scheduler import Scheduler
from hil.model.bench import BenchSpec
from hil.model.errors import Refused
from hil.model.identity import Source

__all__ = ["Host", "host_of"]


class Host:
    """Ports that are whose they should be, a machine that stays awake, and a guardian.

    A served bench is simulated: its ports belong to nobody, and nothing real suffers if its machine sleeps.

    Args:
        spec: the bench file.
        guarding: the guardian.
        inhibitor: holds off sleep and shutdown.
        served: whether the bench is served by another process.

    Attributes:
        people: gives the gates that people open.
    """

    def __init__(self, spec: BenchSpec, guarding: Guarding, inhibitor: Inhibitor, *, served: bool) -> None:
        self._spec = spec
        self._guarding = guarding
        self._inhibitor = inhibitor
        self._served = served
        self.people: Callable[[], Iterable[Gate]] = tuple

    def gates(self) -> Iterator[Gate]:
        """Yield what has to hold before anything is driven; with the last one the guardian watches."""
        if not self._served:
            yield from port_gates(self._spec)
        yield self._awake()
        yield from self.people()
        yield from self._guarding.begin()

    @property
    def distress(self) -> str:
        """Why the bench cannot be driven any more, empty while it can."""
        if self._guarding.lost:
            return self._guarding.lost
        return "" if self._served else self._inhibitor.lost()

    def end(self) -> list[str]:
        """Let go of everything; return what the guardian does not find safe."""
        problems = self._guarding.end()
        self._inhibitor.close()
        return problems

    def _awake(self) -> Gate:
        name = "sleep and shutdown held off"
        try:
            self._inhibitor.take()
        except Refused as error:
            return Gate(name, ok=self._served, detail=f"not held off, {error}" if self._served else str(error))
        return Gate(name, ok=True, detail="by this run, until it ends")


def host_of(
    bench: BoundBench,
    clock: LiveClock,
    flags: StopFlags,
    scheduler: Scheduler,
    record: Record,
    configuration: Configuration,
) -> Host:
    """Return what a bench outside of this process needs, connected with the run that drives it.

    Args:
        bench: the bench.
        clock: its clock.
        flags: stop requests; amid a case's own code the scheduler looks after the bench.
        scheduler: is told of distress.
        record: the run's.
        configuration: what the run is made of.
    """
    guarding = Guarding(
        bench,
        clock,
        flags,
        lambda: scheduler.fresh_until_ns,
        folder=record.folder,
        leases=record.leases,
        locks=record.lease.descriptors,
    )
    inhibitor = Inhibitor(f"a test run drives bench {bench.spec.name}", configuration.workspace.inhibitor)
    host = Host(bench.spec, guarding, inhibitor, served=bench.source is Source.SIMULATED)
    scheduler.distress = lambda: host.distress
    flags.amid = scheduler.idle
    return host
