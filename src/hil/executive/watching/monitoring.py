"""Monitors while a run goes on: each takes its turn when it is due, and in a replay when the record has it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from hil.bench.bound import BoundBench
from hil.bench.derived.derivation import Derivation
from hil.bench.derived.quantities import derivation_of
from hil.bench.envelope import Monitor, Trip
from hil.clock.port import NANOSECONDS
from hil.executive.watching.ports import Watch
from hil.model.bench import InstrumentSpec
from hil.model.envelope import EnvelopeLimit
from hil.model.errors import DeviceFault, NoReply
from hil.model.figure import Figure
from hil.wire.replay import MONITOR, OVERDUE, Playback
from hil.wire.tap import LONGEST_TRANSACTION

__all__ = ["Monitoring", "monitor_of"]

_BEHIND_NS = NANOSECONDS // 10
"""More than a turn of a monitor takes from the samples of a recording, which catch up with it."""


class Monitoring:
    """Runs the monitors of a bench.

    Args:
        bench: the bench.
        monitors: one per limit of the envelope.
        watch: is told every reading.
        trip: makes the bench safe for the first trip, and ends what the case does.

    Attributes:
        faulted: is told when a monitor's device is silent or talks nonsense; the present case, if there is one.
        soonest_ns: before this instant none is due.
    """

    def __init__(
        self, bench: BoundBench, monitors: Sequence[Monitor], watch: Watch, trip: Callable[[Trip], None]
    ) -> None:
        self.all = list(monitors)
        self.faulted: Callable[[InstrumentSpec, DeviceFault], None] | None = None
        self.soonest_ns = 0
        self._bench = bench
        self._clock = bench.clock
        self._watch = watch
        self._trip = trip

    def restart(self) -> None:
        """Begin to watch anew."""
        for monitor in self.all:
            monitor.restart(self._clock.now_ns())
        self.soonest_ns = 0

    def next_turn_ns(self, when_ns: int) -> int:
        """Return when a wait until `when_ns` has to look up for one of them."""
        if self.soonest_ns > when_ns:
            return when_ns
        now_ns = self._clock.now_ns()
        turns = [monitor.due_ns for monitor in self.all if now_ns < monitor.due_ns <= when_ns - monitor.room_ns]
        return min(turns, default=when_ns)

    def run(self, until_ns: int) -> None:
        """Run those that are due and have room before `until_ns`, and those that are overdue in any case."""
        if self.soonest_ns > until_ns:
            return
        name = MONITOR if self._clock.now_ns() < until_ns else OVERDUE
        if self._bench.playback is not None:
            self._replay(self._bench.playback, until_ns, name)
            return
        for monitor in self.all:
            now_ns = self._clock.now_ns()
            if now_ns < monitor.due_ns:
                continue
            if until_ns - now_ns >= monitor.room_ns or now_ns >= monitor.overdue_ns:
                self._take(monitor, name)
        self.soonest_ns = min([monitor.due_ns for monitor in self.all], default=0)

    def run_behind(self, when_ns: int) -> None:
        """Run those that are overdue where a wait until `when_ns` would begin far behind its end.

        Samples that come ever later leave no wait in which a monitor has its turn. The first of a recording, and one
        that is a little late, are taken at once: a wait behind them has room.
        """
        now_ns = self._clock.now_ns()
        if now_ns >= when_ns + _BEHIND_NS:
            self.run(now_ns)

    def _replay(self, playback: Playback, until_ns: int, name: str) -> None:
        """Run those that the record holds here; those of a later wait are left for that one."""
        while limit := playback.take_monitor(max(until_ns - 1, self._clock.now_ns()), name):
            self._take(next(monitor for monitor in self.all if monitor.limit.id == limit), name)

    def _take(self, monitor: Monitor, name: str) -> None:
        now_ns = self._clock.now_ns()
        self._bench.transcript.note(monitor.limit.id, name, now_ns, now_ns)
        try:
            if late_s := monitor.late_s(now_ns):
                self._watch.late(monitor.limit.id, late_s)
            figure, trip = monitor.take(self._clock.now_ns)
        except DeviceFault as fault:
            self._tell(monitor, fault)
            trip = monitor.stale(self._clock.now_ns())
            figure = Figure(value=float("nan"), unit=monitor.limit.unit)
            if trip:
                trip = Trip(trip.limit, trip.value, trip.unit, f"{trip.text} ({fault})")
        else:
            self._tell_of_silence(monitor, self._clock.now_ns() - now_ns)
        self._watch.reading(monitor.limit.id, self._clock.now(), figure)
        if trip:
            self._trip(trip)

    def _tell_of_silence(self, monitor: Monitor, lasted_ns: int) -> None:
        """Tell of a reading that came in the end, but held the case up: a driver asks again after a silence."""
        if lasted_ns > LONGEST_TRANSACTION * self._bench.speed * NANOSECONDS:
            lasted = f"the {monitor.limit.words} of {monitor.limit.output} came after {lasted_ns / NANOSECONDS:.3g} s"
            instrument = self._instrument(monitor)
            self._tell(monitor, NoReply(instrument.name, f"{lasted}, asked for more than once", "look at its line"))

    def _tell(self, monitor: Monitor, fault: DeviceFault) -> None:
        """Tell the present case: what it records meanwhile has a gap that is the bench's, not the DUT's."""
        if self.faulted is not None:
            self.faulted(self._instrument(monitor), fault)

    def _instrument(self, monitor: Monitor) -> InstrumentSpec:
        spec = self._bench.spec
        return spec.instrument(spec.wire(monitor.limit.output).instrument)


def monitor_of(bench: BoundBench, limit: EnvelopeLimit) -> Monitor:
    """Return the monitor of one limit."""
    if not limit.is_derived:
        return Monitor(limit, _reading(bench, limit.output, limit.quantity), 0)
    derivation = derivation_of(limit)
    return Monitor(limit, _derived_reading(bench, limit, derivation), 0, derivation)


def _reading(bench: BoundBench, output: str, quantity: str) -> Callable[[], Figure]:
    role = bench.roles[output]

    def read() -> Figure:
        figure: Figure = getattr(role, quantity)()
        return figure

    return read


def _derived_reading(bench: BoundBench, limit: EnvelopeLimit, derivation: Derivation) -> Callable[[], Figure]:
    sources = [_reading(bench, output, quantity) for output, quantity in derivation.sources]

    def read() -> Figure:
        numbers = [source().value for source in sources]
        return Figure(value=derivation.row(bench.clock.now_ns(), numbers), unit=limit.unit)

    return read
