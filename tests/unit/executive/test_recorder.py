"""`record`: samples at their instants, kept whole or kept as incomplete, and what a requirement asks of them."""

from __future__ import annotations

import math
from itertools import chain, repeat
from types import SimpleNamespace

import numpy as np
import pytest
from case_parts import Case

from hil.evidence import events
from hil.evidence.recordings.hdf5 import Recorded
from hil.executive.cases.facade import RoleSet
from hil.executive.cases.recording import data_checks
from hil.executive.ending.stop import Stopped
from hil.model.errors import Misused, NoReply
from hil.model.figure import Figure
from hil.requirements.decision import judge
from hil.requirements.requirement import Kind, Records, Requirement


def test_sample_k_is_taken_at_k_over_rate(tmp_path):
    """However long a sample takes, the next one is not shifted by it."""
    case = Case(tmp_path)
    case.clock.sleep(0.25)
    taken = case.run.record("field", case.field, duration=1.0, rate=8.0)
    expected = 0.25 + np.arange(8) / 8 + 0.001
    assert taken.time == pytest.approx(expected, abs=1e-9)
    assert list(taken["x"]) == list(range(8))
    assert (len(taken), taken.rate, taken.unit("x")) == (8, 8.0, "uT")


def test_a_channel_keeps_the_unit_that_it_was_recorded_in(tmp_path):
    """A figure of its samples, of a part, and of its uncertainty refuses another unit until they are converted."""
    case = Case(tmp_path)
    taken = case.run.record("field", case.field, duration=1.0, rate=10.0)
    for value in (taken["x"].mean(), taken["x"][2:].max() - 1.0, taken.part(0, 5)["x"][0], taken.uncertainty("x")):
        assert Figure(value=value, unit="µT").value == value
        assert Figure(value=value * 1e-3, unit="mT").unit == "mT"
        with pytest.raises(Misused, match=r"^the values are in uT as recorded, not in mT; state uT; to convert them"):
            Figure(value=value, unit="mT")


def test_a_recording_tells_its_beginning_its_end_and_its_hash(tmp_path):
    """The journal holds what was asked for, and the hash that the effect's result repeats."""
    case = Case(tmp_path)
    case.run.record("field", case.field, duration=1.0, rate=10.0)
    (begun,), (ended,), (effect,) = (case.written.of(kind) for kind in ("recording", "recording-end", "effect"))
    assert (begun["recording"], begun["name"], begun["rate"], begun["duration"]) == (
        "001-test_x-field", "field", 10.0, 1.0,
    )  # fmt: skip
    assert (ended["rows"], ended["complete"], ended["sha256"]) == (10, True, effect["result"])
    assert (effect["name"], effect["effect"]) == ("record.field", "records")
    assert ended["gaps"] == pytest.approx(0.1)


def test_several_roles_have_their_names_before_their_channels(tmp_path):
    """Channels of several roles are told apart; two roles of one name are refused."""
    case = Case(tmp_path)
    with pytest.raises(ValueError, match="one role is given twice"):
        case.run.record("both", case.field, case.field, duration=1.0, rate=10.0)
    assert case.written.events == []


def test_the_certificate_counts_at_the_largest_reading(tmp_path):
    """The least certain sample speaks for its channel."""
    case = Case(tmp_path)
    taken = case.run.record("field", case.field, duration=5.0, rate=10.0)
    assert taken.uncertainty("x") == pytest.approx((0.2 + 0.01 * 49) / 2)
    assert taken.uncertainty("y") == pytest.approx((0.2 + 0.01 * 40) / 2)


@pytest.mark.parametrize(("duration", "rate"), [(0.0, 1.0), (1.0, 0.0), (-1.0, 1.0), (math.inf, 1.0), (math.nan, 1.0)])
def test_a_recording_of_nothing_is_refused(tmp_path, duration, rate):
    """Duration and rate are above zero, and something is recorded."""
    case = Case(tmp_path)
    with pytest.raises(ValueError, match="needs a role, and a duration and rate above zero"):
        case.run.record("field", case.field, duration=duration, rate=rate)
    with pytest.raises(ValueError, match="needs a role"):
        case.run.record("field", duration=1.0, rate=1.0)


