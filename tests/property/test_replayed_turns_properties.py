"""A replay takes the turns of a bench outside the process in the order in which they were taken there."""

from __future__ import annotations

from itertools import cycle
from types import SimpleNamespace

from case_parts import Watch, limit
from hypothesis import example, given
from hypothesis import strategies as st

from hil.bench.envelope import Monitor
from hil.clock.live import LiveClock
from hil.clock.port import NANOSECONDS
from hil.clock.virtual import VirtualClock
from hil.executive.ending.stop import StopFlags
from hil.executive.watching.ports import NoMachine
from hil.executive.watching.recorded import timeline_of
from hil.executive.watching.scheduler import Scheduler
from hil.model.figure import Figure
from hil.wire.replay import Playback
from hil.wire.transcript import Transcript, read_transcript


class Turns:
    """Something that takes turns beside a case: an operation every few seconds of bench time."""

    def __init__(self, side, name, period_s):
        self.what = name
        self._side, self._period_ns = side, round(period_s * NANOSECONDS)
        self.due_ns = self._period_ns

    def take(self):
        """Take one; the next is due at the next multiple of the period that is not over by then."""
        self._side.operate(self.what)
        self.due_ns = (self._side.clock.now_ns() // self._period_ns + 1) * self._period_ns


class Side:
    """A case's scheduler and what it operates on, live or in a replay."""

    def __init__(self, clock, bench, plan, operate):
        self.clock, self.course, self.operate = clock, 0, operate
        monitors = [
            Monitor(limit(f"limit-{number}", period=period, max_age=1e6), self._reader(f"psu{number}"), 0)
            for number, period in enumerate(plan.periods)
        ]
        timeline = timeline_of(bench, NoMachine(), self)
        self.scheduler = Scheduler(bench, monitors, StopFlags(), Watch(), timeline)
        self.scheduler.watch_from_now()
        for number, period in enumerate(plan.beside):
            self.scheduler.begin_beside(Turns(self, f"stream{number}", period))

    def _reader(self, device):
        def read():
            self.operate(device)
            return Figure(value=5.0, unit="V")

        return read

    def call(self):
        """Do what a case's call of an instrument does."""
        self.scheduler.point()
        self.operate("dut")
        self.event()

    def event(self):
        """Write an event."""
        self.scheduler.catch_up()
        self.course += 1


class Plan(SimpleNamespace):
    """What a case does, and beside what: periods and durations in s."""


_SECONDS = st.floats(0.01, 4.0)
_STEPS = st.one_of(
    st.tuples(st.just("computes"), _SECONDS),
    st.tuples(st.just("is asked"), st.lists(_SECONDS, max_size=4)),
    st.tuples(st.just("calls"), st.none()),
    st.tuples(st.just("passes"), st.none()),
    st.tuples(st.just("writes"), st.none()),
    st.tuples(st.just("sleeps"), _SECONDS),
    st.tuples(st.just("samples"), _SECONDS),
)
PLANS = st.builds(
    Plan,
    periods=st.lists(st.floats(0.5, 5.0), max_size=3),
    beside=st.lists(st.floats(0.5, 5.0), max_size=3),
    takes=st.lists(st.floats(0.0, 0.8), min_size=1, max_size=7),
    steps=st.lists(_STEPS, min_size=1, max_size=12),
)


def _bench(clock, transcript, live=None, playback=None):
    return SimpleNamespace(
        clock=clock, live=live, playback=playback, speed=1.0, transcript=transcript, ports=[], go_on=lambda: None
    )


def recorded(plan, path, *, live):
    """Let a plan happen on a bench outside the process, whose time is that of the wall, or on one in it."""
    wall, takes = [0], cycle(plan.takes)

    def passes(seconds):
        wall[0] += round(seconds * NANOSECONDS)

    real = LiveClock("2026-01-01T00:00:00Z", real_ns=lambda: wall[0], pause=passes)
    clock = real if live else VirtualClock()
    with path.open("wb", buffering=0) as sink:
        transcript = Transcript(sink)

        def operate(device):
            began_ns = clock.now_ns()
            if live:
                passes(next(takes))
                real.look()
            else:
                clock.sleep(next(takes))
            transcript.note(device, "read", began_ns, clock.now_ns())

        side = Side(clock, _bench(clock, transcript, live=real if live else None), plan, operate)
        real.begin()
        for step, how in plan.steps:
            if step == "computes":
                passes(how)
            if step == "is asked":
                for seconds in how:
                    passes(seconds)
                    side.scheduler.idle()
            _takes(side, step, how)
        transcript.flush()


def replayed(plan, path):
    """Let the same happen on its record; return whether all of it was asked for."""
    clock = VirtualClock()
    playback = Playback(path, clock, lambda: "a step")
    side = Side(
        clock,
        _bench(clock, Transcript(None), playback=playback),
        plan,
        lambda device: playback.take(device, "read"),
    )
    for step, how in plan.steps:
        _takes(side, step, how)
    side.scheduler.catch_up()
    return playback.exhausted


def _takes(side, step, how):
    match step:
        case "calls":
            side.call()
        case "passes":
            side.scheduler.point()
        case "writes":
            side.event()
        case "sleeps":
            side.scheduler.sleep(how)
            side.event()
        case "samples":
            first_ns = side.scheduler.in_ns(0.0)
            for turn in range(4):
                side.scheduler.wait_for_sample(first_ns + round(turn * how * NANOSECONDS))
                side.operate("sensor")
            side.event()


def happens(beside, periods, takes, *steps):
    """Return a plan whose readings and turns all take the same time."""
    return Plan(beside=beside, periods=periods, takes=[takes], steps=steps)


LATE, CALL = ("computes", 1.0), ("calls", None)


@example(plan=happens([], [], 0.0, LATE, CALL), live=True)  # time goes on at a point
@example(plan=happens([1.0, 1.5], [1.0], 0.5, ("passes", None), LATE, CALL), live=True)  # others come due meanwhile
@example(plan=happens([1.0], [], 0.0, ("is asked", [1.0]), ("sleeps", 1.0)), live=True)  # before a wait
@example(plan=happens([0.5], [], 0.5, CALL, ("is asked", [1.0])), live=False)  # a person is asked, and no time passes
@example(plan=happens([3.0], [1.0, 0.5], 0.5, ("sleeps", 1.0), ("sleeps", 1.0)), live=False)  # a wait ends in a reading
@given(PLANS, st.booleans())
def test_a_replay_takes_every_turn_where_it_was_taken(tmp_path_factory, plan, live):
    """Readings and turns take time, in which others come due; a person is not asked again."""
    path = tmp_path_factory.mktemp("record") / "transcript.tsv"
    recorded(plan, path, live=live)
    assert replayed(plan, path), list(read_transcript(path))
