from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hil.model.figure import Figure, FigureStatus
from hil.model.verdict import Verdict
from hil.requirements.decision import judge
from hil.requirements.requirement import Decision, Limit

steady = settings(derandomize=True)

_SAMPLES = 20_000
_BOUNDS = st.one_of(st.none(), st.decimals(-100, 100, places=3).map(str))
_VALUES = st.floats(-200, 200)
_UNCERTAINTIES = st.floats(1e-6, 50)


@st.composite
def limits(draw):
    """Limits with one or two sides, either decision, with and without a ratio to reach."""
    low, high = draw(_BOUNDS), draw(_BOUNDS)
    if low is not None and high is not None and float(low) > float(high):
        low, high = high, low
    assume(low is not None or high is not None)
    ratio = draw(st.sampled_from([None, "1", "4"])) if low is not None and high is not None else None
    return Limit(
        parameter="p", unit="V", minimum=low, maximum=high, decision=draw(st.sampled_from(Decision)), min_tur=ratio
    )


def _figure(value, uncertainty, **others):
    return Figure(value=value, unit="V", uncertainty=uncertainty, **others)


@steady
@given(limits(), _VALUES, _UNCERTAINTIES, st.floats(0.01, 1))
def test_knowing_better_never_turns_a_pass_into_a_failure(limit, value, uncertainty, shrink):
    """A pass stays a pass and a failure stays a failure while the uncertainty shrinks."""
    before = judge(_figure(value, uncertainty), limit).verdict
    after = judge(_figure(value, uncertainty * shrink), limit).verdict
    if before in {Verdict.PASS, Verdict.FAIL}:
        assert after is before


@steady
@given(limits(), _VALUES, st.one_of(st.none(), _UNCERTAINTIES), st.sampled_from(FigureStatus))
def test_guarded_never_passes_what_simple_does_not(limit, value, uncertainty, status):
    """The guarded rule is the stricter one, in both directions."""
    figure = _figure(value, uncertainty, status=status)
    guarded = judge(figure, replace(limit, decision=Decision.GUARDED)).verdict
    simple = judge(figure, replace(limit, decision=Decision.SIMPLE)).verdict
    if guarded in {Verdict.PASS, Verdict.FAIL}:
        assert simple is guarded


@steady
@given(limits(), _VALUES, _UNCERTAINTIES, st.sampled_from([("mV", 1e3), ("kV", 1e-3), ("uV", 1e6)]))
def test_the_unit_of_a_figure_does_not_matter(limit, value, uncertainty, unit):
    """The same figure in another unit gets the same verdict, away from the edges of rounding."""
    name, factor = unit
    reference = judge(_figure(value, uncertainty), limit)
    edges = [float(edge) for edge in (limit.minimum, limit.maximum) if edge is not None]
    expanded = reference.expanded or 0.0
    for edge in edges:
        for guard in (-expanded, 0.0, expanded):
            assume(abs(value - edge - guard) > 1e-6)
    if reference.tur is not None:
        assume(all(abs(reference.tur - ratio) > 1e-6 for ratio in (1, 4)))
    other = judge(Figure(value=value * factor, unit=name, uncertainty=uncertainty * factor), limit)
    assert other.verdict is reference.verdict


@steady
@given(limits(), st.sampled_from([math.nan, math.inf, -math.inf]), st.one_of(st.none(), _UNCERTAINTIES))
def test_what_is_no_number_never_passes(limit, value, uncertainty):
    """Nor does it fail: it shows nothing."""
    assert judge(_figure(value, uncertainty), limit).verdict is Verdict.INCONCLUSIVE


