"""`record.during`: rows come beside what a case does, in order of time, and are judged as they come."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
from case_parts import limit, monitor, scheduler
from cell_stream import Stream, adopt, beside, facade_of

from hil.model.errors import Misused, NoReply, NotInTime, Tripped

MS = 1_000_000


def test_rows_come_while_the_case_does_something_else(tmp_path):
    """Every row of the device is there once the block is left, with bench times; the waits are as long as ever."""
    case, role, facade = beside(tmp_path)
    case.clock.sleep(3.0)
    with case.run.record.during("test", facade, rate=0.2) as test:
        case.scheduler.sleep(12.0)
        assert case.clock.now() == 15.0
        case.scheduler.sleep(20.0)
        assert case.clock.now() == 35.0
    assert role.calls == [("begin", 0.2), ("end",)]
    assert test.recording.time.tolist() == [8.0, 13.0, 18.0, 23.0, 28.0, 33.0]
    assert test.recording.stream.frames == 6
    assert case.written.of("recording-end")[-1]["complete"]


def test_beginning_waits_and_end_are_effects(tmp_path):
    """What a replay has to agree with: when rows begin, what was waited for and when it came, and how they end."""
    case, role, facade = beside(tmp_path)
    with case.run.record.during("test", facade, rate=0.2) as test:
        role.values = [3.0, 3.5, 4.2]
        assert test.until("voltage", above=4.0, within=60) == 15.0
        assert test.latest("voltage").value == 4.2
    found = [(each["name"], each["effect"], each["arguments"]) for each in case.written.of("effect")]
    assert found == [
        ("record.test.begin", "records", {"rate": 0.2, "channels": ["voltage"]}),
        ("record.test.until", "waits", {"channel": "voltage", "above": 4.0, "within": 60}),
        ("record.test.latest", "reads", {"channel": "voltage"}),
        ("record.test.end", "records", {"complete": True}),
    ]
    results = [each["result"] for each in case.written.of("effect")]
    assert results[1] == 15.0
    assert results[3]["sha256"] == case.written.of("recording-end")[-1]["sha256"]


@pytest.mark.parametrize("count", [1, 3, 40])
def test_until_looks_at_every_row_of_every_block(tmp_path, count):
    """A number that was there for one row only is found, in any block, and so is the next one after it."""
    case, role, facade = beside(tmp_path, period=5.0 / count)
    role.values = [0.0] * 50 + [1.0] + [0.0] * 2 + [-1.0, 1.0] + [0.0] * 300
    with case.run.record.during("test", facade, rate=0.2 * count) as test:
        first, second, third = (test.until("voltage", equals=wanted, within=300) for wanted in (1.0, -1.0, 1.0))
    period = 5.0 / count
    assert (first, second, third) == pytest.approx((51 * period, 54 * period, 55 * period))


def test_a_condition_that_holds_already_costs_no_time(tmp_path):
    """The newest row counts, too."""
    case, role, facade = beside(tmp_path)
    role.values = [7.0]
    with case.run.record.during("test", facade, rate=0.2) as test:
        case.scheduler.sleep(11.0)
        assert test.until("voltage", above=6.0, within=1.0) == 10.0
        assert case.clock.now() == 11.0


def test_what_does_not_come_in_time_is_told_with_the_newest_number(tmp_path):
    """The wait ends when it is over, and the case learns how near it was."""
    case, role, facade = beside(tmp_path)
    role.values = [3.25]
    with (
        pytest.raises(NotInTime, match=r"'test': no voltage above 4 within 12 s, the newest is 3.25; wait longer"),
        case.run.record.during("test", facade, rate=0.2) as test,
    ):
        test.until("voltage", above=4.0, within=12.0)
    assert case.clock.now() == 12.0
    assert not case.written.of("recording-end")[-1]["complete"]


def test_the_end_of_the_devices_own_test_is_awaited(tmp_path):
    """A device says when its test is over; one that does not is waited for no longer than was said."""
    case, role, facade = beside(tmp_path)
    role.over_at = 21.0
    with case.run.record.during("test", facade, rate=0.2) as test:
        assert test.until_over(within=100) == 25.0
        role.over_at = np.inf
        with pytest.raises(NotInTime, match=r"not over within 10 s, the newest row is: voltage 3"):
            test.until_over(within=10)


def test_what_cannot_be_awaited_is_refused(tmp_path):
    """Two conditions, none, an unknown channel, a wait of no length, and looking before, after, or twice."""
    case, _, facade = beside(tmp_path)
    test = case.run.record.during("test", facade, rate=0.2)
    with pytest.raises(Misused, match="is not running"):
        test.latest("voltage")
    with test:
        with pytest.raises(NotInTime, match="no row has come yet"):
            test.latest("voltage")
        for conditions in ({}, {"above": 1.0, "below": 2.0}, {"equals": float("nan")}):
            with pytest.raises(Misused, match="one of equals, above and below"):
                test.until("voltage", within=1.0, **conditions)
        with pytest.raises(Misused, match="no channel 'volts', did you mean 'voltage'"):
            test.until("volts", above=1.0, within=1.0)
        with pytest.raises(ValueError, match="cannot wait"):
            test.until("voltage", above=1.0, within=0.0)
        with pytest.raises(Misused, match="not finished"):
            _ = test.recording
        with pytest.raises(
            Misused, match=r"no values of its own; after the `with` block take its .recording\['voltage'\]"
        ):
            _ = test["voltage"]
        with (
            case.run.record.during("field", case.field, rate=1.0) as field,
            pytest.raises(Misused, match="does not say when"),
        ):
            field.until_over(within=1.0)
        with pytest.raises(Misused, match="is already being recorded"):
            case.run.record.during("other", facade, rate=0.2)
    with pytest.raises(Misused, match="was already started"), test:
        pass


def test_an_exception_ends_the_stream_and_keeps_what_came(tmp_path):
    """What came before is on the disk and marked incomplete; the exception is the case's own."""
    case, role, facade = beside(tmp_path)
    with pytest.raises(KeyError, match="mine"), case.run.record.during("test", facade, rate=0.2):
        case.scheduler.sleep(11.0)
        raise KeyError("mine")
    end = case.written.of("recording-end")[-1]
    assert (end["rows"], end["complete"]) == (2, False)
    assert role.calls[-1] == ("end",)
    assert case.run.record.taken == ()


