"""Scheduling points: monitors take their turn, time stays exact, and a run can be stopped."""

from __future__ import annotations

import contextlib
from types import SimpleNamespace

import pytest
from case_parts import Watch, limit, monitor, scheduler

from hil.clock.live import LiveClock
from hil.clock.virtual import VirtualClock
from hil.executive.ending.stop import StopFlags, Stopped
from hil.executive.watching.ports import NoMachine
from hil.executive.watching.recorded import timeline_of
from hil.executive.watching.scheduler import CaseTimeout, Scheduler
from hil.executive.watching.sharing import Pace
from hil.model.errors import NoReply, Tripped
from hil.wire.transcript import Transcript


def watched(*specs, **choices):
    """Return a clock, a scheduler with a monitor per limit, and what it reports to."""
    clock, watch = VirtualClock(), Watch()
    flags = choices.pop("flags", None)
    monitors = [monitor(clock, spec, **choices) for spec in specs]
    return clock, scheduler(clock, *monitors, flags=flags, watch=watch), watch


def test_monitors_run_in_waits_at_their_period():
    """Whether or not a case reads the quantity, it is read as often as the bench file says."""
    _, scheduled, watch = watched(limit())
    scheduled.sleep(5.5)
    assert [round(t) for _, t, _ in watch.readings] == [0, 1, 2, 3, 4, 5]


@pytest.mark.parametrize("extra", [0, 1, 3])
def test_a_wait_ends_at_its_instant(extra):
    """However many monitors there are, what comes after a wait happens at the same time."""
    clock, scheduled, watch = watched(limit(), *(limit(f"extra-{number}") for number in range(extra)))
    ends = []
    for seconds in (0.7, 1.0, 0.33, 2.0, 0.05):
        scheduled.sleep(seconds)
        ends.append(clock.now_ns())
    assert ends == [700_000_000, 1_700_000_000, 2_030_000_000, 4_030_000_000, 4_080_000_000]
    assert len({name for name, _, _ in watch.readings}) == 1 + extra


def test_no_monitor_begins_where_its_reading_would_not_end_in_time():
    """The end of a wait is kept free for as long as a reading takes."""
    clock, scheduled, watch = watched(limit(), takes=0.1)
    scheduled.sleep(0.5)
    scheduled.sleep(0.55)
    assert clock.now() == 1.05
    assert len(watch.readings) == 1
    scheduled.sleep(0.5)
    assert (clock.now(), len(watch.readings)) == (1.55, 2)


def test_a_reading_that_lasts_beyond_the_next_turn_is_followed_by_it():
    """A wait that began with it goes on with the turn that passed during the reading."""
    clock, scheduled, watch = watched(limit(max_age=2.0), takes=0.3)
    scheduled.sleep(0.5)
    clock.sleep(1.3)
    scheduled.sleep(5.0)
    assert [round(t, 1) for _, t, _ in watch.readings] == [0.3, 2.1, 2.4, 3.3, 4.3, 5.3, 6.3]


def test_a_monitor_that_is_overdue_runs_at_a_call_too():
    """A case that never waits is watched all the same."""
    clock, scheduled, watch = watched(limit(max_age=5.0))
    scheduled.sleep(0.5)
    clock.sleep(0.2)
    scheduled.point()
    assert len(watch.readings) == 1
    clock.sleep(3.0)
    scheduled.point()
    assert len(watch.readings) == 2


@pytest.mark.parametrize(("takes", "period"), [(0.0, 1.0), (0.004, 2.0)])
def test_a_case_that_never_waits_is_watched_all_the_same(takes, period):
    """A reading that takes no time is taken when it is due, any other one a period later, whatever else is watched."""
    clock, scheduled, watch = watched(limit(), limit("other", period=0.5), takes=takes)
    scheduled.sleep(0.1)
    for _ in range(100):
        clock.sleep(0.1)
        scheduled.point()
    times = [round(at, 1) for name, at, _ in watch.readings if name == "v"]
    assert times == pytest.approx([turn * period for turn in range(int(10 / period) + 1)], abs=0.11)


def test_a_reading_outside_before_a_recording_is_confirmed_soon():
    """What was found before a recording began is not left until the turn that was foreseen before."""
    values = iter([5.0, 11.0, 11.0])
    clock, scheduled, _ = watched(limit(period=10.0, max_age=30.0, debounce=2), value=lambda: next(values), takes=0.2)
    scheduled.sleep(5.0)
    scheduled.share(Pace("rest", 100_000_000, 10_000_000, 1000, None))
    with pytest.raises(Tripped):
        scheduled.sleep(3.0)
    assert clock.now() < 7.0


