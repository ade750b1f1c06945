"""A replay takes the turns of a bench outside the process in the order in which they were taken there."""

from __future__ import annotations

from itertools import cycle
from types import SimpleNamespace
from unittest import mock

from case_parts import Watch, Written, limit
from hypothesis import example, given
from hypothesis import strategies as st

from hil.bench.envelope import Monitor
from hil.clock.live import LiveClock
from hil.clock.port import NANOSECONDS
from hil.clock.virtual import VirtualClock
from hil.evidence.events import HoldAsked
from hil.executive.ending.stop import StopFlags
from hil.executive.watching.holding import Holding
from hil.executive.watching.ports import NoMachine
from hil.executive.watching.recorded import timeline_of
from hil.executive.watching.scheduler import Scheduler
from hil.model.bench import SafeStep
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


class Keeper(Watch):
    """Holds the bench where its record does."""

    holding: Holding

    def hold_as_recorded(self):
        """Hold it."""
        self.holding.hold_as_recorded()

    def tick(self):
        """Hold it if that was asked for."""
        self.holding.tick()


class Side:
    """A case's scheduler and what it operates on, live or in a replay."""

    def __init__(self, clock, bench, plan, operate):
        self.clock, self.course, self.operate = clock, 0, operate
        monitors = [
            Monitor(limit(f"limit-{number}", period=period, max_age=1e6), self._reader(f"psu{number}"), 0)
            for number, period in enumerate(plan.periods)
        ]
        timeline, flags, keeper = timeline_of(bench, NoMachine(), self), StopFlags(), Keeper()
        self.scheduler = Scheduler(bench, monitors, flags, keeper, timeline)
        self.holding = keeper.holding = Holding(bench, flags, Written(), self.scheduler)
        bench.spec = SimpleNamespace(hold=(SafeStep(output="supply.coil", state="off", within_s=1e6),), wiring=())
        bench.roles = {"supply.coil": SimpleNamespace(disable=lambda: operate("coil"))}
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
    st.tuples(st.just("is held"), st.lists(_SECONDS, max_size=4)),
    st.tuples(st.just("calls"), st.none()),
    st.tuples(st.just("passes"), st.none()),
    st.tuples(st.just("writes"), st.none()),
    st.tuples(st.just("sleeps"), _SECONDS),
    st.tuples(st.just("is held in a sleep of 3 s"), st.lists(_SECONDS, max_size=4)),
    st.tuples(st.just("samples"), _SECONDS),
)
PLANS = st.builds(
    Plan,
    periods=st.lists(st.floats(0.5, 5.0), max_size=3),
    beside=st.lists(st.floats(0.5, 5.0), max_size=3),
    takes=st.lists(st.floats(0.0, 0.8), min_size=1, max_size=7),
    steps=st.lists(_STEPS, min_size=1, max_size=12),
)


def _bench(clock, transcript, *, outside, live=None, playback=None):
    parts = {"clock": clock, "transcript": transcript, "outside": outside, "live": live, "playback": playback}
    return SimpleNamespace(**parts, speed=1.0, ports=[])


class Wall:
    """The wall's time, and a person who asks for holds and releases them by it."""

    def __init__(self):
        self.now_ns = 0
        self.asks_in = 0
        self.held_for = iter(())
        self.holding = None

    def passes(self, seconds):
        """Let time pass, some slices of which are waited for before a hold is asked for."""
        self.now_ns += round(seconds * NANOSECONDS)
        self.asks_in -= 1
        if self.asks_in == 0:
            self.hold()

    def hold(self):
        """Ask for a hold."""
        self.holding(HoldAsked(release=False, by="Ada", text="the door"))

    def pause(self, _seconds):
        """Let time pass in a hold, then release it."""
        if (seconds := next(self.held_for, None)) is None:
            self.holding(HoldAsked(release=True, by="Ada", text=""))
        else:
            self.passes(seconds)

    def monotonic(self):
        """Return its seconds."""
        return self.now_ns / NANOSECONDS

    def lives(self, side, step, how):
        """Live through what a replay does not have."""
        self.holding, self.asks_in = side.holding, 8 if step == "is held in a sleep of 3 s" else 0
        if step == "computes":
            self.passes(how)
        if step in {"is asked", "is held"}:
            for seconds in how:
                self.passes(seconds)
                side.scheduler.idle()
        if step.startswith("is held"):
            self.held_for = iter(how)
        if step == "is held":
            self.hold()
            side.holding.tick()


