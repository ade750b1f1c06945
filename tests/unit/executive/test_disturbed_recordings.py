"""What disturbed a recording is named, and its rate and gaps are not held against the article."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest
from case_parts import Case, limit

from hil.evidence.events import Voided
from hil.executive.watching.sharing import Bus, Course
from hil.model.errors import Misused, Tripped
from hil.requirements.requirement import Kind, Records, Requirement


def asked(*, rate=10.0, max_gap=0.2):
    """Return a requirement for a second of the field."""
    records = Records(recording="field", channels=("x", "y"), rate_hz=rate, duration_s=1.0, max_gap_s=max_gap)
    return Requirement(id="T-1", rev=1, text="Record.", kind=Kind.RECORD, records=records)


def judged(case):
    """Return the verdict and the reason of every criterion."""
    case.run.finish()
    return {each.parameter: (str(each.verdict), each.reason) for each in case.run.check.evaluated}


def held_up(case, *numbers, seconds=0.3):
    """Let these samples take longer."""
    sample, taken = case.sensor.sample, iter(range(10**6))

    def slow():
        if not numbers or next(taken) in numbers:
            case.clock.sleep(seconds)
        return sample()

    case.sensor.sample = slow


@pytest.mark.parametrize("dut", [False, True])
def test_a_sample_that_takes_long_once_is_inconclusive(tmp_path, dut):
    """Whether the instrument or the computer was held up, nobody can tell."""
    case = Case(tmp_path, asked=(asked(),), dut=dut)
    held_up(case, 4)
    case.run.record("field", case.field, duration=1.0, rate=10.0)
    verdict, reason = judged(case)["max_gap"]
    assert verdict == "INCONCLUSIVE"
    assert reason.startswith("sample 5 took 301 ms, where 1 ms are usual")


def test_a_device_under_test_that_is_always_slow_fails(tmp_path):
    """The time that its samples usually take is its own affair."""
    case = Case(tmp_path, asked=(asked(max_gap=0.25),), dut=True)
    held_up(case, seconds=0.3)
    case.run.record("field", case.field, duration=1.0, rate=10.0)
    found = judged(case)
    assert found["rate"] == ("FAIL", "3.32226 Hz is below the minimum of 9.99 Hz")
    assert found["max_gap"][0] == "FAIL"


def test_an_instrument_that_is_always_slow_is_inconclusive(tmp_path):
    """It is none of the article's; the next recording is refused, since by now it is known."""
    case = Case(tmp_path, asked=(asked(),))
    held_up(case, seconds=0.3)
    case.run.record("field", case.field, duration=1.0, rate=10.0)
    assert judged(case)["rate"] == ("INCONCLUSIVE", "a sample took 301 ms, and one was due every 100 ms")
    with pytest.raises(Misused, match="a sample takes 301 ms, and one is due every 100 ms: lower the rate"):
        case.run.record("field", case.field, duration=1.0, rate=10.0)


def test_a_reading_too_long_for_the_gap_is_refused_before_the_first_sample(tmp_path):
    """Nothing is known of the samples yet, and the reading alone makes too long a gap."""
    case = Case(tmp_path, asked=(asked(max_gap=0.2),), watched=[(limit("slow", period=0.5, max_age=1.0), 0.18)])
    case.scheduler.sleep(2.0)
    told = (
        r"slow has to be read at least every 0.5 s .* its reading takes 225 ms .* makes a gap of 225 ms, where 200 ms"
    )
    with pytest.raises(Misused, match=told):
        case.run.record("field", case.field, duration=1.0, rate=10.0)
    assert case.written.of("recording") == []


def test_single_readings_and_samples_that_took_long_refuse_nothing(tmp_path):
    """A computer that stalls says nothing about the reading, nor about the sample, that it stalled in."""
    case = Case(tmp_path / "sample", asked=(asked(),))
    held_up(case, 0, 1)
    case.run.record("before", case.field, duration=0.2, rate=10.0)
    case.run.record("field", case.field, duration=1.0, rate=10.0)
    assert {verdict for verdict, _ in judged(case).values()} == {"RECORDED"}
    case = Case(tmp_path / "reading", asked=(asked(),), watched=[(limit("slow", period=0.5, max_age=1.0), 0.18)])
    case.scheduler.sleep(0.4)
    case.run.record("field", case.field, duration=1.0, rate=10.0)


@pytest.mark.parametrize(("dut", "verdict"), [(True, "FAIL"), (False, "INCONCLUSIVE")])
def test_a_device_that_is_too_slow_for_every_turn_beside_a_case(tmp_path, dut, verdict):
    """It misses every second turn, which makes gaps of two periods, although a sample takes little more than one."""
    case = Case(tmp_path, asked=(asked(max_gap=0.15),), dut=dut)
    held_up(case, seconds=0.12)
    with case.run.record.during("field", case.field, rate=10.0):
        case.scheduler.sleep(1.5)
    assert judged(case)["max_gap"][0] == verdict