@steady
@given(limits(), _VALUES, st.one_of(st.none(), st.floats(0, 50)), st.floats(0.1, 100), st.sampled_from(FigureStatus))
def test_a_pass_is_always_inside_with_a_margin_that_says_so(limit, value, uncertainty, dof, status):
    """Whatever the inputs, a pass is within the limits and its margin is not negative."""
    judgement = judge(_figure(value, uncertainty, dof=dof, status=status), limit)
    low = -math.inf if limit.minimum is None else float(limit.minimum)
    high = math.inf if limit.maximum is None else float(limit.maximum)
    if judgement.verdict is Verdict.PASS:
        assert low <= value <= high
        assert judgement.margin is not None
        assert judgement.margin >= 0
    if judgement.verdict is Verdict.FAIL:
        assert not low <= value <= high


@steady
@given(limits(), _VALUES, _UNCERTAINTIES, st.floats(0, 10))
def test_an_instrument_never_makes_a_verdict_better(limit, value, uncertainty, instrument):
    """Its uncertainty only adds."""
    alone = judge(_figure(value, uncertainty), limit).verdict
    together = judge(_figure(value, uncertainty), limit, instrument_uncertainty=instrument).verdict
    assert together in {alone, Verdict.INCONCLUSIVE}


def _risks(ratio, decision):
    """Return how often an item is accepted wrongly and not accepted wrongly.

    Items follow a normal distribution with 95 % of them within the limits -1 and 1, and are measured
    with an uncertainty that gives the test uncertainty ratio.
    """
    rng = np.random.default_rng(20_261_121)
    true = rng.normal(0.0, 1 / 1.959964, _SAMPLES)
    standard = 1 / ratio / 1.959964
    found = true + rng.normal(0.0, standard, _SAMPLES)
    limit = Limit(parameter="p", unit="V", minimum="-1", maximum="1", decision=decision)
    accepted = np.array([judge(_figure(value, standard), limit).verdict is Verdict.PASS for value in found.tolist()])
    conforming = np.abs(true) <= 1
    return float(np.mean(accepted & ~conforming)), float(np.mean(~accepted & conforming))


def _within(found, expected):
    """Whether a relative frequency agrees with a probability given to two or three digits."""
    return abs(found - expected) < 4 * math.sqrt(expected * (1 - expected) / _SAMPLES) + 0.01 * expected + 5e-5


@pytest.mark.parametrize(
    ("ratio", "decision", "accepted_wrongly", "refused_wrongly"),
    [
        (4, Decision.SIMPLE, 0.0086, 0.0155),
        (4, Decision.GUARDED, 0.0002, 0.104),
        (2, Decision.GUARDED, None, 0.33),
        (1, Decision.GUARDED, None, 0.95),
    ],
)
def test_risks_agree_with_those_of_the_rules(ratio, decision, accepted_wrongly, refused_wrongly):
    """Wrong acceptance and wrong refusal, by test uncertainty ratio, in a seeded simulation."""
    accepted, refused = _risks(ratio, decision)
    assert _within(refused, refused_wrongly)
    assert accepted_wrongly is None or _within(accepted, accepted_wrongly)
    assert decision is Decision.SIMPLE or accepted < 0.025


@pytest.mark.parametrize("readings", [4, 30])
def test_an_item_at_the_limit_passes_in_one_of_forty_cases(readings):
    """With an uncertainty estimated from few readings, Student's quantile keeps the risk at 2.5 %."""
    rng = np.random.default_rng(readings)
    limit = Limit(parameter="p", unit="V", maximum="1")
    count = 10_000
    samples = rng.normal(1.0, 0.1, (count, readings))
    means = samples.mean(axis=1).tolist()
    errors = (samples.std(axis=1, ddof=1) / math.sqrt(readings)).tolist()
    passed = sum(
        judge(_figure(mean, error, dof=readings - 1), limit).verdict is Verdict.PASS
        for mean, error in zip(means, errors, strict=True)
    )
    failed = sum(
        judge(_figure(mean, error, dof=readings - 1), limit).verdict is Verdict.FAIL
        for mean, error in zip(means, errors, strict=True)
    )
    band = 4 * math.sqrt(0.025 * 0.975 / count)
    assert abs(passed / count - 0.025) < band
    assert abs(failed / count - 0.025) < band
