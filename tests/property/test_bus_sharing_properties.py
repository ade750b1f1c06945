"""Recordings and limits share the bus: rate, gap and ages all hold, or the recording is refused with figures."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

import sweeps
from case_parts import Case, limit
from hypothesis import example, given, note, settings
from hypothesis import strategies as st

from hil.model.errors import Misused
from hil.requirements.requirement import Kind, Records, Requirement

PERIODS = st.sampled_from([0.01, 0.02, 0.025, 0.05, 0.1, 0.5])
LIMITS = st.lists(
    st.tuples(
        st.sampled_from([0.5, 1.0, 2.0, 5.0]),  # period
        st.sampled_from([2.0, 2.5, 4.0, 10.0]),  # maximum age in periods
        st.sampled_from([0.001, 0.004, 0.01, 0.03, 0.07, 0.12]),  # how long a reading takes
    ),
    min_size=1,
    max_size=4,
)


def recorded(folder, period_s, share, limits, count, gap_s, before_s):
    """Time samples and readings three times, as arming does, then record; return verdicts, and the refusal if any."""
    duration_s = round(count * period_s, 9)  # as it is written in a catalogue
    asked = Records(
        recording="field", channels=("x", "y"), rate_hz=1 / period_s, duration_s=duration_s, max_gap_s=gap_s
    )
    watched = [
        (limit(f"limit-{number}", period=period, max_age=ages * period), takes)
        for number, (period, ages, takes) in enumerate(limits)
    ]
    requirement = Requirement(id="T-1", rev=1, text="Record.", kind=Kind.RECORD, records=asked)
    case = Case(folder, asked=(requirement,), watched=watched, sample_s=share * period_s)
    for _ in range(3):
        case.scheduler.monitoring.bus.sampled(case.field.wire.name, round(share * period_s * 1e9))
        for each, (_, _, takes) in zip(case.scheduler.monitoring.all, limits, strict=True):
            each.lasted(round(takes * 1e9))
    case.scheduler.sleep(1.0 + before_s)
    try:
        case.run.record("field", case.field, duration=duration_s, rate=1 / period_s)
    except Misused as refused:
        return {}, str(refused)
    case.run.finish()
    return {each.parameter: (str(each.verdict), each.reason) for each in case.run.check.evaluated}, ""


@settings(max_examples=sweeps.examples(50))
@given(
    PERIODS,
    st.floats(0.01, 0.9),
    LIMITS,
    st.integers(2, 400),
    st.floats(1.5, 8.0),
    st.floats(0.0, 6.0),
)
@example(0.1, 0.875, [(0.5, 10.0, 0.07), (5.0, 2.0, 0.03)], 229, 3.26, 0.0)  # delays add up to the end
@example(0.02, 0.875, [(1.0, 10.0, 0.07), (0.5, 2.5, 0.004)], 267, 6.44, 0.0)  # room kept for what is not needed
@example(
    0.02, 0.875, [(5.0, 4.0, 0.001), (5.0, 2.5, 0.12), (0.5, 2.0, 0.004)], 304, 2.01, 0.55
)  # read too often before
@example(  # one that can wait takes the room
    0.025,
    0.8652277364233034,
    [(5.0, 4.0, 0.07), (5.0, 10.0, 0.004), (2.0, 2.5, 0.07), (5.0, 2.5, 0.01)],
    398,
    6.03,
    0.0,
)
@example(0.1, 0.875, [(2.0, 10.0, 0.12), (0.5, 2.0, 0.001)], 125, 3.81, 2.48)  # late samples leave no wait
def test_rate_gap_and_ages_hold_or_the_recording_is_refused(period_s, share, limits, count, gaps, before_s):
    """Whatever has to be read meanwhile, and however long that takes; a trip by age would raise."""
    gap_s = gaps * period_s
    with tempfile.TemporaryDirectory() as folder:
        verdicts, refused = recorded(Path(folder), period_s, share, limits, count, gap_s, before_s)
    note(f"{verdicts} {refused}")
    if refused:
        figures_are_right(refused, period_s, share, limits, gap_s)
    else:
        assert {verdict for verdict, _ in verdicts.values()} == {"RECORDED"}


def figures_are_right(refused, period_s, share, limits, gap_s):
    """What is said of periods, readings, gap and ages is so, and does not go together."""
    told = {
        name: float(value) / (1000 if unit == "ms" else 1)
        for name, value, unit in re.findall(r"(gap of|spare\) need|than half of|limit-\d) ([\d.e+-]+) (m?s)", refused)
    }
    if "cannot be read every" in refused:
        number = int(re.search(r"limit-(\d)", refused)[1])
        assert share * period_s + limits[number][2] * 1.25 > limits[number][0] * (1 - 1e-6)
    elif "gap of" in told:
        number = int(re.search(r"limit-(\d)", refused)[1])
        needs = limits[number][2] * 1.25 + share * period_s
        assert abs(told["gap of"] - needs) <= 1e-3 * needs + 1e-9
        assert needs > gap_s * (1 - 1e-6)
        assert limits[number][2] * 1.25 > period_s * (1 - share) * (1 - 1e-6)
    else:
        assert 2 * told["spare) need"] >= told["than half of"] * (1 - 1e-3)
        named = {name: value for name, value in told.items() if name.startswith("limit-")}
        assert named
        for name, value in named.items():
            assert abs(value - limits[int(name[-1])][2] * 1.25) < 1e-3 * value
        shortest = min(limits[int(name[-1])][0] * (limits[int(name[-1])][1] - 1) for name in named)
        assert abs(told["than half of"] - shortest) < 1e-3 * shortest