def test_a_record_of_before_is_judged_as_it_was(tmp_path):
    """Its bytes lead to the verdict that it holds."""
    case = Case(tmp_path, asked=(asked(),))
    case.scheduler.timeline.shared = False
    held_up(case, 4)
    case.run.record("field", case.field, duration=1.0, rate=10.0)
    assert judged(case)["max_gap"][0] == "FAIL"


def test_a_plan_that_samples_too_slowly_fails(tmp_path):
    """Nothing disturbed it: the recording is what was asked for, and that is too little."""
    case = Case(tmp_path, asked=(asked(rate=20.0),))
    case.run.record("field", case.field, duration=1.0, rate=10.0)
    assert judged(case)["rate"][0] == "FAIL"


def test_a_recording_beside_a_case_that_lets_no_turn_be_taken_names_it(tmp_path):
    """A sample that was missed is a gap, and the case made it."""
    case = Case(tmp_path, asked=(asked(),))
    with case.run.record.during("field", case.field, rate=10.0):
        case.scheduler.sleep(0.5)
        case.clock.sleep(0.45)
        case.scheduler.sleep(0.5)
    verdict, reason = judged(case)["max_gap"]
    assert verdict == "INCONCLUSIVE"
    assert reason.startswith("the case, which let no turn be taken, delayed sample 7 by ")


def test_a_reading_that_delayed_a_sample_is_named():
    """The maximum age of a limit goes before the recording, which says so."""
    bus = Bus()
    course = Course(bus, "field", 100, "the computer")
    course.sampled(0, 0, 0, 10)
    bus.note("the reading of slow", 20, 2_000_000)
    course.sampled(1, 100, 2_000_000, 2_000_010)
    assert course.cause == "the reading of slow delayed sample 2 by 2 ms"
    assert course.undisturbed_ns(own=True) == 100


def test_what_used_the_bus_longest_is_named():
    """Of several things between two instants, the one that took the most time."""
    bus = Bus()
    bus.note("the reading of a", 0, 100)
    bus.note("the heartbeat of b", 100, 400)
    bus.note("the reading of a", 400, 450)
    assert bus.between(0, 450) == "the heartbeat of b"
    assert bus.between(0, 150) == "the reading of a"
    assert bus.between(500, 600) == ""


def test_a_recording_is_not_interrupted_by_a_reading_that_can_be_before_it(tmp_path):
    """A reading of 60 ms does not fit between samples every 25 ms, so it is taken before the first one."""
    case = Case(
        tmp_path, asked=(asked(rate=40.0, max_gap=0.1),), watched=[(limit("slow", period=5.0, max_age=20.0), 0.06)]
    )
    case.scheduler.sleep(9.7)
    case.clock.sleep(0.1)
    taken = case.run.record("field", case.field, duration=1.0, rate=40.0)
    assert max(taken.time[1:] - taken.time[:-1]) == pytest.approx(0.025)
    assert {verdict for verdict, _ in judged(case).values()} == {"RECORDED"}


def beside(case, *, rate, lasts):
    """Record beside a case that waits; return the recording."""
    with case.run.record.during("field", case.field, rate=rate) as running:
        case.scheduler.sleep(lasts)
    return running.recording


def test_no_turn_beside_a_case_is_missed_for_a_reading_that_can_wait(tmp_path):
    """A reading takes more than a period: a turn that is missed for it never comes again, so that the rate falls."""
    watched = [(limit("slow", period=0.5, max_age=60.0), 0.25)]
    case = Case(tmp_path, asked=(asked(max_gap=1.0),), watched=watched)
    case.scheduler.sleep(2.0)
    taken = beside(case, rate=10.0, lasts=5.0)
    assert len(taken) == 51
    assert {verdict for verdict, _ in judged(case).values()} == {"RECORDED"}


def test_a_recording_beside_a_case_is_refused_before_its_first_sample(tmp_path):
    """The reading alone makes too long a gap, as it does for any other recording."""
    case = Case(tmp_path, asked=(asked(max_gap=0.2),), watched=[(limit("slow", period=0.5, max_age=1.0), 0.18)])
    case.scheduler.sleep(2.0)
    with (
        pytest.raises(Misused, match="record 'field': slow has to be read .* where 200 ms are allowed"),
        case.run.record.during("field", case.field, rate=10.0),
    ):
        pass
    assert case.written.of("recording") == []


def test_a_record_of_before_has_no_refusals_beside_a_case(tmp_path):
    """Its bytes lead to what it holds."""
    case = Case(tmp_path, asked=(asked(max_gap=0.2),), watched=[(limit("slow", period=0.5, max_age=1.0), 0.18)])
    case.scheduler.sleep(2.0)
    case.scheduler.timeline.all_share = False
    assert len(beside(case, rate=10.0, lasts=1.0)) > 1