def test_silence_is_found_where_the_case_waits_and_counts_for_the_device(tmp_path):
    """The case learns of it at once; where it lets that through, the recording is incomplete all the same."""
    case, role, facade = beside(tmp_path, dead_after=12.0)
    with case.run.record.during("test", facade, rate=0.2) as test:
        with pytest.raises(NoReply):
            case.scheduler.sleep(60.0)
        assert case.clock.now() == 15.0
        case.scheduler.sleep(5.0)
    assert not case.written.of("recording-end")[-1]["complete"]
    assert role.calls[-1] == ("end",)
    assert case.written.of("fault")[-1]["device"] == "cyc1"
    with pytest.raises(Misused, match="not finished"):
        _ = test.recording


def test_what_a_case_leaves_open_is_ended(tmp_path):
    """A block that is never left ends with its case, as incomplete."""
    case, role, facade = beside(tmp_path)
    case.run.record.during("test", facade, rate=0.2).__enter__()
    case.scheduler.sleep(6.0)
    case.run.close()
    assert not case.written.of("recording-end")[-1]["complete"]
    assert role.calls[-1] == ("end",)
    case.scheduler.sleep(60.0)
    assert len(role.drained_at) == 1


def test_several_are_recorded_at_a_time_and_others_inside(tmp_path):
    """Streams and sampled roles take turns in order of time, and `record` goes on among them."""
    case, _, facade = beside(tmp_path)
    other = facade_of(case, Stream(case.clock), "cyc2", "spare")
    with (
        case.run.record.during("first", facade, rate=0.2) as first,
        case.run.record.during("second", other, rate=0.2) as second,
    ):
        case.scheduler.sleep(2.0)
        with case.run.record.during("field", case.field, rate=2.0) as field:
            inner = case.run.record("inner", case.field, duration=5.0, rate=1.0)
            case.scheduler.sleep(5.0)
    assert first.recording.time.tolist() == second.recording.time.tolist() == [5.0, 10.0]
    assert len(inner) == 5
    assert field.recording.time[0] == pytest.approx(2.001)
    assert np.diff(field.recording.time) == pytest.approx(np.full(len(field.recording) - 1, 0.5), abs=0.002)
    assert first.recording.time.tolist() == sorted(first.recording.time.tolist())


def test_a_sampled_turn_that_was_missed_is_a_gap(tmp_path):
    """Time that passes within an operation of a role is not made up for with samples of later."""
    case, _, _ = beside(tmp_path)
    with case.run.record.during("field", case.field, rate=1.0) as field:
        case.scheduler.sleep(2.5)
        case.clock.sleep(3.0)
        case.scheduler.sleep(2.0)
    assert np.round(field.recording.time, 3).tolist() == [0.001, 1.001, 2.001, 5.502, 6.001, 7.001]


