from __future__ import annotations

import math

import pytest
from scipy import special

from hil.model.figure import Figure, FigureStatus
from hil.model.verdict import Verdict
from hil.requirements.decision import judge
from hil.requirements.requirement import Decision, Limit
from hil.requirements.units import UnitError

GUARDED = Limit(parameter="error", unit="V", minimum="-1", maximum="1")
SIMPLE = Limit(parameter="error", unit="V", minimum="-1", maximum="1", decision=Decision.SIMPLE)
AT_MOST = Limit(parameter="noise", unit="V", maximum="1")
AT_LEAST = Limit(parameter="capacity", unit="W.h", minimum="6.5")


def volts(value, uncertainty=0.05, **others):
    """Return a figure in volts."""
    return Figure(value=value, unit="V", uncertainty=uncertainty, **others)


# U95 of 0.05 V at infinite degrees of freedom is 0.098 V.
@pytest.mark.parametrize(
    ("value", "verdict"),
    [
        (0.0, Verdict.PASS),
        (0.90, Verdict.PASS),
        (-0.90, Verdict.PASS),
        (0.91, Verdict.INCONCLUSIVE),
        (1.0, Verdict.INCONCLUSIVE),
        (1.09, Verdict.INCONCLUSIVE),
        (-1.09, Verdict.INCONCLUSIVE),
        (1.10, Verdict.FAIL),
        (-1.10, Verdict.FAIL),
        (50.0, Verdict.FAIL),
    ],
)
def test_guarded_decisions_keep_the_uncertainty_away_from_the_limit(value, verdict):
    """Inside by U95 passes, outside by U95 fails, the band between is inconclusive."""
    judgement = judge(volts(value), GUARDED)
    assert judgement.verdict is verdict
    assert judgement.expanded == pytest.approx(0.098, abs=1e-4)


@pytest.mark.parametrize(
    ("value", "verdict"),
    [(1.0, Verdict.PASS), (-1.0, Verdict.PASS), (1.0001, Verdict.FAIL), (-1.0001, Verdict.FAIL), (-0.0, Verdict.PASS)],
)
def test_simple_decisions_compare_with_the_limit_itself(value, verdict):
    """The limit belongs to what passes, known or unknown uncertainty alike."""
    assert judge(volts(value), SIMPLE).verdict is verdict
    assert judge(volts(value, None), SIMPLE).verdict is verdict


def test_the_reason_names_the_guard_band():
    """A person sees how wide the band is and what would pass."""
    assert judge(volts(0.95), GUARDED).reason == (
        "within the guard band of 0.098 V around the limit, at least -0.902002 and at most 0.902002 V passes"
    )
    assert judge(volts(1.5), GUARDED).reason == "1.5 V is above the maximum of 1 V"
    assert judge(volts(-1.5), GUARDED).reason == "-1.5 V is below the minimum of -1 V"
    assert judge(volts(-0.0), Limit(parameter="v", unit="V", minimum="1")).reason == "0 V is below the minimum of 1 V"
    assert judge(volts(0.0), GUARDED).reason == ""


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("limit", [GUARDED, SIMPLE, AT_MOST, Limit(parameter="x", unit="V")])
def test_what_is_no_finite_number_shows_nothing(value, limit):
    """Also where the comparison would be true, and where data is only recorded."""
    judgement = judge(volts(value), limit)
    assert judgement.verdict is Verdict.INCONCLUSIVE
    assert "not a finite number" in judgement.reason
    assert (judgement.margin, judgement.tur) == (None, None)


def test_a_guarded_decision_needs_an_uncertainty():
    """A missing, infinite or zero uncertainty is inconclusive, wherever the value is."""
    for value in (0.0, 50.0):
        assert "missing" in judge(volts(value, None), GUARDED).reason
        assert "not finite" in judge(volts(value, math.inf), GUARDED).reason
        assert "zero is not believed" in judge(volts(value, 0.0), GUARDED).reason
        assert "missing or not finite" in judge(volts(value), GUARDED, instrument_uncertainty=math.nan).reason
        assert "missing or not finite" in judge(volts(value), GUARDED, instrument_uncertainty=-1.0).reason


def test_few_degrees_of_freedom_widen_the_guard_band():
    """U95 follows Student's distribution: t is 2.262 at 9 and 4.303 at 2 degrees of freedom."""
    assert judge(volts(0.0, dof=9), GUARDED).expanded == pytest.approx(2.2622 * 0.05, rel=1e-4)
    assert judge(volts(0.85, dof=9), GUARDED).verdict is Verdict.PASS
    assert judge(volts(0.85, dof=2), GUARDED).verdict is Verdict.INCONCLUSIVE