def test_a_reading_outside_trips_once_and_for_all():
    """The bench is made safe before the case learns of it, and every later point raises again."""
    clock, scheduled, watch = watched(limit(maximum=4.0))
    with pytest.raises(Tripped, match=r"voltage 5 V is above 4 V"):
        scheduled.sleep(1.0)
    for attempt in (scheduled.point, scheduled.idle, lambda: scheduled.sleep(1.0)):
        with pytest.raises(Tripped, match="stays so for the rest of the run"):
            attempt()
    assert len(watch.trips) == 1
    assert scheduled.tripped is watch.trips[0]
    assert clock.now() < 1.0


def test_the_debounce_counts_readings_in_a_row():
    """One reading outside is looked at again; as many as the debounce in a row trip."""
    values = iter([11.0, 5.0, 11.0, 11.0])
    _, scheduled, watch = watched(limit(debounce=2), value=lambda: next(values))
    with pytest.raises(Tripped):
        scheduled.sleep(10.0)
    assert [value for _, _, value in watch.readings] == [11.0, 5.0, 11.0, 11.0]


def test_silence_trips_when_the_last_reading_is_too_old():
    """A monitor that falls silent is a reading that grows old, and its fault is told."""

    def silent():
        raise NoReply("psu1", "nothing came")

    clock, scheduled, watch = watched(limit(max_age=3.0), value=silent)
    with pytest.raises(Tripped, match=r"no good voltage for .* s, 3 s allowed \(psu1: nothing came\)"):
        scheduled.sleep(20.0)
    assert 3.0 < clock.now() < 5.0
    assert all(value != value for _, _, value in watch.readings)  # noqa: PLR0124 - NaN is not itself


def test_nothing_is_read_before_and_after_the_watch():
    """Monitors run from arming to the safe state, in between and not else."""
    clock, watch = VirtualClock(), Watch()
    bench = SimpleNamespace(clock=clock, live=None, playback=None, speed=1.0, transcript=Transcript(None), ports=[])
    scheduled = Scheduler(
        bench,
        [monitor(clock, limit())],
        StopFlags(),
        watch,
        timeline_of(bench, NoMachine(), SimpleNamespace(course=0)),
    )
    scheduled.sleep(5.0)
    assert watch.readings == []
    scheduled.watch_from_now()
    scheduled.sleep(1.5)
    scheduled.rest()
    scheduled.sleep(5.0)
    assert [round(t) for _, t, _ in watch.readings] == [5, 6]


def test_a_case_past_its_deadline_ends():
    """The deadline is looked at wherever time passes."""
    _, scheduled, _ = watched()
    scheduled.deadline_ns = 2_000_000_000
    scheduled.sleep(2.0)
    with pytest.raises(CaseTimeout):
        scheduled.sleep(0.5)
    with pytest.raises(CaseTimeout):
        scheduled.point()


@pytest.fixture
def seconds(monkeypatch):
    """Return the seconds of the wall, as the only entry of a list."""
    now = [100.0]
    monkeypatch.setattr("hil.clock.wall.monotonic", lambda: now[0])
    return now


ATTEMPTS = {
    "a point": lambda scheduled: scheduled.point(),
    "a wait of nothing": lambda scheduled: scheduled.sleep(0.0),
    "its own code": lambda scheduled: scheduled.look(),
}


@pytest.mark.parametrize("attempt", ATTEMPTS)
def test_a_case_that_lets_no_bench_time_pass_is_ended_by_the_wall(seconds, attempt):
    """Bench time stands still, so seconds of the wall count, and the bench is safe before the case learns of it."""
    _, scheduled, watch = watched()
    scheduled.begin_case(SimpleNamespace(), 60_000_000_000)
    for _ in range(60):
        seconds[0] += 1.0
        ATTEMPTS[attempt](scheduled)
    seconds[0] += 1.0
    with pytest.raises(CaseTimeout, match="ran for 61 s without letting any bench time pass"):
        ATTEMPTS[attempt](scheduled)
    assert watch.told == ["safe"]
    with pytest.raises(CaseTimeout):
        scheduled.point()
    scheduled.end_case()
    scheduled.begin_case(SimpleNamespace(), 1_000_000_000)
    seconds[0] += 4.5  # a slow machine
    scheduled.point()


def test_bench_time_that_passes_is_all_that_counts(seconds):
    """However long a simulation of weeks takes."""
    _, scheduled, _ = watched()
    scheduled.begin_case(SimpleNamespace(), 60_000_000_000)
    for _ in range(50):
        seconds[0] += 59.0
        scheduled.sleep(1.0)