def watched(folder, maximum, max_age=30.0, period=5.0, **options):
    """Return a case whose stream feeds a limit of its voltage, and what was reported."""
    case, role, facade = beside(folder, **options)
    role.patience = 50.0
    spec = limit("cell-voltage", maximum=maximum, output="cycler", period=period, max_age=max_age)
    asked = []
    watching = monitor(case.clock, spec, value=lambda: asked.append(case.clock.now()) or 3.0, takes=0.004)
    adopt(case, scheduler(case.clock, watching, flags=case.flags, watch=case.watch))
    return case, role, facade, asked


def test_rows_are_judged_in_place_of_readings(tmp_path):
    """While rows come in time nobody asks; before and after the recording the quantity is read as ever."""
    case, _, facade, asked = watched(tmp_path, 4.0)
    case.scheduler.sleep(6.0)
    with case.run.record.during("test", facade, rate=0.2):
        case.scheduler.sleep(100.0)
        assert [round(t) for t in asked] == [0, 5, 10][: len(asked)]
        before = len(asked)
        case.scheduler.sleep(900.0)
        assert len(asked) == before
    case.scheduler.sleep(11.0)
    assert len(asked) > before
    assert case.watch.feeds == [("cell-voltage", "001-test_x-test")]


def test_a_row_outside_trips_and_the_trip_names_it(tmp_path):
    """The bench is made safe at the turn that fetched the row; the row is in the recording, which is incomplete."""
    case, role, facade, _ = watched(tmp_path, 4.0)
    role.values = [3.0, 3.0, 4.5, 3.0]
    with (
        pytest.raises(Tripped, match=r"cycler: voltage 4.5 V is above 4 V, at 15 s of recording 001-test_x-test"),
        case.run.record.during("test", facade, rate=0.2),
    ):
        case.scheduler.sleep(100.0)
    assert case.clock.now() == 15.0
    assert len(case.watch.trips) == 1
    end = case.written.of("recording-end")[-1]
    assert (end["rows"], end["complete"]) == (3, False)
    assert role.calls[-1] == ("end",)


def test_rows_that_stop_coming_let_the_monitor_read_again(tmp_path):
    """A device that sends nothing is asked; what it says then is judged as ever."""
    case, role, facade, asked = watched(tmp_path, 4.0)
    role.mute_from, role.mute_until = 50.0, 100.0
    with case.run.record.during("test", facade, rate=0.2):
        case.scheduler.sleep(49.0)
        before = len(asked)
        case.scheduler.sleep(51.0)
        assert len(asked) > before + 5
        after = len(asked)
        case.scheduler.sleep(200.0)
        assert len(asked) <= after + 3


def test_a_gap_between_rows_that_nobody_filled_trips(tmp_path):
    """The age of a row counts by the stream's own clock, however late it was fetched."""
    case, role, facade, _ = watched(tmp_path, 4.0)
    role.mute_from, role.mute_until = 50.0, 100.0
    with (
        pytest.raises(Tripped, match=r"no good voltage for 55 s.*at 100 s of"),
        case.run.record.during("test", facade, rate=0.2),
    ):
        case.scheduler.sleep(49.0)
        case.clock.sleep(60.0)
        case.scheduler.sleep(1.0)


@pytest.mark.parametrize("drift", [-0.2, 0.2])
def test_a_clock_that_drifts_makes_no_row_old(tmp_path, drift):
    """A device whose clock goes wrong by far more than the maximum age in sum is watched on as long as rows come."""
    case, _, facade, _ = watched(tmp_path, 4.0, period=5.0 * (1 + drift), stamp=5.0)
    with case.run.record.during("test", facade, rate=0.2):
        case.scheduler.sleep(1000.0)
    assert case.watch.trips == []


def test_rows_that_come_too_rarely_for_the_maximum_age_feed_nothing(tmp_path):
    """The monitor goes on to read."""
    case, _, facade, asked = watched(tmp_path, 4.0, max_age=12.0)
    with case.run.record.during("test", facade, rate=0.2):
        case.scheduler.sleep(100.0)
    assert case.watch.feeds == []
    assert len(asked) >= 20