def test_silence_keeps_what_was_recorded_as_incomplete(tmp_path):
    """The rows before the silence are on the disk, and the recording says that it did not end."""
    case = Case(tmp_path)
    case.sensor.fault, case.sensor.silent_from = NoReply("mag1", "nothing came"), 4
    with pytest.raises(NoReply):
        case.run.record("field", case.field, duration=1.0, rate=10.0)
    (ended,) = case.written.of("recording-end")
    assert (ended["rows"], ended["complete"]) == (4, False)
    assert len(case.written.of("fault")) == 1


def test_a_stop_ends_a_recording_between_two_samples(tmp_path):
    """The present sample is finished first."""
    case = Case(tmp_path)
    sample = case.sensor.sample

    def stopping():
        row = sample()
        if row[0] == 2.0:
            case.flags.request("SIGINT")
        return row

    case.sensor.sample = stopping
    with pytest.raises(Stopped):
        case.run.record("field", case.field, duration=1.0, rate=10.0)
    assert [(end["rows"], end["complete"]) for end in case.written.of("recording-end")] == [(3, False)]


def test_recordings_of_one_name_are_kept_apart(tmp_path):
    """Each has an id of its own in the run."""
    case = Case(tmp_path)
    for _ in range(2):
        case.run.record("field", case.field, duration=0.5, rate=10.0)
    assert [each["recording"] for each in case.written.of("recording")] == ["001-test_x-field", "002-test_x-field"]


def recorded(times, *, channels=("x", "y"), rate=10.0, complete=True, name="field", samples=None):
    """Return a recording as `data_checks` takes it."""
    array = np.asarray(times, dtype=float)
    facts = events.Recording(
        recording="001", name=name, case="c", step="", channels=(), rate=rate, duration=1.0, source="simulated"
    )
    of_channels = dict.fromkeys(channels, array if samples is None else np.asarray(samples, dtype=float))
    units = dict.fromkeys(channels, "uT")
    taken = Recorded(
        id="001",
        name=name,
        rate=rate,
        time=array,
        arrays=of_channels,
        units=units,
        instruments=units,
        source="simulated",
        complete=complete,
    )
    return {"facts": facts, "recorded": taken, "voids": ()}


ASKED = Records(recording="field", channels=("x", "y"), rate_hz=10.0, duration_s=1.0, max_gap_s=0.15)
WHOLE = np.arange(10) / 10


def verdicts(*taken):
    """Return the verdict of every criterion, by parameter."""
    return {limit.parameter: str(judge(value, limit).verdict) for limit, value, _ in data_checks(ASKED, taken)}


def test_a_whole_recording_meets_every_criterion():
    """Ten samples at 10 Hz last one second."""
    assert set(verdicts(recorded(WHOLE)).values()) == {"PASS"}
    assert set(verdicts(recorded(WHOLE))) == {"channels", "duration", "rate", "max_gap"}


@pytest.mark.parametrize(
    ("parameter", "changed"),
    [
        ("channels", {"times": WHOLE, "channels": ("x",)}),
        ("end", {"times": WHOLE, "complete": False}),
        ("duration", {"times": WHOLE[:9]}),
        ("rate", {"times": WHOLE * 1.01}),
        ("max_gap", {"times": [*WHOLE[:5], *WHOLE[5:] + 0.1]}),
    ],
)
def test_each_criterion_fails_for_its_reason(parameter, changed):
    """A channel, the end, some time, the rate or a gap: each has its own criterion."""
    assert verdicts(recorded(**changed))[parameter] == "FAIL"


@pytest.mark.parametrize(
    ("takes_s", "required_s", "rows", "verdict"),
    [
        ([0.00109], 1.0, 11, "PASS"),
        ([0.001, 0.00109], 1.0, 10, "PASS"),
        ([0.00109], 0.9, 10, "PASS"),
        ([0.00109], 2.0, 10, "FAIL"),
        ([0.00109], None, 10, None),
    ],
)
def test_a_recording_of_the_required_time_lasts_so_long(tmp_path, takes_s, required_s, rows, verdict):
    """A first sample that came 90 us late leaves it short: one more is taken, and nothing is excused."""
    asked = Records(recording="field", channels=("x", "y"), rate_hz=10.0, duration_s=required_s)
    entry = Requirement(id="T-031", rev=1, text="Record.", kind=Kind.RECORD, records=asked)
    case = Case(tmp_path, asked=(entry,))
    times = chain(takes_s, repeat(0.001))
    case.sensor._clock = SimpleNamespace(sleep=lambda _: case.clock.sleep(next(times)))
    taken = case.run.record("field", case.field, duration=1.0, rate=10.0)
    assert len(taken) == rows
    found = {limit.parameter: judge(value, limit) for limit, value, _ in data_checks(asked, case.run.record.taken)}
    assert [str(each.verdict) for name, each in found.items() if name == "duration"] == ([verdict] if verdict else [])