def test_the_instrument_adds_in_quadrature():
    """3 and 4 make 5, and the degrees of freedom follow Welch and Satterthwaite."""
    judgement = judge(volts(0.0, 0.03, dof=4), GUARDED, instrument_uncertainty=0.04)
    assert judgement.uncertainty == pytest.approx(0.05)
    assert judgement.dof == pytest.approx(4 * 0.05**4 / 0.03**4)
    alone = judge(volts(0.0, None), GUARDED, instrument_uncertainty=0.05)
    assert (alone.verdict, alone.uncertainty, alone.dof) == (Verdict.PASS, 0.05, math.inf)


def test_everything_is_told_in_the_unit_of_the_limit():
    """A figure in millivolts against a limit in volts."""
    figure = Figure(value=500.0, unit="mV", uncertainty=10.0)
    judgement = judge(figure, GUARDED, instrument_uncertainty=10.0)
    assert judgement.value == pytest.approx(0.5)
    assert judgement.unit == "V"
    assert judgement.uncertainty == pytest.approx(0.0141421, rel=1e-5)
    assert judgement.margin == pytest.approx(1 - 1.959964 * 0.0141421 - 0.5, rel=1e-5)
    assert judgement.tur == pytest.approx(2 / (2 * 1.959964 * 0.0141421), rel=1e-5)


def test_temperatures_keep_their_uncertainty():
    """A limit in degC takes a figure in degC, never one in K."""
    limit = Limit(parameter="t", unit="degC", minimum="10", maximum="45")
    assert judge(Figure(value=25.0, unit="degC", uncertainty=0.1), limit).expanded == pytest.approx(0.196, abs=1e-3)
    with pytest.raises(UnitError, match="'K' does not convert to 'degC'"):
        judge(Figure(value=25.0, unit="K", uncertainty=0.1), limit)


def test_units_that_do_not_convert_are_an_error():
    """Charge is not energy, whatever the numbers."""
    with pytest.raises(UnitError, match="'mAh' does not convert to 'W.h'"):
        judge(Figure(value=7070.0, unit="mAh", uncertainty=1.0), AT_LEAST)


def test_the_margin_is_the_distance_to_the_nearest_acceptance_limit():
    """Positive inside, negative outside; unknown where the guard band is unknown."""
    assert judge(volts(0.5), SIMPLE).margin == pytest.approx(0.5)
    assert judge(volts(-1.5), SIMPLE).margin == pytest.approx(-0.5)
    assert judge(volts(0.5), GUARDED).margin == pytest.approx(0.402, abs=1e-3)
    assert judge(volts(0.5, None), GUARDED).margin is None
    assert judge(volts(0.5), AT_MOST).margin == pytest.approx(0.402, abs=1e-3)


def test_a_low_uncertainty_ratio_cannot_pass():
    """Where min_tur is not reached, only a failure by more than U95 stands."""
    guarded = Limit(parameter="e", unit="V", minimum="-1", maximum="1", min_tur="4")
    assert judge(volts(0.0, 0.1), guarded).verdict is Verdict.PASS
    coarse = judge(volts(0.0, 0.2), guarded)
    assert coarse.verdict is Verdict.INCONCLUSIVE
    assert coarse.reason == "the test uncertainty ratio is 2.55, at least 4 is required"
    assert judge(volts(5.0, 0.2), guarded).verdict is Verdict.FAIL
    simple = Limit(parameter="e", unit="V", minimum="-1", maximum="1", min_tur="4", decision=Decision.SIMPLE)
    assert judge(volts(1.1, 0.2), simple).verdict is Verdict.INCONCLUSIVE
    assert judge(volts(1.5, 0.2), simple).verdict is Verdict.FAIL
    assert judge(volts(0.0, None), simple).verdict is Verdict.INCONCLUSIVE
    assert judge(volts(0.0, 0.0), simple).verdict is Verdict.INCONCLUSIVE


def test_an_uncertainty_wider_than_the_limits_leaves_nothing_to_accept():
    """The best possible value is inconclusive then; one far outside still fails."""
    judgement = judge(volts(0.0, 0.6), GUARDED)
    assert judgement.verdict is Verdict.INCONCLUSIVE
    assert judgement.reason == "the guard band of 1.18 V leaves no acceptance zone"
    assert judge(volts(3.0, 0.6), GUARDED).verdict is Verdict.FAIL