def test_a_person_may_take_any_time(seconds):
    """Bench time stands still while a question waits, and that is nobody's fault."""
    _, scheduled, _ = watched()
    scheduled.begin_case(SimpleNamespace(), 60_000_000_000)
    for _ in range(100):
        seconds[0] += 50.0
        scheduled.idle()
    scheduled.deadline_ns = None  # as while the bench is held
    for _ in range(100):
        seconds[0] += 50.0
        scheduled.point()
    scheduled.deadline_ns = 60_000_000_000
    scheduled.point()


def test_a_stop_is_found_in_a_wait_and_at_a_point():
    """A request ends the wait before more time passes."""
    flags = StopFlags()
    clock, scheduled, _ = watched(flags=flags)
    flags.request("SIGTERM")
    for attempt in (scheduled.point, scheduled.idle, lambda: scheduled.sleep(1.0)):
        with pytest.raises(Stopped, match="SIGTERM"):
            attempt()
    assert clock.now() == 0.0


@pytest.mark.parametrize("seconds", [-1.0, float("nan")])
def test_time_does_not_run_backwards(seconds):
    """A wait of no duration is refused."""
    _, scheduled, _ = watched()
    with pytest.raises(ValueError, match="cannot last"):
        scheduled.sleep(seconds)


def test_a_monitor_that_comes_late_is_told():
    """A period after it was overdue is an event; sooner it is the ordinary search for room."""
    clock, scheduled, watch = watched(limit(max_age=20.0))
    scheduled.sleep(0.5)
    clock.sleep(2.4)
    scheduled.point()
    assert watch.lates == []
    clock.sleep(3.5)
    scheduled.point()
    assert [(name, round(late, 1)) for name, late in watch.lates] == [("v", 3.4)]
    assert watch.trips == []


def test_a_quantity_that_nobody_watched_for_too_long_trips():
    """The next reading is good, but nobody knows what was before it."""
    clock, scheduled, watch = watched(limit(max_age=3.0))
    scheduled.sleep(0.5)
    clock.sleep(4.0)
    with pytest.raises(Tripped, match=r"no good voltage for 4.\d* s, 3 s allowed"):
        scheduled.point()
    assert [name for name, _ in watch.lates] == ["v"]
    assert len(watch.trips) == 1


def test_monitors_run_while_a_person_is_awaited():
    """Where time goes on meanwhile, the envelope is watched as in any other wait, and trips."""
    values, wall_ns = iter([5.0, 5.0, 11.0]), [0]
    clock, watch = LiveClock("2026-01-01T00:00:00Z", real_ns=lambda: wall_ns[0]), Watch()
    bench = SimpleNamespace(clock=clock, live=clock, playback=None, speed=1.0, transcript=Transcript(None), ports=[])
    timeline = timeline_of(bench, NoMachine(), SimpleNamespace(course=0))
    watched_one = monitor(clock, limit(max_age=20.0), value=lambda: next(values), takes=0.0)
    scheduled = Scheduler(bench, [watched_one], StopFlags(), watch, timeline)
    scheduled.watch_from_now()
    clock.begin()
    for _ in range(3):
        scheduled.idle()
    assert watch.readings == []
    with pytest.raises(Tripped, match="above"):
        for _ in range(9):
            wall_ns[0] += 500_000_000
            scheduled.idle()
    assert [t for _, t, _ in watch.readings] == [1.0, 2.0, 3.0]


def test_the_silence_of_a_monitors_device_is_told_to_the_case():
    """Its fault is the bench's, whether or not it trips; without a case nobody is told."""

    def silent():
        raise NoReply("psu1", "nothing came")

    told = []
    clock, scheduled, _ = watched(limit(max_age=30.0), value=silent)
    scheduled.sleep(1.2)
    instrument = SimpleNamespace(name="psu1")
    scheduled._bench.spec = SimpleNamespace(
        instrument=lambda name: {"psu1": instrument}[name], wire=lambda _: SimpleNamespace(instrument="psu1")
    )
    scheduled.monitoring.case = SimpleNamespace(fault=lambda device, fault: told.append((device.name, str(fault))))
    scheduled.sleep(2.0)
    assert told == [("psu1", "psu1: nothing came")] * 2
    assert clock.now() == pytest.approx(3.2)


