"""Scheduling points: where time passes, monitors run, and a run can be stopped."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import TYPE_CHECKING

from hil.bench.bound import BoundBench
from hil.bench.envelope import Monitor, Trip
from hil.clock import wall
from hil.clock.port import NANOSECONDS
from hil.executive.ending.stop import StopFlags, Stopped
from hil.executive.watching.feeding import Fed, Feed, Feeds
from hil.executive.watching.monitoring import Monitoring
from hil.executive.watching.ports import Beside, CaseAtWork, Distress, Reports
from hil.executive.watching.sharing import Pace, Share
from hil.executive.watching.standstill import Standstill
from hil.executive.watching.timeline import BENCH, Timeline
from hil.model.bench import InstrumentSpec
from hil.model.errors import DeviceFault, HilError, NoReply, Tripped

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["CaseTimeout", "Scheduler"]

_UNWATCHED_NS = 10_000_000_000
"""Longest time between scheduling points on a bench without an envelope."""

_TICK_S = 0.2
_SWALLOWED = 10
"""After this many refusals a case has swallowed a stop, and the bench no longer waits for its end."""

_MOST_REFUSALS = 100
"""After this many refusals a case is never going to end."""


class CaseTimeout(BaseException):
    """The case has timed out, with a sentence if that is not for its `max_duration` of bench time.

    Not an Exception, for the reason of `Stopped`.
    """


class Scheduler:
    """Runs due monitors and reads stop flags wherever a case lets time pass or calls a role.

    A due monitor runs in a wait that has room for its reading, so that the wait ends on time. Commands then happen at
    the same bench time whether or not there is one more monitor, and so does the physics that follows from them. What
    takes turns beside the case takes them on time, and for the monitors' room a wait ends at each turn. Only a monitor
    that is a whole period late, or whose last reading would become too old, does not wait for room: safety goes first.

    Args:
        bench: the bench, whose clock it drives.
        monitors: one per limit of the envelope.
        flags: stop requests.
        reports: what it reports to.
        timeline: decides when things happen that no case asks for.

    Attributes:
        clock: the bench's clock.
        deadline_ns: the instant at which the present case times out.
        lost: what was lost and is needed to drive the bench, None if nothing was.
        overdue: why the present case has taken too long although bench time says otherwise, empty if it has not.
        refused: how many times the present case was asked to end.
        monitoring: runs the monitors.
        feeds: judge the rows of streams.
        timeline: the present timeline.
        standstill: limits the wall time of a case that lets no bench time pass.
    """

    def __init__(
        self,
        bench: BoundBench,
        monitors: Sequence[Monitor],
        flags: StopFlags,
        reports: Reports,
        timeline: Timeline,
    ) -> None:
        self._bench = bench
        self.clock = bench.clock
        self.flags = flags
        self._reports = reports
        self.timeline = timeline
        self.standstill = Standstill(bench.clock)
        self._ticked = wall.monotonic()
        self.overdue = ""
        self._trip: Trip | None = None
        self.lost: Distress | None = None
        self._beside: list[Beside] = []
        self.feeds = Feeds()
        self.monitoring = Monitoring(bench, monitors, reports, self._trip_once, self.hear)
        self.deadline_ns: int | None = None
        self.refused = 0

    @property
    def tripped(self) -> Trip | None:
        """What tripped the bench, if anything did."""
        return self._trip

    @property
    def watching(self) -> bool:
        """Whether the monitors run."""
        return self.monitoring.watching

    @property
    def fresh_until_ns(self) -> int | None:
        """Bench time until which the monitors' readings are valid, None while they do not run."""
        if not self.watching:
            return None
        return min((each.good_until_ns for each in self.monitoring.all), default=self.now_ns() + _UNWATCHED_NS)

    def watch_from_now(self) -> None:
        """Begin to run the monitors."""
        self.monitoring.restart()

    @property
    def patience_s(self) -> float | None:
        """Wall-clock seconds after which only a call that does not return keeps a case going, None without a limit."""
        return None if self.deadline_ns is None else self.standstill.patience_s

    def rest(self) -> None:
        """Stop running the monitors."""
        self.monitoring.watching = False

    def now_ns(self) -> int:
        """Return the bench's time."""
        return self.clock.now_ns()

    def in_ns(self, seconds: float) -> int:
        """Return the bench's time in `seconds`; a replay catches up before."""
        self._arrive()
        return self.clock.now_ns() + round(seconds * NANOSECONDS)

    def point(self) -> None:
        """Pass a scheduling point in which no time passes.

        Raises:
            Stopped, CaseTimeout, Tripped: see there.
        """
        with self.flags.undisturbed():
            self._enter()
            self.timeline.come()
            self._take_due()

    def sleep(self, seconds: float) -> None:
        """Let `seconds` of bench time pass."""
        if not seconds >= 0:
            raise ValueError(f"a wait cannot last {seconds} s")
        self.wait_until(self.in_ns(seconds))

    def wait_until(self, when_ns: int, done: Callable[[], bool] | None = None) -> None:
        """Let bench time pass until `when_ns`, or until `done` is true after a turn beside the case."""
        self._enter()
        if not self._take_turns(when_ns, done) and not self._pass(when_ns):
            self.monitoring.run_late(when_ns, self.timeline)

    def wait_for_sample(self, due_ns: int) -> None:
        """Let bench time pass until a sample of a recording is due.

        Late samples leave no wait for a monitor's turn: the share of their recording knows which is admitted. A case
        writes events between its waits, and a replay could take a reading on the other side of one.
        """
        self._enter()
        if not self._take_turns(due_ns, None) and not self._pass(due_ns) and self.clock.now_ns() > due_ns:
            self.monitoring.run(self.clock.now_ns(), self.timeline)

    def begin_beside(self, beside: Beside) -> None:
        """Start something that takes turns beside the case."""
        self._beside.append(beside)

    def end_beside(self, beside: Beside) -> None:
        """End its turns; ending it twice is harmless."""
        if beside in self._beside:
            self._beside.remove(beside)

    def begin_again(self) -> None:
        """Restart what takes turns, after a time in which nothing did."""
        for beside in tuple(self._beside):
            beside.begin_again()

    def share(self, pace: Pace, fed: Fed = ()) -> Share:
        """Return the share of the bus that a recording leaves to limits not fed by it; see `Monitoring.run_before`."""
        if self.watching:
            self._enter()
        others = self.monitoring.run_before(pace, fed, self.timeline) if self.watching else []
        return Share(pace, self.now_ns(), others)

    def feed(self, fed: Fed, every_s: float, recording: str) -> Feed:
        """Return the feed that judges a recording's rows. See `Feed`."""
        for _, monitor in fed:
            self._reports.fed(monitor.limit.id, recording)
        return self.feeds.begin(fed, every_s, recording)

    def judge(self, feed: Feed, rows: list[list[float]] | NDArray[np.float64]) -> None:
        """Judge rows that were just fetched.

        Raises:
            Tripped: a row outside completed the limit's debounce; the bench was made safe.
        """
        if self.watching and (trip := feed.judge(rows, self.clock.now_ns())):
            self._trip_once(trip)

    def unfeed(self, feed: Feed) -> None:
        """Have the monitors take readings again."""
        self.feeds.end(feed, self.clock.now_ns())
        self.monitoring.look_again()

    def come(self) -> None:
        """Catch up with the present after people or other processes took time; a replayed bench does the same."""
        self.timeline.come()
        self.catch_up()

    def catch_up(self, *, to_event: bool = True) -> None:
        """Pass where a replayed bench caught up, or was held, in computations and questions; see `Timeline.marks`."""
        for held_up in self.timeline.marks(to_event=to_event):
            if held_up is not None:
                self._blame(held_up)
            elif self.watching:
                self._take_due()
        if self.timeline.retraces:
            self._reports.hold_as_recorded()

    def busy(self, seconds: float) -> None:
        """Note that a case's own code left the bench unattended for this many seconds, with outputs on."""
        if (held_up := self.timeline.busy(seconds)) is not None:
            self._blame(held_up)

    def overrun(self, why: str) -> None:
        """End the present case here, and at every later scheduling point."""
        self.overdue = self.overdue or why

    def look(self) -> None:
        """Pass a scheduling point in a case's own code on a bench in this process: no monitor is due there.

        Raises:
            Stopped, CaseTimeout, Tripped: see there.
        """
        with self.flags.undisturbed():
            self._look()

    def go_on(self) -> None:
        """Let a resumed bench continue on its own from here."""
        self._bench.go_on()
        self.timeline = self.timeline.look()

    def retrace_to(self, at_ns: int) -> None:
        """Let bench time pass up to the instant in the record at which a run was entered."""
        self.clock.wait_until(self.timeline.look_up_ns(at_ns, ()))
        self.timeline = self.timeline.look()
        self.clock.wait_until(at_ns)

    def begin_case(self, case: CaseAtWork, lasts_ns: int) -> None:
        """Begin a case's turn at the bench, which may take `lasts_ns` at most."""
        self.deadline_ns = self.clock.now_ns() + lasts_ns
        self.standstill.begin(lasts_ns / NANOSECONDS)
        self.overdue, self.refused = "", 0
        self.monitoring.case = case
        if not self.watching:  # the bench was made safe during the previous case
            self.watch_from_now()

    def put_off(self, passed_ns: int) -> None:
        """Extend the present case's deadline: its run was interrupted, and a pause does not count against it."""
        if self.deadline_ns is not None:
            self.deadline_ns += passed_ns

    def end_case(self) -> None:
        """End the turn of the present case."""
        self.deadline_ns = self.monitoring.case = None

    def hear(self, instrument: InstrumentSpec, fault: DeviceFault) -> None:
        """Take a fault of the bench; silence of a bench outside this process is a loss, see `lose`.

        Nonsense from an existing port is not a loss, nor is silence in this process or in a record: there is no cable.

        Raises:
            Stopped: it is a loss; the case is resumed, and not judged.
        """
        if isinstance(fault, NoReply) and not instrument.dut and self._bench.live and not self.timeline.retraces:
            distress = Distress(fault.message, "port" if fault.gone else "reply", instrument.name)
            self.lose(distress)
            raise Stopped(distress.reason)

    def lose(self, distress: Distress) -> None:
        """Make safe a bench that can no longer be driven, and let the run stay open; the case then learns of it."""
        self.refused += 1
        if self.lost is None:
            self.lost = distress
            self._reports.lost(distress)

    def idle(self, *, held: bool = False) -> None:
        """Pass a scheduling point while a person is awaited, or the bench is `held`: a replay has only marks of it."""
        self.standstill.excuse()
        with self.flags.undisturbed():
            self._arrive()
            if (self.timeline.come() or (held and not self._bench.outside)) and self.watching:
                self._take_due()

    def _take_due(self) -> None:
        now_ns = self.clock.now_ns()
        if self._beside:
            self._take_turns(now_ns, None)
            now_ns = self.clock.now_ns()
        if now_ns >= self.monitoring.quiet_ns or self.monitoring.bus.shares:
            self.monitoring.run_overdue(self.timeline)

    def _take_turns(self, until_ns: int, done: Callable[[], bool] | None) -> bool:
        """Let time pass from turn to turn, in order, up to the last one before `until_ns`; return whether `done`."""
        while self._beside:
            beside = min(self._beside, key=attrgetter("due_ns")) if len(self._beside) > 1 else self._beside[0]
            due_ns = beside.due_ns
            if due_ns > until_ns:
                return False
            if not (waited := self._pass(due_ns)):
                self._look()
            began_ns = self.clock.now_ns()
            beside.take()  # first of all: its pending rows may be what a monitor misses
            self.monitoring.bus.note(beside.what, began_ns, self.clock.now_ns())
            if not waited:
                self.monitoring.run(self.clock.now_ns(), self.timeline)
            if done is not None and done():
                return True
        return False

    def _pass(self, when_ns: int) -> bool:
        """Let time pass without a turn beside the case; return whether any did."""
        if self.clock.now_ns() >= when_ns:
            return False
        while True:
            self.monitoring.run(when_ns, self.timeline)
            turn_ns = self.monitoring.look_up_ns(when_ns, self.timeline)
            self.clock.wait_until(self.timeline.longest_ns(turn_ns))
            self._look()
            if self.clock.now_ns() >= when_ns:
                return True

    def _enter(self) -> None:
        """Begin a point or a wait of the case."""
        self._arrive()
        self.timeline.places.enter()

    def _arrive(self) -> None:
        self.catch_up(to_event=False)
        self._look()

    def _look(self) -> None:
        if self.timeline.retraces:
            self.timeline = self.timeline.look()
            self._reports.hold_as_recorded()
        now = wall.monotonic()
        if now - self._ticked >= _TICK_S:
            self._ticked = now
            self._reports.tick()
            if too_long := self.standstill.look(now, limited=self.deadline_ns is not None):
                self.overrun(too_long)
        try:
            self._end_if_due()
        except (Stopped, Tripped, CaseTimeout) as ending:
            self._refuse(ending)
            raise

    def _end_if_due(self) -> None:
        self.flags.check()
        if self._trip:
            raise Tripped(self._trip.text, "the bench was made safe and stays so for the rest of the run")
        if self.monitoring.watching and (distress := self.timeline.distress()):
            if distress.what:
                self.lose(distress)
                raise Stopped(distress.reason)
            self._trip_once(Trip(BENCH, None, "", distress.text))
        if self.deadline_ns is not None and self.clock.now_ns() > self.deadline_ns:
            raise CaseTimeout
        if self.overdue:
            raise CaseTimeout(self.overdue)

    def _refuse(self, ending: BaseException) -> None:
        """Make safe what the case may no longer drive, before it learns why; end the run if the case will not end.

        A case stopped for the first time still gets the time of its own teardown.
        """
        self.refused += 1
        patient = isinstance(ending, Stopped) and not self.flags.urgent
        if self.refused == (_SWALLOWED if patient else 1) and not (self.lost or isinstance(ending, Tripped)):
            self._reports.safe()
        if self.refused > _MOST_REFUSALS:
            self._reports.give_up()

    def _blame(self, held_up: HilError) -> None:
        if self.monitoring.case is not None:
            self.monitoring.case.raised(held_up)

    def _trip_once(self, trip: Trip) -> None:
        if self._trip is None:
            self._trip = trip
            self._reports.trip(trip)
            raise Tripped(trip.text, "the bench was made safe and stays so for the rest of the run")
