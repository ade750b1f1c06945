"""What a bench outside of this process asks of the machine that drives it, from before its first output to its end."""

from __future__ import annotations

import select
from collections.abc import Callable, Iterable, Iterator

from hil.bench.bound import BoundBench
from hil.bench.gate import Gate
from hil.bench.lease import latch_unsafe_end
from hil.bench.port_identity import port_gates
from hil.clock import wall
from hil.clock.live import LiveClock
from hil.evidence import events
from hil.executive.ending.signals import LOOK_S
from hil.executive.journaling.record import Record
from hil.executive.setup.configuration import Configuration
from hil.executive.watching.guardian import Guarding
from hil.executive.watching.inhibitor import Inhibitor
from hil.executive.watching.scheduler import Scheduler
from hil.model.errors import HilError, Refused
from hil.model.identity import Source

__all__ = ["Host", "host_of"]


class Host:
    """Ports that are whose they should be, a machine that stays awake, and a guardian.

    A served bench is simulated: its ports belong to nobody, and nothing real suffers if its machine sleeps.

    Args:
        bench: the bench; one whose source is simulated is served.
        clock: its clock.
        scheduler: is told of distress.
        guarding: the guardian.
        inhibitor: holds off sleep and shutdown.
        record: the run's.

    Attributes:
        people: yields the gates that people open.
        between: lets the guardian hear of the run where nothing looks at the bench for some seconds.
        drives: tells whether an output is on.
    """

    def __init__(
        self,
        bench: BoundBench,
        clock: LiveClock,
        scheduler: Scheduler,
        guarding: Guarding,
        inhibitor: Inhibitor,
        record: Record,
    ) -> None:
        self._bench, self._spec = bench, bench.spec
        self._clock = clock
        self._scheduler = scheduler
        self._guarding = guarding
        self._inhibitor = inhibitor
        self._record = record
        self._looked = 0.0
        self._served = bench.source is Source.SIMULATED
        self.people: Callable[[], Iterable[Gate]] = lambda: ()
        self.drives: Callable[[], bool] = lambda: False
        self.between = guarding.between
        scheduler.present.distress = self.distress

    def amid(self, alone_s: float) -> None:
        """Look after the bench amid a case's own code, unless a record stands in for it.

        Args:
            alone_s: for how long that ran since the last look; one that came in time was `LOOK_S` after it.
        """
        if not self._clock.began:
            return
        self._clock.pulse()
        if self._scheduler.watching:
            if self.drives():
                self._scheduler.present.busy(alone_s - LOOK_S)
            self._scheduler.idle()

    def gates(self) -> Iterator[Gate]:
        """Yield what has to hold before anything is driven; with the last one the guardian watches."""
        if not self._served:
            yield from port_gates(self._spec)
        yield self._awake()
        yield from self.people()
        awake = self._inhibitor.descriptor  # the guardian needs the machine, too
        yield from self._guarding.begin(() if awake is None else (awake,))

    def distress(self) -> str:
        """Return why the bench cannot be driven any more, nothing while it can."""
        if self._guarding.lost:
            return self._guarding.lost
        now = wall.monotonic()
        if now - self._looked < LOOK_S:
            return ""
        self._looked = now
        if gone := self._gone():
            return f"the port of {gone} is gone"
        return "" if self._served else self._inhibitor.lost()

    def _gone(self) -> str:
        """Return the instrument whose port has hung up; no byte is read, and nothing may be sent to find out."""
        looked, names = select.poll(), {}
        for name, descriptor in self._bench.descriptors.items():
            names[descriptor] = name
            looked.register(descriptor, select.POLLRDHUP)
        return ", ".join(names[descriptor] for descriptor, _ in looked.poll(0))

    def end(self) -> list[str]:
        """Let go of everything; return what the guardian does not find safe."""
        problems = self._guarding.end()
        self._inhibitor.close()
        return problems

    def latch(self, why: str) -> None:
        """Latch the bench, which was not proven safe; where that is not possible, it is told."""
        try:
            latch_unsafe_end(self._record.leases, bench=self._spec.name, run=self._record.folder, why=why)
        except (OSError, HilError) as error:
            self._record.events.write(events.Anomaly(text=f"the bench could not be latched: {error}"))

    def _awake(self) -> Gate:
        name = "sleep and shutdown held off"
        try:
            self._inhibitor.take()
        except Refused as error:
            return Gate(name, ok=self._served, detail=f"not held off, {error}" if self._served else str(error))
        return Gate(name, ok=True, detail="by this run, until it ends")


def host_of(
    bench: BoundBench, clock: LiveClock, scheduler: Scheduler, record: Record, configuration: Configuration
) -> Host:
    """Return what a bench outside of this process needs, connected with the run that drives it.

    Args:
        bench: the bench.
        clock: its clock.
        scheduler: is told of distress, and looks after the bench amid a case's own code.
        record: the run's.
        configuration: what the run is made of.
    """
    guarding = Guarding(
        bench,
        clock,
        scheduler.flags,
        lambda: scheduler.fresh_until_ns,
        folder=record.folder,
        leases=record.leases,
        locks=record.lease.descriptors,
    )
    inhibitor = Inhibitor(f"a test run drives bench {bench.spec.name}", configuration.workspace.inhibitor)
    return Host(bench, clock, scheduler, guarding, inhibitor, record)