@pytest.mark.parametrize("asked_again", [False, True])
def test_a_slow_line_is_no_silence(asked_again):
    """A reading of many slow exchanges is the bench's fault only where one of them had to be asked again."""
    port, told = SimpleNamespace(silences=0), []

    def slow():
        clock.sleep(0.9)
        port.silences += asked_again
        return 1.0

    clock, scheduled, _ = watched(limit(max_age=30.0), value=slow)
    spec = SimpleNamespace(instrument=lambda name: SimpleNamespace(name=name))
    spec.wire = lambda _: SimpleNamespace(instrument="psu1")
    scheduled._bench.spec, scheduled._bench.ports = spec, [port]
    scheduled.monitoring.case = SimpleNamespace(fault=lambda device, fault: told.append((device.name, str(fault))))
    scheduled.sleep(1.0)
    assert bool(told) is asked_again
    assert all("asked for more than once" in said for _, said in told)


class Record:
    """A playback that holds turns of monitors."""

    def __init__(self, *turns_ns: int) -> None:
        self.turns = list(turns_ns)
        self.taken: list[int] = []

    rows_wait, in_parts, shared, all_share = True, False, True, True

    def hand_over_if_due(self) -> None:
        """Go on answering."""

    def look_up_ns(self, when_ns: int) -> int:
        """Return the end of the wait."""
        return when_ns

    def next_if(self, name: str) -> None:
        """Return that no such operation comes."""

    def comes(self, name: str, latest_ns: int, place: object) -> bool:
        """Return that no hold comes."""
        return False

    def take_monitor(self, latest_ns: int, name: str, _place: object) -> str:
        """Take the turn that comes next, and return its limit."""
        if name != "monitor" or not self.turns or self.turns[0] > latest_ns:
            return ""
        self.taken.append(self.turns.pop(0))
        return "v"


def test_replayed_monitors_follow_the_record():
    """In a replay a monitor runs in the wait in which the record has it, whatever is due."""
    clock, watch, record = VirtualClock(), Watch(), Record(0, 300_000_000, 2_500_000_000)
    bench = SimpleNamespace(clock=clock, live=None, playback=record, speed=1.0, transcript=Transcript(None), ports=[])
    timeline = timeline_of(bench, NoMachine(), SimpleNamespace(course=0))
    scheduled = Scheduler(bench, [monitor(clock, limit(), takes=0.0)], StopFlags(), watch, timeline)
    scheduled.watch_from_now()
    scheduled.sleep(2.0)
    assert record.taken == [0, 300_000_000]
    scheduled.sleep(2.0)
    assert record.taken == [0, 300_000_000, 2_500_000_000]
    assert len(watch.readings) == 3


def refused(scheduled, times):
    """Ask a scheduler for a second, and let nothing through."""
    for _ in range(times):
        with contextlib.suppress(BaseException):
            scheduled.sleep(1.0)


def test_a_timeout_makes_safe_before_the_case_learns_of_it():
    """At once, and only once; no time passes any more, and a case that goes on is given up."""
    clock, scheduled, watch = watched()
    scheduled.deadline_ns = 1
    assert watch.told == []
    refused(scheduled, 100)
    assert (watch.told, clock.now()) == (["safe"], 1.0)
    refused(scheduled, 1)
    assert watch.told == ["safe", "give up"]


def test_a_stop_leaves_a_case_the_time_of_its_teardown():
    """The bench is made safe under a case that swallows a stop; it is not pulled away at the first word."""
    flags = StopFlags()
    _, scheduled, watch = watched(flags=flags)
    flags.request("SIGINT")
    refused(scheduled, 9)
    assert watch.told == []
    refused(scheduled, 1)
    assert watch.told == ["safe"]


def test_an_urgent_stop_makes_safe_at_once():
    """Who asks twice does not wait for a case."""
    flags = StopFlags()
    _, scheduled, watch = watched(flags=flags)
    flags.request("SIGINT")
    flags.request("SIGINT")
    refused(scheduled, 1)
    assert watch.told == ["safe"]


def test_a_reading_before_a_recording_may_leave_no_room_for_another_one():
    """The first limit could wait for a pause until the second one's reading has taken its time; then it goes before."""
    clock, watch = VirtualClock(), Watch()
    slow = monitor(clock, limit("slow", period=5.0, max_age=12.5), takes=0.3)
    quick = monitor(clock, limit("quick", period=0.5, max_age=2.0), takes=0.07)
    scheduled = scheduler(clock, slow, quick, watch=watch)
    scheduled.sleep(2.0)
    scheduled.sleep(0.9)
    watch.readings.clear()
    scheduled.share(Pace("rest", 100_000_000, 60_000_000, 50, None))
    assert [name for name, _, _ in watch.readings] == ["quick", "slow"]