def test_a_refusal_says_which_rate_would_hold(tmp_path):
    """Recorded so, it is not refused."""
    case = Case(
        tmp_path, asked=(asked(rate=8.0, max_gap=0.25),), watched=[(limit("slow", period=0.5, max_age=1.0), 0.1)]
    )
    case.scheduler.sleep(2.0)
    with pytest.raises(Misused) as refused:
        case.run.record("field", case.field, duration=2.0, rate=20.0)
    rate = float(str(refused.value).split("; ")[-1].removesuffix(" Hz would hold"))
    assert 4.0 <= rate < 20.0
    case.run.record("field", case.field, duration=2.0, rate=rate)
    with pytest.raises(Misused):
        case.run.record("field", case.field, duration=2.0, rate=1.1 * rate)


def of_the_sensor(name="mag-x", **bounds):
    """Return a limit on what the sensor samples."""
    return replace(limit(name, output="magnetometer", **bounds), quantity="x", unit="uT")


def test_rows_of_a_sampled_role_stand_for_readings_of_its_limits(tmp_path):
    """The limit is not read while rows come, is judged by each of them, and is read again after them."""
    case = Case(tmp_path, watched=[(of_the_sensor(maximum=1000.0), 0.06)])
    case.scheduler.sleep(2.0)
    before = len(case.watch.readings)
    taken = case.run.record("field", case.field, duration=10.0, rate=20.0)
    assert len(case.watch.readings) == before
    assert max(taken.time[1:] - taken.time[:-1]) == pytest.approx(0.05)
    assert [name for name, _ in case.watch.feeds] == ["mag-x"]
    case.scheduler.sleep(2.0)
    assert len(case.watch.readings) > before
    before = len(case.watch.readings)
    beside(case, rate=20.0, lasts=5.0)
    assert len(case.watch.readings) == before


@pytest.mark.parametrize("aside", [False, True])
def test_a_row_of_a_sampled_role_that_is_outside_trips(tmp_path, aside):
    """Within the rows that its debounce allows."""
    case = Case(tmp_path, watched=[(of_the_sensor(maximum=30.0, debounce=2), 0.001)])
    with pytest.raises(Tripped, match="x 32 uT is above 30 uT, at .* s of recording"):
        if aside:
            beside(case, rate=20.0, lasts=10.0)
        else:
            case.run.record("field", case.field, duration=10.0, rate=20.0)
    assert not case.scheduler.feeds.feeds(case.scheduler.monitoring.all[0])


def test_rows_that_come_too_seldom_stand_for_no_reading(tmp_path):
    """A reading outside would be confirmed later than by a reading."""
    case = Case(tmp_path, watched=[(of_the_sensor(maximum=1000.0, period=1.0), 0.001)])
    case.scheduler.sleep(0.5)
    before = len(case.watch.readings)
    case.run.record("field", case.field, duration=3.0, rate=5.0)
    assert len(case.watch.readings) >= before + 2
    assert case.watch.feeds == []


def stopped_in(case, rows, *, away_s, disturbed_at=None):
    """Let the store open recordings that hold rows from before the run was stopped, and arm the bench meanwhile."""
    begin = case.store.begin

    def entered(facts):
        opened = begin(facts)
        at_s = case.clock.now()
        for number in range(rows):
            at_s += 0.4 if number == disturbed_at else 1 / facts.rate
            opened.append((at_s, float(number), -40.0))
        case.store.note_void(entry_with(facts.recording, rows))
        case.clock.sleep(away_s)
        case.scheduler.watch_from_now()
        return opened

    case.store.begin = entered


def entry_with(recording, rows):
    """Return the entry of a run that kept so many rows."""
    return SimpleNamespace(rows=(Voided(recording=recording, first=rows, end=rows),))


def test_readings_are_before_the_first_sample_after_a_run_was_stopped(tmp_path):
    """The bench was armed in the middle of the recording, so that every limit is due: none of them between samples."""
    watched = [(limit("slow", period=5.0, max_age=20.0), 0.06)]
    case = Case(tmp_path, asked=(asked(rate=40.0, max_gap=0.1),), watched=watched)
    case.scheduler.sleep(9.7)
    stopped_in(case, 20, away_s=30.0)
    taken = case.run.record("field", case.field, duration=1.0, rate=40.0, continues=True)
    assert len(taken) == 40
    assert max(taken.time[21:] - taken.time[20:-1]) == pytest.approx(0.025)
    found = judged(case)
    assert found.pop("stopped")[0] == "INCONCLUSIVE"
    assert {verdict for verdict, _ in found.values()} == {"RECORDED"}


def test_what_disturbed_a_recording_before_its_run_was_stopped_is_told_as_unknown(tmp_path):
    """Nobody knows it any more, and what disturbed the samples after that is not to blame."""
    case = Case(tmp_path, asked=(asked(),))
    stopped_in(case, 5, away_s=3.0, disturbed_at=2)
    case.run.record("field", case.field, duration=1.0, rate=10.0, continues=True)
    verdict, reason = judged(case)["max_gap"]
    assert verdict == "INCONCLUSIVE"
    assert reason == (
        "the run was stopped after sample 5 and resumed; what delayed sample 3 by 300 ms before that is not known"
    )