def test_a_missing_channel_is_told_with_those_that_are_there():
    """A plan that names `supply.vbat.voltage` of a recording of one role sees at once what it is called."""
    taken = recorded(WHOLE, channels=("voltage", "x"))
    (told,) = [value for limit, value, _ in data_checks(ASKED, [taken]) if limit.parameter == "channels"]
    assert told == "without y; it has voltage, x"


@pytest.mark.parametrize("lost", [[0], [3, 4], range(10)], ids=["one", "two", "all"])
@pytest.mark.parametrize("word", [math.nan, math.inf])
def test_samples_that_are_no_numbers_are_counted(lost, word):
    """One sample that is not finite makes the data inconclusive, and the channels and numbers are named."""
    samples = np.arange(10.0)
    samples[list(lost)] = word
    taken = recorded(WHOLE, samples=samples)
    assert verdicts(taken)["not_finite"] == "INCONCLUSIVE"
    ((value, reason),) = [(v, why) for limit, v, why in data_checks(ASKED, [taken]) if limit.parameter == "not_finite"]
    count = len(lost)
    assert (value.value, reason) == (2 * count, f"{2 * count} of 20 samples are not finite: x {count}, y {count}")


def test_only_channels_that_are_asked_for_must_be_finite():
    """A channel beside them may have been without a sensor."""
    array = np.full(10, math.nan)
    taken = recorded(WHOLE)
    taken["recorded"].arrays["temperature"] = array
    assert set(verdicts(taken).values()) == {"PASS"}


def test_a_time_that_is_no_number_is_counted():
    """A device's clock that is lost makes the data inconclusive: no gap and no duration can be told from it."""
    times = WHOLE.copy()
    times[4] = math.nan
    taken = recorded(times, samples=WHOLE)
    assert verdicts(taken)["not_finite"] == "INCONCLUSIVE"
    assert any(why == "1 of 20 samples are not finite: time 1" for _, _, why in data_checks(ASKED, [taken]))


def test_the_poorest_recording_counts():
    """One good recording of that name does not outweigh a poor one."""
    assert verdicts(recorded(WHOLE), recorded(WHOLE[:5]))["duration"] == "FAIL"


def test_one_sample_has_no_rate():
    """A single row shows nothing of a rate, and no duration, however slow it was asked to be."""
    for rate in (10.0, 1e-6):
        found = verdicts(recorded([0.0], rate=rate))
        assert (found["rate"], found["duration"], found["max_gap"]) == ("FAIL", "FAIL", "PASS")


def test_what_was_never_taken_has_no_criteria():
    """So its requirement stays NOT_EVALUATED."""
    assert verdicts(recorded(WHOLE, name="other")) == {}


@pytest.mark.parametrize("name", ["a\0b", "a\x1b[2J", "x" * 101, "a/b", "a.", "", 7])
def test_a_recording_has_a_name_that_can_be_written(tmp_path, name):
    """A NUL in its name was a traceback, and one in the seal after it: it is refused when it is given."""
    case = Case(tmp_path)
    with pytest.raises(Misused, match="a name "):
        case.run.record(name, case.field, duration=1.0, rate=1.0)
    assert case.written.of("recording") == []


def test_only_roles_of_the_case_are_recorded(tmp_path):
    """Numbers from anywhere else would be no measurement: objects, sets of roles, and roles of another case."""
    (tmp_path / "other").mkdir()
    case, other = Case(tmp_path), Case(tmp_path / "other")
    foreign = [
        (case.sensor, "this is a Magnetometer"),
        (SimpleNamespace(wire=case.field.wire, sample=lambda: (0.0, 0.0)), "this is a SimpleNamespace"),
        (other.field, "this belongs to another case"),
        (RoleSet("magnetometer", {"one": case.field}), "is a set of roles"),
    ]
    for source, message in foreign:
        with pytest.raises(Misused, match=message):
            case.run.record("field", source, duration=1.0, rate=10.0)
    assert case.written.events == []


def test_what_was_recorded_cannot_be_changed(tmp_path):
    """A requirement's criteria look at the same samples at the case's end."""
    case = Case(tmp_path)
    taken = case.run.record("field", case.field, duration=1.0, rate=10.0)
    for array in (taken["x"], taken.time):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    assert isinstance(case.run.record.taken, tuple)
