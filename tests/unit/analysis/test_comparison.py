"""Figures against each other: deviations with their significance, and ranks in which ties are ties."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from hil.analysis import normalised_error, rank, relative_deviation
from hil.model.errors import Refused
from hil.model.figure import Figure, FigureStatus


def volts(value, uncertainty=0.1, **other):
    """Return a figure in volts."""
    return Figure(value=value, unit="V", uncertainty=uncertainty, **other)


def test_a_deviation_is_that_of_the_second_from_the_first():
    """The value, its uncertainty to first order, and the probability of the difference."""
    found = relative_deviation(volts(2.0, 0.03), volts(2.5, 0.04))
    assert found.relative.value == pytest.approx(0.25)
    assert found.relative.uncertainty == pytest.approx(math.hypot(0.04 / 2.0, 1.25 * 0.03 / 2.0))
    assert found.probability == pytest.approx(math.erfc(10.0 / math.sqrt(2.0)))
    assert found.significant
    assert found.remark == "the difference is beyond what the uncertainties explain (p = 1.5e-23)"
    assert (found.difference.value, found.difference.unit) == (0.5, "V")
    assert found.difference.uncertainty == pytest.approx(0.05)


def test_a_negative_first_figure_keeps_the_sense_of_the_difference():
    """The deviation of a drift is positive where the second one is larger, whatever the sign of the first."""
    assert relative_deviation(volts(-2.0), volts(-1.0)).relative.value == pytest.approx(0.5)
    assert relative_deviation(volts(-2.0), volts(-3.0)).relative.value == pytest.approx(-0.5)


def test_a_deviation_does_not_show_how_its_figures_were_rounded():
    """The last digits of a sum depend on the order of its parts, and stand first in a small difference."""
    first, second = volts(0.1 + 0.2), volts(0.3 * 1.001)
    found, again = (relative_deviation(each, second).relative.value for each in (first, volts(0.3)))
    assert found == again == 0.001


def test_degrees_of_freedom_count():
    """The same difference is significant where the uncertainties are well known, and not where they are not."""
    first, second = volts(1.0), volts(1.35)
    assert relative_deviation(first, second).significant
    few = relative_deviation(replace(first, dof=2.0), replace(second, dof=2.0))
    assert (few.significant, few.probability) == (False, pytest.approx(0.0689, abs=5e-4))  # Student's t, 4 dof, 2.475
    assert few.remark == "the difference is within the uncertainties (p = 0.069)"


def test_nothing_is_relative_to_what_may_be_zero():
    """A drift below the resolution has no relative deviation; that the second one differs from it can be said."""
    found = relative_deviation(volts(0.1, 0.1), volts(2.0, 0.1))
    assert found.relative.status is FigureStatus.NOT_OBSERVABLE
    assert (found.significant, math.isnan(found.relative.value)) == (True, True)
    assert (found.difference.value, found.difference.status) == (pytest.approx(1.9), FigureStatus.MEASURED)
    assert found.difference.uncertainty == pytest.approx(math.hypot(0.1, 0.1))
    assert found.remark.endswith("and the first figure cannot be told from zero")
    nothing = relative_deviation(volts(0.0, 0.0), volts(0.0, 0.0))
    assert (nothing.relative.status, nothing.significant) == (FigureStatus.NOT_OBSERVABLE, False)


def test_a_normalised_error_is_the_difference_over_its_expanded_uncertainty():
    """It is 1 where the difference is k times its uncertainty, whichever is first and whatever zero is."""
    assert normalised_error(volts(-0.1), volts(0.1)).value == pytest.approx(0.2 / (1.959964 * 0.1 * math.sqrt(2.0)))
    assert normalised_error(volts(2.0, 0.03), volts(1.5, 0.04), confidence=0.9999).value == pytest.approx(10 / 3.890592)
    few = normalised_error(volts(1.0, dof=2.0), volts(1.35, dof=2.0))
    assert few.value == pytest.approx(0.35 / (2.776445 * 0.1 * math.sqrt(2.0)))  # Student's t, four degrees of freedom
    assert normalised_error(volts(-0.3)).value == normalised_error(volts(0.0, 0.0), volts(-0.3)).value
    assert (few.unit, few.status, few.uncertainty) == ("1", FigureStatus.MEASURED, None)


def test_a_normalised_error_says_what_the_probability_says():
    """Above 1 at a confidence is what happens by chance less often than that."""
    for second in (1.1, 1.25, 1.3, 1.4, 2.0):
        pair = volts(1.0, dof=5.0), volts(second, 0.05, dof=3.0)
        for confidence in (0.5, 0.95, 0.999):
            apart = relative_deviation(*pair, confidence=confidence).significant
            assert (normalised_error(*pair, confidence=confidence).value > 1.0) == apart


def test_figures_without_uncertainty_agree_only_where_they_are_equal():
    """Nothing explains a difference of exact figures."""
    assert normalised_error(volts(1.0, 0.0), volts(1.0, 0.0)).value == 0.0
    assert normalised_error(volts(1.0, 0.0), volts(1.1, 0.0)).value == math.inf


POOR = [
    (volts(1.0, status=FigureStatus.UPPER_LIMIT), "an upper limit of 1 V"),
    (volts(1.0, status=FigureStatus.NOT_OBSERVABLE), "not observable"),
    (volts(1.0, None, status=FigureStatus.MODEL_REJECTED), "of a model that the record rejects"),
    (volts(math.nan), "no finite number"),
]


@pytest.mark.parametrize(("poor", "why"), POOR)
def test_what_is_not_measured_has_no_deviation_and_no_rank(poor, why):
    """An upper limit is no number to compare with, nor a rank."""
    good = volts(2.0)
    for first, second, whose in ((poor, good, "first"), (good, poor, "second")):
        found = relative_deviation(first, second)
        assert found.relative.status is found.difference.status is FigureStatus.NOT_OBSERVABLE
        assert found.difference.unit == "V"
        assert normalised_error(first, second).status is FigureStatus.NOT_OBSERVABLE
        assert not found.significant
        assert found.remark == f"the {whose} figure is {why}"
    ranking = rank({"poor": poor, "good": good})
    assert dict(ranking.unranked) == {"poor": why}
    assert [(place.name, place.rank, place.ties) for place in ranking.places] == [("good", 1, ())]


def test_without_uncertainty_nobody_can_say_whether_figures_differ():
    """The number is given, and a check under a guarded rule is INCONCLUSIVE."""
    found = relative_deviation(volts(1.0, None), volts(2.0))
    assert (found.relative.value, found.relative.uncertainty, found.significant) == (1.0, None, False)
    assert (found.difference.value, found.difference.uncertainty) == (1.0, None)
    assert normalised_error(volts(1.0, None), volts(2.0)).status is FigureStatus.NOT_OBSERVABLE
    assert math.isnan(found.probability)
    assert "an uncertainty is not known" in found.remark
    assert dict(rank({"a": volts(1.0, None)}).unranked) == {"a": "of unknown uncertainty"}


def test_ties_are_ties():
    """Two that cannot be told apart share ranks; one that is worse for certain comes after both."""
    ranking = rank({"late": volts(3.0), "second": volts(1.1), "first": volts(1.0), "doubted": volts(0.1)},
                   doubts={"doubted": ["its samples are stuck"], "first": ()})  # fmt: skip
    assert [(place.name, place.said, place.ties) for place in ranking.places] == [
        ("first", "1-2", ("second",)),
        ("second", "1-2", ("first",)),
        ("late", "3", ()),
    ]
    assert dict(ranking.unranked) == {"doubted": "its samples are stuck"}


def test_a_tie_is_no_chain():
    """The first may be told from the last, and neither from the one between them."""
    ranking = rank({"a": volts(1.0), "b": volts(1.2), "c": volts(1.4)})
    assert [(place.said, place.ties) for place in ranking.places] == [
        ("1-2", ("b",)),
        ("1-3", ("a", "c")),
        ("2-3", ("b",)),
    ]


def test_nobody_is_ranked_among_nobody():
    """A table of nothing is empty."""
    assert rank({}).places == ()


def test_what_cannot_be_compared_is_refused():
    """Units are those of the caller; counts are never ranked with volts."""
    with pytest.raises(Refused, match="figures in V and K cannot be compared"):
        relative_deviation(volts(1.0), Figure(value=1.0, unit="K", uncertainty=0.1))
    with pytest.raises(Refused, match="cannot be compared"):
        rank({"a": volts(1.0), "b": Figure(value=1.0, unit="K", uncertainty=0.1)})
    with pytest.raises(Refused, match="a confidence of 95 is not between 0 and 1"):
        rank({}, confidence=95)
    with pytest.raises(Refused, match="figures in V and K cannot be compared"):
        normalised_error(volts(1.0), Figure(value=1.0, unit="K", uncertainty=0.1))


def test_equal_figures_are_told_apart_as_often_as_stated():
    """Of pairs of the same truth, with uncertainties known from ten samples each, one in twenty is significant."""
    random, pairs, size = np.random.default_rng(7), 500, 10
    drawn = random.normal(5.0, 1.0, (pairs, 2, size))
    means, spreads = drawn.mean(axis=-1), drawn.std(axis=-1, ddof=1) / math.sqrt(size)
    figures = [
        [volts(float(m), float(s), dof=size - 1) for m, s in zip(*pair, strict=True)]
        for pair in zip(means, spreads, strict=True)
    ]
    told = sum(relative_deviation(*pair).significant for pair in figures)
    assert binom.ppf(0.001, pairs, 0.05) <= told <= binom.ppf(0.999, pairs, 0.05)
