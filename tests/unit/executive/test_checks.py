"""`check`: what the catalogue holds is evaluated and written down, everything else is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from case_parts import Case

from hil.executive.case.checks import CheckFailed, Misused
from hil.model.figure import Figure, FigureStatus
from hil.requirements.units import UnitError


def volts(value, **more):
    """Return a voltage."""
    return Figure(value=value, unit="V", **more)


@pytest.mark.parametrize(
    ("arguments", "of", "message"),
    [
        (("T-011", "ratio"), None, "this case is not marked with requirement 'T-011', did you mean 'T-010'?"),
        (("T-010", "rati"), None, "T-010 has no parameter 'rati', did you mean 'ratio'?"),
        (("T-020", "rate"), "w", "T-020 rate is evaluated of x, y, not of 'w'"),
        (("T-020", "rate"), None, "T-020 rate is evaluated of x, y, not of"),
        (("T-010", "ratio"), "x", "T-010 ratio is evaluated of nothing in particular, not of 'x'"),
    ],
)
def test_what_the_catalogue_does_not_hold_is_refused(tmp_path, arguments, of, message):
    """Requirement, parameter and `of` are all compared, and nothing is written."""
    case = Case(tmp_path, "T-010", "T-020")
    with pytest.raises(Misused) as caught:
        case.run.check(*arguments, 1.0, of=of)
    assert message in str(caught.value)
    assert case.written.events == []


@pytest.mark.parametrize("value", [5.0, 5, True, np.float64(5.0)])
def test_a_bare_number_has_no_unit(tmp_path, value):
    """Where a unit is due, a number without one is refused, a flag in any case."""
    case = Case(tmp_path, "T-050", "T-010")
    with pytest.raises(Misused, match="has no unit, and V is due"):
        case.run.check("T-050", "voltage", value)


def test_a_plain_number_may_be_bare(tmp_path):
    """Where the unit is 1 a number is enough; true and false are no numbers."""
    case = Case(tmp_path, "T-010")
    assert case.run.check("T-010", "ratio", np.float32(1.0)) == "PASS"
    with pytest.raises(Misused):
        case.run.check("T-010", "ratio", True)


@pytest.mark.parametrize(
    ("requirement", "parameter", "value", "verdict"),
    [
        ("T-010", "ratio", 1.0, "PASS"),
        ("T-010", "ratio", 2.0, "FAIL"),
        ("T-010", "ratio", math.nan, "INCONCLUSIVE"),
        ("T-010", "ratio", math.inf, "INCONCLUSIVE"),
        ("T-050", "voltage", volts(5.0), "INCONCLUSIVE"),
        ("T-050", "voltage", volts(5.0, uncertainty=0.01), "PASS"),
        ("T-050", "voltage", volts(5.0, uncertainty=0.01, status=FigureStatus.MODEL_REJECTED), "INCONCLUSIVE"),
        ("T-040", "answers", "yes", "PASS"),
        ("T-040", "answers", "no", "FAIL"),
        ("T-040", "answers", volts(1.0), "INCONCLUSIVE"),
        ("T-080", "noise", volts(0.1), "RECORDED"),
    ],
)
def test_a_check_returns_and_writes_its_verdict(tmp_path, requirement, parameter, value, verdict):
    """The case goes on whatever the verdict is, and the journal has it with its limit."""
    case = Case(tmp_path, requirement)
    assert case.run.check(requirement, parameter, value) == verdict
    (check,) = case.written.of("check")
    assert (check["verdict"], check["requirement"], check["parameter"]) == (verdict, requirement, parameter)
    assert (check["reason"] == "") == (verdict in {"PASS", "RECORDED"})
    if isinstance(value, float) and not math.isfinite(value):
        assert check["value"] is None


def test_a_figure_in_another_unit_is_converted_or_refused(tmp_path):
    """Millivolts are volts; seconds are not."""
    case = Case(tmp_path, "T-050")
    assert case.run.check("T-050", "voltage", Figure(value=5000.0, unit="mV", uncertainty=5.0)) == "PASS"
    (check,) = case.written.of("check")
    assert (check["value"], check["unit"], check["uncertainty"]) == (5.0, "V", 0.005)
    with pytest.raises(UnitError):
        case.run.check("T-050", "voltage", Figure(value=5.0, unit="s"))


def test_an_instrument_adds_its_certificate_in_quadrature(tmp_path):
    """What the case computed and what its instrument adds are one uncertainty; the journal names the instrument."""
    case = Case(tmp_path, "T-050")
    case.coil.voltage()
    case.run.check("T-050", "voltage", volts(5.0, uncertainty=0.01), instrument=case.coil)
    (check,) = case.written.of("check")
    assert check["uncertainty"] == pytest.approx(math.hypot(0.01, 0.026))
    assert check["instruments"] == ["psu1"]


def test_require_stops_what_does_not_pass(tmp_path):
    """A required check that passes goes on; one that does not ends the case, and is written all the same."""
    case = Case(tmp_path, "T-010")
    case.run.check.require("T-010", "ratio", 1.0)
    with pytest.raises(CheckFailed, match="T-010 ratio is FAIL: 2 is above the maximum of 1.5"):
        case.run.check.require("T-010", "ratio", 2.0)
    assert [check["verdict"] for check in case.written.of("check")] == ["PASS", "FAIL"]


def test_an_empty_member_is_none(tmp_path):
    """A check of nothing in particular counts as the one that is due."""
    case = Case(tmp_path, "T-010")
    case.run.check("T-010", "ratio", 1.0, of="")
    assert case.run.outcome().verdict == "PASS"


def test_what_is_written_is_what_was_judged(tmp_path):
    """The digits in the journal are those of the verdict, so that anybody judges the same again."""
    case = Case(tmp_path, "T-010")
    assert case.run.check("T-010", "ratio", 1.5 + 1e-13) == "PASS"
    assert case.written.of("check")[0]["value"] == 1.5
