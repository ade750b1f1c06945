"""Scheduling points: where time passes, monitors run, and a run can be stopped."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import TYPE_CHECKING, NoReturn

from hil.bench.bound import BoundBench
from hil.bench.envelope import Monitor, Trip
from hil.clock import wall
from hil.clock.port import NANOSECONDS
from hil.executive.ending.stop import StopFlags, Stopped
from hil.executive.watching.feeding import Fed, Feed, Feeds
from hil.executive.watching.monitoring import Monitoring
from hil.executive.watching.ports import Beside, CaseAtWork, Distress, Reports
from hil.executive.watching.sharing import Pace, Share
from hil.executive.watching.timeline import Timeline
from hil.model.bench import InstrumentSpec
from hil.model.errors import DeviceFault, HilError, NoReply, Tripped

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["CaseTimeout", "Scheduler"]

_BENCH = "bench"
_UNWATCHED_NS = 10_000_000_000
"""A bench without an envelope has a scheduling point within this time."""

_TICK_S = 0.2
_SWALLOWED = 10
"""After so many refusals a case has swallowed a stop, and the bench does not wait for its end any more."""

_LEAST_STANDING_S = 5.0
"""A slow machine may take so long for a computation, however short a case's `max_duration` is."""

_MOST_REFUSALS = 100
"""After so many it is never going to end."""


class CaseTimeout(BaseException):
    """The case is past its time, with a sentence if that is not its `max_duration` of bench time.

    Not an Exception, for the reason of `Stopped`.
    """


