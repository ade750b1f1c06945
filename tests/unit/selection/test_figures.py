"""Why a check's figure does not count, and at which rate and behind which filter it was recorded."""

from __future__ import annotations

import pytest
from typed_events import event_of

from hil.evidence.results.outcome import CaseOutcome
from hil.model.verdict import Verdict
from hil.selection.figures import CALCULATED, _asked, _Conditions, _problem, _unproven

_CHECK = {
    "case": "test_noise", "step": "1", "requirement": "R-1", "parameter": "white_noise", "of": "gyroscope.bno.x",
    "value": 0.1, "unit": "deg/s/sqrt(Hz)", "uncertainty": 0.001, "dof": 20.0, "expanded": 0.002, "margin": 0.9,
    "limit": {"min": None, "max": "1", "equals": None}, "limit_unit": "deg/s/sqrt(Hz)", "decision": "guarded",
    "tur": None, "verdict": "PASS", "reason": "", "instruments": ["bno1"], "status": "measured",
    "provenance": ["recording rest, x", "characterise"],
}  # fmt: skip


def _case(verdict=Verdict.PASS):
    return CaseOutcome(
        case="test_noise", title="", plan="imu", verdict=verdict, reasons=("the port was lost",), requirements={},
        duration=1.0, attempts=(), used={}, checks=(), steps=(), recordings=(),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("changed", "case", "problem"),
    [
        ({}, Verdict.FAIL, ""),
        ({"verdict": "FAIL"}, Verdict.FAIL, ""),
        ({"verdict": "INCONCLUSIVE", "reason": "within the guard band"}, Verdict.INCONCLUSIVE, ""),
        ({}, Verdict.ERROR, "its case ended in ERROR: the port was lost"),
        ({"verdict": "INCONCLUSIVE", "doubts": ["stuck"]}, Verdict.INCONCLUSIVE, "its data are in DOUBT: stuck"),
        ({"status": "upper limit"}, Verdict.PASS, "it is an upper limit, not a measurement"),
        ({"status": "not observable", "value": None}, Verdict.PASS, "it is not observable in its record"),
        ({"status": "model rejected"}, Verdict.PASS, "its model does not describe the record"),
        ({"value": None, "status": ""}, Verdict.PASS, "it is not a number"),
        ({"value": "complete", "status": ""}, Verdict.PASS, "it is not a number"),
        (
            {"verdict": "INCONCLUSIVE", "uncovered": ["30 degC: no line"], "reason": "30 degC: no line"},
            Verdict.INCONCLUSIVE,
            "its check is INCONCLUSIVE: 30 degC: no line",
        ),
        (
            {"uncertainty": None, "expanded": None},
            Verdict.PASS,
            "its uncertainty is unknown, so it cannot be told apart from others",
        ),
    ],
)
def test_a_figure_counts_unless_its_data_speak_against_it(changed, case, problem):
    """A limit that is not met, or too near, is no reason: the figure is what it is."""
    check = event_of("check", **{**_CHECK, **changed})
    number = check.value if isinstance(check.value, float) else None
    assert _problem(_case(case), check, number) == problem


_NOWHERE = "no reading, recording or answer stands behind this value"
_BY_HAND = "its uncertainty was written by hand"


@pytest.mark.parametrize(
    ("instruments", "provenance", "unproven", "told"),
    [
        (["bno1"], ["recording rest, x"], [], ()),
        ([], ["parameter white", "simulate", "characterise"], [_NOWHERE], (CALCULATED,)),
        ([], ["parameter white", "simulate"], [_NOWHERE, _BY_HAND], (_NOWHERE, _BY_HAND)),
        ([], [], [_NOWHERE], (_NOWHERE,)),
        (["bno1"], ["recording rest, x", "parameter white"], [_BY_HAND], (_BY_HAND,)),
        ([], ["answer to level", "parameter white"], [_BY_HAND], (_BY_HAND,)),
    ],
)
def test_what_was_simulated_from_parameters_is_no_number_typed_by_hand(instruments, provenance, unproven, told):
    """A closure is calculated; a number from nowhere, and one that was changed, are told as the check told them."""
    changed = {"instruments": instruments, "provenance": provenance, "unproven": unproven}
    assert _unproven(event_of("check", **{**_CHECK, **changed})) == told


def test_what_requirements_ask_for_is_known_by_axis():
    """A limit without axes asks for one figure; a requirement without limits for none."""
    limits = [{"parameter": "white_noise", "of": ["x", "y"]}, {"parameter": "count", "of": []}]
    assert [*_asked([{"limits": limits}, {}])] == [("white_noise", "x"), ("white_noise", "y"), ("count", "")]


class _Told:
    """What a journal tells of a recording and of a filter."""

    def __init__(self, *events):
        self._events = events

    def of(self, kind):
        return tuple(each for each in self._events if type(each) is kind)


def test_rate_and_bandwidth_are_those_of_the_case_that_checked():
    """The recording is named by the check's provenance, and of its instruments; the filter by the axis' role."""
    channel = {"name": "x", "unit": "deg/s", "instrument": "bno1", "calibration": "", "uncertainty": None}
    recording = {
        "step": "1", "recording": "001-rest", "name": "rest", "channels": [channel], "duration": 1.0,
        "source": "simulated",
    }  # fmt: skip
    asked = {"step": "1", "ordinal": 1, "effect": "reads", "arguments": {}, "raised": ""}
    filtered = {"value": 13.3, "unit": "Hz", "uncertainty": None, "dof": None, "status": "measured"}
    told = _Conditions(
        _Told(
            event_of("recording", case="test_noise", rate=27.0, **recording),
            event_of("recording", case="test_other", rate=5.0, **recording),
            event_of(
                "recording",
                case="test_noise",
                rate=5.0,
                **{**recording, "channels": [{**channel, "instrument": "lsm1"}]},
            ),
            event_of("effect", case="test_noise", name="gyroscope.bno.bandwidth", result=filtered, **asked),
            event_of("effect", case="test_noise", name="gyroscope.lsm.bandwidth", result=None, **asked),
        )
    )
    assert told.of("test_noise", event_of("check", **_CHECK)) == {"rate": 27.0, "bandwidth": 13.3}
    other = event_of("check", **{**_CHECK, "of": "gyroscope.lsm.x", "provenance": None})
    assert told.of("test_noise", other) == {"rate": None, "bandwidth": None}