@pytest.mark.parametrize(
    ("limit", "value", "told"),
    [
        (Limit(parameter="e", unit="V", maximum="0.1", decision=Decision.GUARDED), 0.02, "maximum of 0.1 V"),
        (Limit(parameter="e", unit="V", minimum="-0.1", decision=Decision.GUARDED), -0.02, "minimum of -0.1 V"),
    ],
)
def test_an_uncertainty_larger_than_the_limit_is_told_as_that(limit, value, told):
    """Nobody is sent after a value that no magnitude can have."""
    reason = judge(volts(value, 0.06), limit).reason
    assert reason.startswith(f"the expanded uncertainty of 0.118 V alone is larger than the {told} allows: no value")
    assert "passes" not in reason


def test_an_upper_limit_can_only_pass_a_maximum():
    """It says nothing about a minimum, and never fails."""
    status = FigureStatus.UPPER_LIMIT
    assert judge(volts(0.5, status=status), AT_MOST).verdict is Verdict.PASS
    for limit, value in ((AT_MOST, 5.0), (AT_MOST, 0.99), (GUARDED, 0.0), (GUARDED, 5.0), (SIMPLE, 0.0)):
        assert judge(volts(value, status=status), limit).verdict is Verdict.INCONCLUSIVE
    simple = Limit(parameter="noise", unit="V", maximum="1", decision=Decision.SIMPLE)
    assert "shows nothing" in judge(volts(5.0, status=status), simple).reason
    energy = Figure(value=9.0, unit="W.h", uncertainty=0.1, status=status)
    assert judge(energy, AT_LEAST).verdict is Verdict.INCONCLUSIVE


@pytest.mark.parametrize("status", [FigureStatus.NOT_OBSERVABLE, FigureStatus.MODEL_REJECTED])
def test_what_the_analysis_does_not_vouch_for_shows_nothing(status):
    """Neither a pass nor a failure, nor data."""
    for limit, value in ((GUARDED, 0.0), (SIMPLE, 5.0), (Limit(parameter="x", unit="V"), 0.0)):
        judgement = judge(volts(value, status=status), limit)
        assert judgement.verdict is Verdict.INCONCLUSIVE
        assert status.value in judgement.reason


def test_without_a_limit_a_value_is_recorded():
    """Figures in a unit that converts, and words where no unit is due."""
    assert judge(volts(3.0, None), Limit(parameter="x", unit="mV")).verdict is Verdict.RECORDED
    assert judge("clockwise", Limit(parameter="direction")).verdict is Verdict.RECORDED
    with pytest.raises(UnitError):
        judge(volts(3.0, None), Limit(parameter="x", unit="A"))


def test_words_are_compared_as_they_are():
    """A chosen word passes or fails; a number in its place, or a word for a number, shows nothing."""
    limit = Limit(parameter="direction", equals="clockwise")
    assert judge("clockwise", limit).verdict is Verdict.PASS
    wrong = judge("Clockwise", limit)
    assert (wrong.verdict, wrong.reason) == (Verdict.FAIL, "expected 'clockwise', found 'Clockwise'")
    assert judge(volts(1.0), limit).verdict is Verdict.INCONCLUSIVE
    assert judge("one", GUARDED).verdict is Verdict.INCONCLUSIVE


def test_extreme_numbers_give_a_verdict():
    """Subnormal, huge and badly mixed numbers end in a verdict whose numbers are finite or absent."""
    for value in (5e-324, 1.7e308, -1.7e308):
        for uncertainty in (5e-324, 1e-300, 1e300, 1.7e308):
            for dof in (1e-6, 1e-3, 1.0, 1e300):
                judgement = judge(volts(value, uncertainty, dof=dof), GUARDED, instrument_uncertainty=1e-3)
                assert judgement.verdict in {Verdict.INCONCLUSIVE, Verdict.FAIL, Verdict.PASS}
                for number in (judgement.uncertainty, judgement.expanded, judgement.tur):
                    assert number is None or math.isfinite(number)


def test_infinite_degrees_of_freedom_have_the_factor_of_the_normal_distribution():
    """The number that stands in the code is that of scipy, to the last bit."""
    assert judge(volts(0.0, 1.0), AT_MOST).expanded == float(special.ndtri(0.975))