class Scheduler:
    """Runs due monitors and reads stop flags wherever a case lets time pass or calls a role.

    A due monitor runs in a wait that has room for its reading, so that the wait ends at its instant. Commands
    then happen at the same bench time whether or not there is one more monitor, and so does the physics that
    follows from them. What takes turns beside the case takes them at their instants, and a wait is over for the
    monitors' room at each of them. Only a monitor that is a whole period late, or whose reading would grow too old,
    does not wait for its place: safety goes first.

    Args:
        bench: the bench, whose clock it drives.
        monitors: one per limit of the envelope.
        flags: stop requests.
        reports: what it reports to.
        timeline: decides when what no case asks for happens.

    Attributes:
        clock: the bench's clock.
        deadline_ns: the instant at which the present case has taken too long.
        lost: what was lost that the bench cannot be driven without, if anything was.
        overdue: why the present case has taken too long although bench time says otherwise, empty if it has not.
        refused: how often the current case was asked to end.
        monitoring: runs the monitors.
        feeds: judge the rows of streams.
        timeline: the one that holds now.
        stood_since: the wall's moment since which bench time stands, and no person is awaited.
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
        self._ticked = self.stood_since = wall.monotonic()
        self._stood_at_ns = 0
        self._longest_standing_s = 0.0
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
        """Bench time up to which what the monitors know is good, None while they do not run."""
        if not self.watching:
            return None
        return min((each.good_until_ns for each in self.monitoring.all), default=self.now_ns() + _UNWATCHED_NS)

    def watch_from_now(self) -> None:
        """Begin to run the monitors."""
        self.monitoring.restart()

    @property
    def patience_s(self) -> float | None:
        """Seconds of the wall after which nothing but a call that does not return keeps a case going, None without."""
        return None if self.deadline_ns is None else self._longest_standing_s + _LEAST_STANDING_S

    def rest(self) -> None:
        """Stop running the monitors."""
        self.monitoring.watching = False

    def now_ns(self) -> int:
        """Return the bench's time."""
        return self.clock.now_ns()

    def point(self) -> None:
        """Be a scheduling point in which no time passes.

        Raises:
            Stopped, CaseTimeout, Tripped: see there.
        """
        with self.flags.undisturbed():
            self._look()
            self.timeline.come()
            now_ns = self.clock.now_ns()
            if self._beside:
                self._take_turns(now_ns, None)
                now_ns = self.clock.now_ns()
            if now_ns >= self.monitoring.quiet_ns or self.monitoring.bus.shares:
                self.monitoring.run_overdue(self.timeline)

    def sleep(self, seconds: float) -> None:
        """Let `seconds` of bench time pass."""
        if not seconds >= 0:
            raise ValueError(f"a wait cannot last {seconds} s")
        self.wait_until(self.clock.now_ns() + round(seconds * NANOSECONDS))

    def wait_until(self, when_ns: int, done: Callable[[], bool] | None = None) -> None:
        """Let bench time pass until `when_ns`, or until `done` says so after a turn beside the case."""
        self._look()
        if not self._take_turns(when_ns, done) and not self._pass(when_ns):
            self.monitoring.run_late(when_ns, self.timeline)

    def begin_beside(self, beside: Beside) -> None:
        """Let something take turns beside the case."""
        self._beside.append(beside)

    def end_beside(self, beside: Beside) -> None:
        """Give it no more turns; it may be ended again."""
        if beside in self._beside:
            self._beside.remove(beside)

    def begin_again(self) -> None:
        """Let what takes turns start again, after a time in which nothing did."""
        for beside in tuple(self._beside):
            beside.begin_again()

    def share(self, pace: Pace, fed: Fed = ()) -> Share:
        """Return what a recording that feeds some limits leaves of the bus for others; see `Monitoring.run_before`."""
        if self.watching:
            self._look()
        others = self.monitoring.run_before(pace, fed, self.timeline) if self.watching else []
        return Share(pace, self.now_ns(), others)

    def feed(self, fed: Fed, every_s: float, recording: str) -> Feed:
        """Return what judges a recording's rows. See `Feed`."""
        for _, monitor in fed:
            self._reports.fed(monitor.limit.id, recording)
        return self.feeds.begin(fed, every_s, recording)

    def judge(self, feed: Feed, rows: list[list[float]] | NDArray[np.float64]) -> None:
        """Judge rows that were just fetched.

        Raises:
            Tripped: a row is outside for the last time that the limit allows; the bench was made safe.
        """
        if self.watching and (trip := feed.judge(rows, self.clock.now_ns())):
            self._make_safe(trip)

    def unfeed(self, feed: Feed) -> None:
        """Let the monitors take readings again."""
        self.feeds.end(feed, self.clock.now_ns())
        self.monitoring.look_again()

    def come(self) -> None:
        """Catch up with the present, where people or other processes took time; a replayed bench catches up alike."""
        self.timeline.come()
        self.catch_up()

    def catch_up(self) -> None:
        """Pass the points of a replayed bench at which it caught up in the middle of computations and questions."""
        for held_up in self.timeline.marks():
            if held_up is not None:
                self._blame(held_up)
                continue
            if self._beside and self.watching:
                self._take_turns(self.clock.now_ns(), None)
            self.monitoring.run(self.clock.now_ns(), self.timeline)

    def busy(self, seconds: float) -> None:
        """Note that a case's own code let nobody look after the bench for so many seconds, with outputs on."""
        if (held_up := self.timeline.busy(seconds)) is not None:
            self._blame(held_up)

    def overrun(self, why: str) -> None:
        """End the present case here, and wherever it comes again."""
        self.overdue = self.overdue or why

    def look(self) -> None:
        """Be a scheduling point for a case's own code on a bench of this process: no monitor is due there.

        Raises:
            Stopped, CaseTimeout, Tripped: see there.
        """
        with self.flags.undisturbed():
            self._look()

    def go_on(self) -> None:
        """Let a resumed bench continue by itself from here."""
        self._bench.go_on()
        self.timeline = self.timeline.look()

    def retrace_to(self, at_ns: int) -> None:
        """Let bench time pass up to an instant of the record at which a run was entered."""
        self.clock.wait_until(self.timeline.look_up_ns(at_ns, ()))
        self.timeline = self.timeline.look()
        self.clock.wait_until(at_ns)

    def begin_case(self, case: CaseAtWork, lasts_ns: int) -> None:
        """Give a case its turn at the bench, which takes `lasts_ns` at most."""
        self.deadline_ns = self.clock.now_ns() + lasts_ns
        self._longest_standing_s = max(_LEAST_STANDING_S, lasts_ns / NANOSECONDS)
        self.stood_since, self.overdue = wall.monotonic(), ""
        self.refused = 0
        self.monitoring.case = case
        if not self.watching:  # the bench was made safe under the case before
            self.watch_from_now()

    def put_off(self, passed_ns: int) -> None:
        """Give the present case that much more time: its run was interrupted, and no pause makes a case too long."""
        if self.deadline_ns is not None:
            self.deadline_ns += passed_ns

    def end_case(self) -> None:
        """End the turn of the present case."""
        self.deadline_ns = self.monitoring.case = None

    def hear(self, instrument: InstrumentSpec, fault: DeviceFault) -> None:
        """Hear of a fault of the bench; silence of a bench outside this process is a loss, see `lose`.

        Nonsense of a port that is there is none, nor is silence in this process or in a record: no cable is pulled.

        Raises:
            Stopped: it is a loss; the case is resumed, and not judged.
        """
        if isinstance(fault, NoReply) and not instrument.dut and self._bench.live and not self.timeline.retraces:
            distress = Distress(fault.message, "port" if fault.gone else "reply", instrument.name)
            self.lose(distress)
            raise Stopped(distress.reason)

    def lose(self, distress: Distress) -> None:
        """Make safe what cannot be driven any more, and let the run stay open; the case learns of it where it is."""
        self.refused += 1
        if self.lost is None:
            self.lost = distress
            self._reports.lost(distress)

    def idle(self) -> None:
        """Be a scheduling point while a person is awaited; monitors take their turn as in any other wait."""
        self.stood_since = wall.monotonic()
        self.point()

    def _take_turns(self, until_ns: int, done: Callable[[], bool] | None) -> bool:
        """Let time pass from turn to turn, in order of time, up to the last one before `until_ns`; tell if `done`."""
        while self._beside:
            beside = min(self._beside, key=attrgetter("due_ns")) if len(self._beside) > 1 else self._beside[0]
            due_ns = beside.due_ns
            if due_ns > until_ns:
                return False
            if not (waited := self._pass(due_ns)):
                self._look()
            began_ns = self.clock.now_ns()
            beside.take()  # first of all: what waits there may be what a monitor misses
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

    def _look(self) -> None:
        if self.timeline.retraces:
            self.catch_up()
            self.timeline = self.timeline.look()
            self._reports.hold_as_recorded()
        now = wall.monotonic()
        if now - self._ticked >= _TICK_S:
            self._ticked = now
            self._reports.tick()
            self._see_time_pass(now)
        try:
            self._end_if_due()
        except (Stopped, Tripped, CaseTimeout) as ending:
            self._refuse(ending)
            raise

    def _see_time_pass(self, now: float) -> None:
        """Let seconds of the wall count where bench time stands still: it would let a case go on for ever.

        It is allowed to stand while a person is asked, and while the bench is held.
        """
        at_ns = self.clock.now_ns()
        if self.deadline_ns is None or at_ns != self._stood_at_ns:
            self._stood_at_ns, self.stood_since = at_ns, now
        elif now - self.stood_since > self._longest_standing_s:
            self.overrun(f"the case ran for {now - self.stood_since:.0f} s without letting any bench time pass")

    def _end_if_due(self) -> None:
        self.flags.check()
        if self._trip:
            raise Tripped(self._trip.text, "the bench was made safe and stays so for the rest of the run")
        if self.monitoring.watching and (distress := self.timeline.distress()):
            if distress.what:
                self.lose(distress)
                raise Stopped(distress.reason)
            self._trip_once(Trip(_BENCH, None, "", distress.text))
        if self.deadline_ns is not None and self.clock.now_ns() > self.deadline_ns:
            raise CaseTimeout
        if self.overdue:
            raise CaseTimeout(self.overdue)

    def _refuse(self, ending: BaseException) -> None:
        """Make safe what the case is not to drive any more, before it learns why; end a run that it does not let end.

        A case that is stopped for the first time still has the time of its own teardown.
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
            self._make_safe(trip)

    def _make_safe(self, trip: Trip) -> NoReturn:
        self._trip = trip
        self._reports.trip(trip)
        raise Tripped(trip.text, "the bench was made safe and stays so for the rest of the run")
