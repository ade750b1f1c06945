"""Monitors and heartbeats during a run: each takes its turn when due, or in a replay as recorded."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import ClassVar, cast

from hil.bench.bound import BoundBench
from hil.bench.derived.derivation import Derivation
from hil.bench.derived.quantities import derivation_of
from hil.bench.envelope import Monitor, Trip
from hil.clock.port import NANOSECONDS, Clock
from hil.executive.watching.feeding import Fed
from hil.executive.watching.ports import CaseAtWork, Reports
from hil.executive.watching.sharing import Bus, Pace, Share
from hil.executive.watching.timeline import Timeline
from hil.instruments.registry import inputs_of
from hil.instruments.roles import Beaten
from hil.instruments.signal_roles import DataAcquisition
from hil.model.bench import InstrumentSpec, Wire
from hil.model.envelope import EnvelopeLimit
from hil.model.errors import DeviceFault, NoReply, Refused, Rejected
from hil.model.figure import Figure
from hil.wire.replay import MONITOR, OVERDUE, Place
from hil.wire.tap import LONGEST_TRANSACTION

__all__ = ["Heartbeat", "Monitoring", "heartbeats_of", "monitor_of"]

_BEATS = 3
"""Heartbeats per timeout of a watchdog: two may be lost."""

_LAG_NS = NANOSECONDS // 10
"""More than a monitor's turn delays the samples of a recording, which catch up with it."""


class _Ahead(Bus):
    """The bus before a recording's first sample, which is taken when everything that cannot wait has been read.

    Args:
        pace: of the recording.
        monitors: those that its rows do not feed.
    """

    looks_ahead: ClassVar[bool] = True

    def __init__(self, pace: Pace, monitors: Sequence[Monitor]) -> None:
        super().__init__()
        self._pace = pace
        self._monitors = monitors

    def room(self, monitor: Monitor, now_ns: int, until_ns: int) -> bool:
        """Return whether a monitor would later have to be read between two samples, without room for that."""
        del until_ns
        return Share(self._pace, now_ns, self._monitors).before(monitor)


class Monitoring:
    """Runs the monitors of a bench.

    Args:
        bench: the bench.
        monitors: one per limit of the envelope.
        reports: called with every reading.
        trip: makes the bench safe on the first trip, and ends what the case does.
        hear: called with faults outside cases; raises if the bench can no longer be driven.

    Attributes:
        watching: whether they run.
        case: is notified when a monitor's device is silent or talks nonsense, None between cases.
        soonest_ns: before this instant none is due.
        quiet_ns: before this instant none is read at a call, unless a recording shares the bus.
        bus: decides when one may be read.
    """

    def __init__(
        self,
        bench: BoundBench,
        monitors: Sequence[Monitor],
        reports: Reports,
        trip: Callable[[Trip], None],
        hear: Callable[[InstrumentSpec, DeviceFault], None],
    ) -> None:
        self.all = list(monitors)
        self.watching = False
        self.case: CaseAtWork | None = None
        self.soonest_ns = self.quiet_ns = 0
        self.bus = Bus()
        self._bench = bench
        self._clock = bench.clock
        self._reports = reports
        self._trip = trip
        self._hear = hear

    def restart(self) -> None:
        """Start or restart watching."""
        for monitor in self.all:
            monitor.restart(self._clock.now_ns())
        self.look_again()
        self.watching = True

    def look_again(self) -> None:
        """Consider every monitor at the next turn: some may now be due sooner."""
        self.soonest_ns = self.quiet_ns = 0

    def look_up_ns(self, when_ns: int, timeline: Timeline) -> int:
        """Return when a wait until `when_ns` must pause: for one of them, where a record has it, or at its end."""
        return when_ns if self.soonest_ns > when_ns else timeline.look_up_ns(when_ns, self.all if self.watching else ())

    def run(self, until_ns: int, timeline: Timeline) -> None:
        """Run those whose turn is before `until_ns`, if watching."""
        if not self.watching or self.soonest_ns > until_ns + self.bus.lead_ns:
            return
        name = MONITOR if self._clock.now_ns() < until_ns else OVERDUE
        for monitor in timeline.due(self.all, until_ns, name, self.bus):
            self._take(monitor, name, timeline.places.here())
        self.soonest_ns = timeline.soonest_ns(self.all)

    def run_overdue(self, timeline: Timeline) -> None:
        """Run those that cannot wait for the next wait of the case."""
        self.run(self._clock.now_ns(), timeline)
        self.quiet_ns = timeline.quiet_ns(self.all)

    def beside(self, fed: Fed) -> list[Monitor]:
        """Return the monitors that are not fed by rows."""
        return [monitor for monitor in self.all if all(monitor is not each for _, each in fed)]

    def run_before(self, pace: Pace, fed: Fed, timeline: Timeline) -> list[Monitor]:
        """Run, before the first sample of a recording, those that would be due between samples without room there.

        Args:
            pace: of the recording.
            fed: the limits that its rows feed, which are not read meanwhile.
            timeline: knows what a record has here.

        Returns:
            the other limits.
        """
        monitors = waiting = self.beside(fed)
        while waiting:  # the time of one reading may leave no room for another, which then also goes before
            ahead, read = _Ahead(pace, monitors), []
            for monitor in timeline.due(waiting, self._clock.now_ns(), OVERDUE, ahead):
                self._take(monitor, OVERDUE, timeline.places.here())
                read.append(monitor)
            if not read:
                break
            waiting = [each for each in waiting if each not in read]
        return monitors

    def run_late(self, when_ns: int, timeline: Timeline) -> None:
        """Run those that are overdue if a wait until `when_ns` would begin long after its end.

        A case whose waits fall ever further behind leaves none for a monitor's turn. One that is a little late goes on
        at once: a wait after this one has room.
        """
        now_ns = self._clock.now_ns()
        if now_ns >= when_ns + _LAG_NS:
            self.run(now_ns, timeline)

    def _take(self, monitor: Monitor, name: str, place: Place) -> None:
        now_ns, silences = self._clock.now_ns(), self._silences()
        self._bench.transcript.note(monitor.limit.id, name, now_ns, now_ns, sent=place.sent)
        try:
            if late_s := monitor.late_s(now_ns):
                self._reports.late(monitor.limit.id, late_s)
            figure, trip = monitor.take(self._clock.now_ns)
        except DeviceFault as fault:
            self._report_fault(monitor, fault)
            trip = monitor.stale(self._clock.now_ns())
            figure = Figure(value=float("nan"), unit=monitor.limit.unit)
            if trip:
                trip = Trip(trip.limit, trip.value, trip.unit, f"{trip.text} ({fault})")
        else:
            if self._silences() > silences:
                self._report_silence(monitor, self._clock.now_ns() - now_ns)
        self.bus.note(f"the reading of {monitor.limit.id}", now_ns, self._clock.now_ns())
        self._reports.reading(monitor.limit.id, self._clock.now(), figure)
        if trip:
            self._trip(trip)
        self.look_again()  # after a reading outside the next one is due sooner

    def _report_silence(self, monitor: Monitor, lasted_ns: int) -> None:
        """Report a reading that came in the end, but delayed the case: a driver retries after a silence."""
        if lasted_ns > LONGEST_TRANSACTION * self._bench.speed * NANOSECONDS:
            lasted = f"the {monitor.limit.words} of {monitor.limit.output} came after {lasted_ns / NANOSECONDS:.3g} s"
            instrument = self._instrument(monitor)
            self._report_fault(
                monitor, NoReply(instrument.name, f"{lasted}, asked for more than once", "check its line")
            )

    def _silences(self) -> int:
        return sum([port.silences for port in self._bench.ports])

    def _report_fault(self, monitor: Monitor, fault: DeviceFault) -> None:
        """Report a fault to the present case: a gap in its recordings is then the bench's, not the DUT's."""
        if self.case is not None:
            self.case.fault(self._instrument(monitor), fault)
        elif self._bench.live is not None:
            self._hear(self._instrument(monitor), fault)

    def _instrument(self, monitor: Monitor) -> InstrumentSpec:
        spec = self._bench.spec
        return spec.instrument(spec.wire(monitor.limit.output).instrument)