def recorded(plan, path, *, live):
    """Let a plan happen on a bench outside the process, whose time is that of the wall, or on one in it."""
    wall, takes = Wall(), cycle(plan.takes)
    real = LiveClock("2026-01-01T00:00:00Z", real_ns=lambda: wall.now_ns, pause=wall.passes)
    clock = real if live else VirtualClock()
    with (
        path.open("wb", buffering=0) as sink,
        mock.patch("hil.clock.wall.monotonic", wall.monotonic),
        mock.patch("hil.clock.wall.pause", wall.pause),
    ):
        transcript = Transcript(sink)

        def operate(device):
            began_ns = clock.now_ns()
            if live:
                wall.passes(next(takes))
                real.look()
            else:
                clock.sleep(next(takes))
            transcript.note(device, "read", began_ns, clock.now_ns())

        bench = _bench(clock, transcript, outside=live, live=real if live else None)
        side = Side(clock, bench, plan, operate)
        real.begin()
        for step, how in plan.steps:
            wall.lives(side, step, how)
            _takes(side, step, how)
        side.scheduler.point()
        transcript.flush()


def replayed(plan, path, *, live):
    """Let the same happen on its record; return whether all of it was asked for, and came to the same transcript."""
    clock = VirtualClock()
    playback = Playback(path, clock, lambda: "a step")
    with path.with_suffix(".again").open("wb", buffering=0) as sink:
        transcript = Transcript(sink)

        def operate(device):
            found = playback.take(device, "read")
            transcript.note(device, "read", found.start_ns, found.end_ns)

        side = Side(clock, _bench(clock, transcript, outside=live, playback=playback), plan, operate)
        for step, how in plan.steps:
            _takes(side, step, how)
        side.scheduler.point()
        transcript.flush()
    return playback.exhausted and path.read_bytes() == path.with_suffix(".again").read_bytes()


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
        case "is held in a sleep of 3 s":
            side.scheduler.sleep(3.0)
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


LATE, CALL, HELD = ("computes", 1.0), ("calls", None), ("is held", [1.0])


@example(plan=happens([], [], 0.0, LATE, CALL), live=True)  # time goes on at a point
@example(plan=happens([1.0, 1.5], [1.0], 0.5, ("passes", None), LATE, CALL), live=True)  # others come due meanwhile
@example(plan=happens([1.0], [], 0.0, ("is asked", [1.0]), ("sleeps", 1.0)), live=True)  # before a wait
@example(plan=happens([0.5], [], 0.5, CALL, ("is asked", [1.0])), live=False)  # a person is asked, and no time passes
@example(plan=happens([3.0], [1.0, 0.5], 0.5, ("sleeps", 1.0), ("sleeps", 1.0)), live=False)  # a wait ends in a reading
@example(plan=happens([], [1.0], 0.0, ("sleeps", 1.0), ("is held", [])), live=False)  # held right after a wait
@example(plan=happens([1.0], [], 0.0, HELD, ("sleeps", 1.0)), live=True)  # a wait lasts from the end of a hold
@example(plan=happens([], [1.0], 0.0, HELD, ("writes", None)), live=True)  # an event comes after a hold
@example(plan=happens([], [], 0.0, HELD, HELD, CALL), live=True)  # one hold after the other
@example(plan=happens([], [0.5], 0.0, ("is held in a sleep of 3 s", [1.0]), HELD), live=True)  # held in a wait
@example(  # a hold follows a reading in a wait
    plan=Plan(periods=[1.0, 0.5], beside=[], takes=[0.0, 0.0, 0.5], steps=[("is held in a sleep of 3 s", [])]),
    live=True,
)
@given(PLANS, st.booleans())
def test_a_replay_takes_every_turn_where_it_was_taken(tmp_path_factory, plan, live):
    """Readings and turns take time, in which others come due; a person is not asked again."""
    path = tmp_path_factory.mktemp("record") / "transcript.tsv"
    recorded(plan, path, live=live)
    assert replayed(plan, path, live=live), list(read_transcript(path))