@pytest.mark.parametrize(
    ("period", "max_age", "patience", "pause"),
    [(30, 90, 50, 30), (30, 90, 12, 12), (30, 60, 50, 25), (2, 90, 50, 5), (30, 90, 1, 5)],
)
def test_rows_wait_as_long_as_their_limits_allow(tmp_path, period, max_age, patience, pause):
    """They are fetched once a period, sooner where the age or the role's patience asks for it, and all are judged."""
    case, role, facade, asked = watched(tmp_path, 4.0, period=float(period), max_age=float(max_age))
    role.patience = patience
    role.values = [3.0] * 40 + [4.5, 3.0]
    with pytest.raises(Tripped, match="at 205 s of"), case.run.record.during("test", facade, rate=0.2):
        case.scheduler.sleep(1000.0)
    assert role.drained_at[0] == pause * 1000 * MS
    assert set(np.diff(role.drained_at)) == {pause * 1000 * MS}
    assert case.clock.now() == -(-205 // pause) * pause
    assert all(moment < 40 for moment in asked)


@pytest.mark.parametrize(("rows_wait", "pause"), [(True, 30), (False, 5)])
def test_rows_do_not_wait_where_they_did_not_in_the_record(tmp_path, rows_wait, pause):
    """A replay of a run of earlier fetches them when that did."""
    case, role, facade, _ = watched(tmp_path, 4.0, period=30.0, max_age=90.0)
    role.patience = 50.0
    case.scheduler.timeline.rows_wait = rows_wait
    with case.run.record.during("test", facade, rate=0.2):
        case.scheduler.sleep(100.0)
    assert role.drained_at[:3] == [pause * turn * 1000 * MS for turn in (1, 2, 3)]


def test_rows_that_feed_no_limit_wait_no_longer_than_they_have_to(tmp_path):
    """A role with patience is emptied as often as one without, where nobody says how seldom that may be."""
    case, role, facade = beside(tmp_path)
    role.patience = 50.0
    with case.run.record.during("test", facade, rate=0.2):
        case.scheduler.sleep(12.0)
        assert role.drained_at == [5000 * MS, 10_000 * MS]


def test_a_row_that_came_in_time_is_found_before_its_turn(tmp_path):
    """What waits at the end of a wait is looked at; the turns stay where they were."""
    case, role, facade, _ = watched(tmp_path, 9.0, period=30.0, max_age=90.0)
    role.values = [3.0] * 4 + [4.2] + [3.0]
    role.over_at = 105.0
    with case.run.record.during("test", facade, rate=0.2) as test:
        assert test.until("voltage", above=4.0, within=28.0) == 25.0
        assert case.clock.now() == 28.0
        with pytest.raises(NotInTime, match="within 7 s"):
            test.until("voltage", above=5.0, within=7.0)
        test.until_over(within=100.0)
    assert [moment // (1000 * MS) for moment in role.drained_at] == [28, 30, 35, 60, 90, 120, 120]


@pytest.mark.parametrize("extra", [0, 1, 3])
def test_one_more_monitor_moves_no_turn(tmp_path, extra):
    """Rows are fetched at the same bench time whatever else is watched."""
    case, role, facade = beside(tmp_path)
    monitors = [monitor(case.clock, limit(f"m{number}", period=0.7), takes=0.03) for number in range(extra)]
    adopt(case, scheduler(case.clock, *monitors, flags=case.flags, watch=case.watch))
    with case.run.record.during("test", facade, rate=0.2):
        for seconds in (0.7, 7.0, 3.3, 20.0, 0.05):
            case.scheduler.sleep(seconds)
    assert role.drained_at == [5_000 * MS, 10_000 * MS, 15_000 * MS, 20_000 * MS, 25_000 * MS, 30_000 * MS, 31_050 * MS]


def test_a_stop_is_found_at_a_turn(tmp_path):
    """A request ends the block, and the recording is kept as incomplete."""
    case, role, facade = beside(tmp_path)
    with suppress(BaseException), case.run.record.during("test", facade, rate=0.2):
        case.scheduler.sleep(7.0)
        case.flags.request("SIGTERM")
        case.scheduler.sleep(100.0)
    assert case.clock.now() == 7.0
    assert role.calls[-1] == ("end",)
    assert not case.written.of("recording-end")[-1]["complete"]


def test_what_waits_in_a_buffer_is_judged_before_anybody_is_asked(tmp_path):
    """An operation that takes longer than the maximum age is no trip where the device went on to measure."""
    case, _, facade, asked = watched(tmp_path, 4.0)
    with case.run.record.during("test", facade, rate=0.2) as test:
        case.scheduler.sleep(20.0)
        before = len(asked)
        case.clock.sleep(100.0)
        case.scheduler.point()
        case.scheduler.sleep(20.0)
    assert case.watch.trips == []
    assert len(asked) == before
    assert len(test.recording) == 28
