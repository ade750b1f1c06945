"""Keeper of the bench: arms it, watches it, brings it to rest, and makes it safe."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Protocol

from hil.bench.bound import BoundBench
from hil.bench.envelope import Trip
from hil.bench.gate import Gate
from hil.bench.safe_off import EVERY_S, SafeResult, left_on, watch_after
from hil.evidence import events
from hil.evidence.events import EventSink
from hil.executive.ending.stop import StopFlags, Stopped
from hil.executive.journaling.row_store import OpenRecording, RowStore
from hil.executive.watching.arming import FIRST_ARMING, ArmedBench
from hil.executive.watching.holding import Holding
from hil.executive.watching.monitoring import Heartbeat, heartbeats_of, monitor_of
from hil.executive.watching.ports import Distress, Machine
from hil.executive.watching.room import Asked, room_gate
from hil.executive.watching.scheduler import Scheduler
from hil.executive.watching.timeline import Timeline
from hil.model.cutting import WatchAfter
from hil.model.envelope import EnvelopeLimit
from hil.model.errors import DeviceFault
from hil.model.figure import Figure
from hil.model.identity import Dut

__all__ = ["BenchKeeper", "Ticking", "watch_afterwards"]


class Ticking(Protocol):
    """A task to do several times a second."""

    def tick(self) -> None:
        """Do it."""
        ...


class BenchKeeper:
    """Owns the state of the outputs from arm to the proven safe state, whatever cases do.

    Args:
        bench: the bench.
        dut: the device under test, compared with what answers.
        flags: stop requests; they wait while the bench is made safe.
        journal: where events are written.
        store: opens recordings, one per monitor.
        machine: the machine that drives the bench.
        timeline: decides when things happen that no case asks for.
        ticking: other tasks done several times a second; the first also runs during the watch after the end.

    Attributes:
        holding: holds the bench on request; it must be shown every event.
        journal: where events are written.
        over: whether the run was re-entered after its last case, on a bench that is no longer armed.
    """

    def __init__(
        self,
        bench: BoundBench,
        dut: Dut,
        flags: StopFlags,
        journal: EventSink,
        store: RowStore,
        machine: Machine,
        timeline: Timeline,
        ticking: Sequence[Ticking],
    ) -> None:
        self._bench = bench
        self._flags = flags
        self.journal = self._journal = journal
        self._asked: Iterable[Asked] = ()
        self._armed = ArmedBench(bench, dut, flags, machine, room=self._room)
        self._store = store
        self._watched: dict[str, OpenRecording] = {}
        self.over = False
        monitors = [monitor_of(bench, limit) for limit in bench.spec.envelope]
        self.scheduler = Scheduler(bench, monitors, flags, self, timeline)
        self._heartbeats: list[Heartbeat] = []
        self.holding = Holding(bench, flags, journal, self.scheduler)
        self._ticking = (*ticking[:1], self.holding, *ticking[1:])

    @property
    def unsafe(self) -> bool:
        """Whether an output was not proven safe in the end."""
        return self._armed.unsafe

    def tick(self) -> None:
        """Do the tasks that are done several times a second."""
        for ticking in self._ticking:
            ticking.tick()

    def hold_as_recorded(self) -> None:
        """Hold the bench where the retraced record does."""
        self.holding.hold_as_recorded()

    def arm(self, asked: Iterable[Asked] = ()) -> str:
        """Check, make safe, try every output at reduced level, and begin to watch; return why not, empty if armed.

        Args:
            asked: the recordings for which there must be room.
        """
        self._asked = asked
        if problem := self._pass_gates(FIRST_ARMING):
            return problem
        for limit in self._bench.spec.envelope:
            self._watched[limit.id] = self._store.begin(self._facts(limit))
        self._heartbeats = heartbeats_of(self._bench, self.scheduler.monitoring)
        for heartbeat in self._heartbeats:
            self.scheduler.begin_beside(heartbeat)
        self.scheduler.watch_from_now()
        self._journal.write(events.Armed())
        return ""

    def _room(self) -> Iterator[Gate]:
        return room_gate(self._bench, self.scheduler.monitoring, self._asked)

    def arm_again(self, arming: int) -> str:
        """Rearm a bench that was made safe, and continue watching it; return why not, empty if armed.

        Args:
            arming: the `void_to` of the entry at which it is rearmed.
        """
        self.scheduler.rest()  # a killed run did not get to that
        if problem := self._pass_gates(arming):
            return problem
        self.scheduler.watch_from_now()
        self._journal.write(events.Armed())
        return ""

    def reading(self, limit: str, t: float, figure: Figure) -> None:
        """Record one reading of a monitor."""
        if limit in self._watched:
            self._watched[limit].append((t, figure.value))

    def fed(self, limit: str, recording: str) -> None:
        """Record that every row of a recording is judged against a limit."""
        self._journal.write(events.Fed(limit=limit, recording=recording))

    def late(self, limit: str, seconds: float) -> None:
        """Record that a monitor was late."""
        period = next(item.period_s for item in self._bench.spec.envelope if item.id == limit)
        text = f"{limit} was read {seconds:.3g} s after it was due; its period is {period:g} s"
        self._journal.write(events.MonitorLate(limit=limit, late=round(seconds, 9), text=text))

    def trip(self, trip: Trip) -> None:
        """Record the trip and make the bench safe, before the case learns of it."""
        try:
            self._journal.write(events.Trip(limit=trip.limit, value=trip.value, unit=trip.unit, text=trip.text))
        finally:
            self.safe()

    def lost(self, distress: Distress) -> None:
        """Record the loss, let the run stay open, and make the bench safe, before the case learns of it."""
        self._flags.leave_off(distress.reason)
        try:
            self._journal.write(events.Lost(what=distress.what or "port", device=distress.device, text=distress.text))
        finally:
            self.safe()

    def give_up(self) -> None:
        """End the run here: the present case will not end."""
        self._flags.give_up()

    def rest(self) -> str:
        """Bring the bench to its rest state between cases; return why no further case can run, empty if one can."""
        if self.over:
            return "the run was interrupted after its last case"
        if self.scheduler.lost:
            return ""
        faults: list[DeviceFault] = []
        with self._flags.shielded():
            if self._flags.reason:  # no case follows, but the safe-off does: no need to prove rest first
                self._armed.switch_off()
            problems = left_on(self._bench.spec.rest, self._bench, self._taken(events.Rest), faults.append)
        for fault in faults if problems else ():
            with suppress(Stopped):  # the next case will not begin
                self.scheduler.hear(self._bench.spec.instrument(fault.device), fault)
            if self.scheduler.lost:
                return ""
        return f"the bench did not reach its rest state: {problems[0]}" if problems else ""

    def safe(self) -> None:
        """Make the bench safe and prove it, uninterrupted; may be called repeatedly."""
        with self._flags.shielded():
            self._armed.switch_off()
            self.scheduler.rest()
            self.scheduler.come()  # time taken by a person or a case does not count for the safe-off
            problems = self._armed.make_safe(self._taken(events.Safe))
            self._journal.write(events.SafeEnd(ok=not problems))

    def release(self) -> None:
        """Make the bench safe for the last time and end the monitors' recordings."""
        for heartbeat in self._heartbeats:
            self.scheduler.end_beside(heartbeat)
        if self._armed.touched:
            self.safe()
        lost = self.scheduler.lost is not None
        if problems := self._armed.let_go(lost=lost):
            # A run that is resumed ends again: this proof is not its last.
            name = "guardian" if self.stays_open else events.HostGate.GUARDIANS_PROOF
            self._journal.write(events.HostGate(name=name, ok=False, detail="; ".join(problems)))
        if self._armed.touched and not self.stays_open:  # the watch after the end belongs to the end of a run
            self._watch_afterwards()
        self._armed.latch("the run could not prove the bench safe")
        for recording in self._watched.values():
            recording.finish(complete=True)
        self._watched.clear()

    @property
    def stays_open(self) -> bool:
        """Whether the run was stopped to be resumed: with its bench safe, or without the means to reach it.

        A bench that is not proven safe then is latched, and its guardian keeps trying.
        """
        unsafe = self.unsafe and not self.scheduler.lost
        return self._flags.leave_open and not unsafe and not self.scheduler.tripped

    def _watch_afterwards(self) -> None:
        """Watch whether what was made safe stays safe; this counts, whatever the lines have proven."""
        with self._flags.shielded():
            if not watch_afterwards(self._bench, self._store, self._taken(events.Safe), self._ticking[0]):
                self._journal.write(events.SafeEnd(ok=False))
                self._armed.unsafe = True

    def _pass_gates(self, arming: int) -> str:
        """Pass the gates one by one; the first that does not hold ends the arming, and is returned."""

        def passed(gate: Gate, of_host: bool) -> None:
            kind = events.HostGate if of_host else events.Gate
            self._journal.write(
                kind(
                    name=gate.name,
                    ok=gate.ok,
                    detail=gate.detail,
                    instrument=gate.instrument,
                    unproven=gate.unproven,
                    source=gate.source,
                    exception=gate.exception,
                )
            )

        return self._armed.arm(arming, self.scheduler, passed)

    def _taken(self, kind: type[events.Rest]) -> Callable[[SafeResult], None]:
        """Return a function that records an executed line."""
        return lambda result: self._journal.write(
            kind(
                output=result.output,
                state=result.state,
                ok=result.ok,
                detail=result.detail,
                duration=round(result.seconds, 9),
            )
        )

    def _facts(self, limit: EnvelopeLimit) -> events.Recording:
        instrument = self._bench.spec.instrument(self._bench.spec.wire(limit.output).instrument)
        channel = events.Channel(
            name=limit.quantity,
            unit=limit.unit,
            instrument=instrument.name,
            calibration=instrument.calibration.certificate if instrument.calibration else "",
            uncertainty=None,
        )
        return events.Recording(
            recording=f"envelope-{limit.id}",
            name=limit.id,
            case=None,
            step=None,
            channels=(channel,),
            rate=1 / limit.period_s,
            duration=None,
            source=self._bench.source,
        )