class Heartbeat:
    """Heartbeat that keeps one instrument's watchdog from opening its output; takes turns beside the case.

    An unanswered heartbeat is retried at its next turn, of which there are three before the watchdog opens the output.
    One that comes too late finds the output off, so that the case drives something other than it thinks.

    Args:
        output: the role instance.
        instrument: the one whose watchdog it is.
        clock: the bench's.
        monitoring: knows the case at work.
    """

    def __init__(self, output: Beaten, instrument: InstrumentSpec, clock: Clock, monitoring: Monitoring) -> None:
        self._output = output
        self._instrument = instrument
        self._clock = clock
        self._monitoring = monitoring
        self.what = f"the heartbeat of {instrument.name}"
        self.due_ns = 0
        self.begin_again()

    def take(self) -> None:
        """Send one.

        Raises:
            Rejected: the watchdog has opened the output.
        """
        self.begin_again()
        try:
            self._output.beat()
        except DeviceFault as fault:
            if self._monitoring.case is not None:
                self._monitoring.case.fault(self._instrument, fault)
            if isinstance(fault, Rejected):
                raise

    def begin_again(self) -> None:
        """Count from now."""
        self.due_ns = self._clock.now_ns() + round(self._output.watchdog_s / _BEATS * NANOSECONDS)


def heartbeats_of(bench: BoundBench, monitoring: Monitoring) -> list[Heartbeat]:
    """Return the heartbeats that the outputs of a bench need."""
    spec = bench.spec
    return [
        Heartbeat(role, spec.instrument(spec.wire(name).instrument), bench.clock, monitoring)
        for name, role in bench.roles.items()
        if isinstance(role, Beaten) and role.watchdog_s
    ]


def monitor_of(bench: BoundBench, limit: EnvelopeLimit) -> Monitor:
    """Return the monitor of one limit."""
    if not limit.is_derived:
        return Monitor(limit, _reading(bench, limit.output, limit.quantity), 0)
    derivation = derivation_of(limit)
    return Monitor(limit, _derived_reading(bench, limit, derivation), 0, derivation)


def _reading(bench: BoundBench, output: str, quantity: str) -> Callable[[], Figure]:
    role, wire = bench.roles[output], bench.spec.wire(output)
    if quantity in inputs_of(bench.spec.instrument(wire.instrument).driver, wire):
        return _input_reading(wire, cast("DataAcquisition", role), quantity)

    def read() -> Figure:
        figure: Figure = getattr(role, quantity)()
        return figure

    return read


def _input_reading(wire: Wire, role: DataAcquisition, name: str) -> Callable[[], Figure]:
    """Return a function that reads an input by its name; while the inputs are recorded, only rows show it."""

    def read() -> Figure:
        try:
            return role.read(name)
        except Refused as error:
            raise NoReply(wire.instrument, f"{error.message}, and no rows come", "see why they do not") from error

    return read


def _derived_reading(bench: BoundBench, limit: EnvelopeLimit, derivation: Derivation) -> Callable[[], Figure]:
    sources = [_reading(bench, output, quantity) for output, quantity in derivation.sources]

    def read() -> Figure:
        numbers = [source().value for source in sources]
        return Figure(value=derivation.row(bench.clock.now_ns(), numbers), unit=limit.unit)

    return read
