"""What a bench outside of this process asks of the machine that drives it, from before its first output to its end."""

from __future__ import annotations

import select
from collections.abc import Iterable, Iterator, Sequence
from typing import Protocol

from hil.bench.bound import BoundBench
from hil.bench.gate import Gate
from hil.bench.lease import latch_unsafe_end
from hil.bench.port_identity import port_gates
from hil.clock import wall
from hil.clock.live import LiveClock
from hil.evidence import events
from hil.executive.ending.signals import LOOK_S
from hil.executive.ending.stop import StopFlags
from hil.executive.journaling.record import Record
from hil.executive.watching.guardian import Guarding
from hil.executive.watching.holding import Holding
from hil.executive.watching.inhibitor import Inhibitor
from hil.executive.watching.ports import Freshness
from hil.executive.watching.scheduler import Scheduler
from hil.model.errors import HilError, Refused
from hil.model.identity import Source

__all__ = ["ArmingPeople", "Attendant", "LiveMachine", "live_machine"]


class ArmingPeople(Protocol):
    """The people that an armed bench needs."""

    def gates(self) -> Iterable[Gate]:
        """Give the gates one by one that people open."""
        ...


class LiveMachine:
    """Ports that are whose they should be, a machine that stays awake, and a guardian.

    A served bench is simulated: its ports belong to nobody, and nothing real suffers if its machine sleeps.

    Args:
        bench: the bench; one whose source is simulated is served.
        guarding: the guardian.
        inhibitor: holds off sleep and shutdown.
        record: the run's.
    """

    def __init__(self, bench: BoundBench, guarding: Guarding, inhibitor: Inhibitor, record: Record) -> None:
        self._bench, self._spec = bench, bench.spec
        self._guarding = guarding
        self._inhibitor = inhibitor
        self._record = record
        self._looked = 0.0
        self._served = bench.source is Source.SIMULATED
        self._people: ArmingPeople | None = None

    def attend(self, people: ArmingPeople) -> None:
        """Arm only with these people."""
        self._people = people

    def between(self) -> None:
        """Let the guardian hear of the run where nothing looks at the bench for some seconds."""
        self._guarding.between()

    def gates(self, freshness: Freshness) -> Iterator[Gate]:
        """Yield what has to hold before anything is driven; with the last one the guardian watches."""
        if not self._served:
            yield from port_gates(self._spec)
        yield self._awake()
        if self._people is not None:
            yield from self._people.gates()
        awake = self._inhibitor.descriptor  # the guardian needs the machine, too
        yield from self._guarding.begin(freshness, () if awake is None else (awake,))

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


class Attendant:
    """Looks after a bench outside of this process while a case's own code runs, unless a record stands in for it.

    Args:
        machine: lets the guardian hear of the run.
        clock: the bench's clock.
        scheduler: gives monitors and turns their time.
        holding: knows what the case has driven.
    """

    def __init__(self, machine: LiveMachine, clock: LiveClock, scheduler: Scheduler, holding: Holding) -> None:
        self._machine = machine
        self._clock = clock
        self._scheduler = scheduler
        self._holding = holding

    def between(self) -> None:
        """Let the guardian hear of the run."""
        self._machine.between()

    def amid(self, alone_s: float) -> None:
        """Look after the bench where the case's own code may be disturbed.

        Args:
            alone_s: for how long that ran since the last look; one that came in time was `LOOK_S` after it.
        """
        if not self._clock.began:
            return
        self._clock.pulse()
        if self._scheduler.watching:
            if self._holding.drives():
                self._scheduler.busy(alone_s - LOOK_S)
            self._scheduler.idle()


def live_machine(
    bench: BoundBench, clock: LiveClock, flags: StopFlags, record: Record, inhibit: Sequence[str]
) -> LiveMachine:
    """Return the machine of a bench outside of this process.

    Args:
        bench: the bench.
        clock: its clock.
        flags: tell whether the executive is at something that no monitor can interrupt.
        record: the run's.
        inhibit: a command that holds off sleep and shutdown in the place of logind; empty for logind.
    """
    guarding = Guarding(bench, clock, flags, folder=record.folder, leases=record.leases, locks=record.lease.descriptors)
    return LiveMachine(bench, guarding, Inhibitor(f"a test run drives bench {bench.spec.name}", inhibit), record)