def watch_afterwards(bench: BoundBench, store: RowStore, tell: Callable[[SafeResult], None], ticking: Ticking) -> bool:
    """Watch the lines of the bench file, with a recording of each, and return whether all of them hold.

    Args:
        bench: the bench, after its safe-off.
        store: opens the recordings.
        tell: called with every result.
        ticking: a task to continue in the meantime.
    """
    recordings = {watch: store.begin(_watched_facts(bench, watch)) for watch in bench.spec.watch_after}

    def reading(watch: WatchAfter, t: float, value: float) -> None:
        recordings[watch].append((t, value))
        ticking.tick()

    try:
        return watch_after(bench.spec.watch_after, bench.roles, bench.clock, reading, tell)
    finally:
        for recording in recordings.values():
            recording.finish(complete=True)


def _watched_facts(bench: BoundBench, watch: WatchAfter) -> events.Recording:
    instrument = bench.spec.instrument(bench.spec.wire(watch.output).instrument)
    channel = events.Channel(
        name=watch.quantity,
        unit=watch.unit,
        instrument=instrument.name,
        calibration=instrument.calibration.certificate if instrument.calibration else "",
        uncertainty=None,
    )
    name = f"{watch.output} {watch.quantity} afterwards"
    return events.Recording(
        recording=f"after-{watch.output.replace('.', '-')}-{watch.quantity}",
        name=name,
        case=None,
        step=None,
        channels=(channel,),
        rate=1 / EVERY_S,
        duration=None,
        source=bench.source,
    )
