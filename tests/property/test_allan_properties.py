"""What holds for the Allan deviation of any data."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.analysis.allan.deviation import ESTIMATORS, deviation

seeds = st.integers(0, 2**32 - 1)
estimators = st.sampled_from(ESTIMATORS)


def record(seed, count=256):
    """White noise from a seed."""
    return np.random.default_rng(seed).standard_normal(count)


@given(seeds, st.floats(1e-6, 1e6), estimators)
def test_scaling_the_data_scales_deviations_and_intervals(seed, factor, estimator):
    """Deviation, low and high follow the unit; degrees of freedom and noise types do not."""
    one = deviation(record(seed), 10.0, estimator=estimator)
    other = deviation(record(seed) * factor, 10.0, estimator=estimator)
    for name in ("deviation", "low", "high"):
        assert getattr(other, name) == pytest.approx(getattr(one, name) * factor, rel=1e-9)
    assert other.edf == pytest.approx(one.edf)
    assert other.alpha.tolist() == one.alpha.tolist()


@given(seeds, st.floats(-1e3, 1e3), estimators)
def test_an_offset_changes_nothing(seed, offset, estimator):
    """The deviation sees changes of the rate only."""
    moved = deviation(record(seed) + offset, 10.0, estimator=estimator)
    assert moved.deviation == pytest.approx(deviation(record(seed), 10.0, estimator=estimator).deviation, rel=1e-9)


@given(seeds, st.floats(-1e2, 1e2))
def test_a_drift_is_not_seen_by_hadamard(seed, slope):
    """Third differences of the angle are blind to a linear drift of the rate."""
    drifting = deviation(record(seed) + slope * np.arange(256.0), 10.0, estimator="hadamard")
    assert drifting.deviation == pytest.approx(deviation(record(seed), 10.0, estimator="hadamard").deviation, rel=1e-6)


@given(seeds)
def test_estimators_agree_at_one_sample(seed):
    """Overlapping or not, modified and total deviations are the same sum at the shortest averaging time."""
    same = [each for each in ESTIMATORS if each not in {"hadamard", "time"}]
    found = [deviation(record(seed), 1.0, [1.0], estimator=each).deviation[0] for each in same]
    assert found == pytest.approx([found[0]] * 4, rel=1e-12)


@given(seeds, estimators)
def test_a_record_read_backwards_has_the_same_deviations(seed, estimator):
    """Time has no direction for stationary differences, nor for the reflection at both ends."""
    backwards = deviation(record(seed)[::-1], 1.0, estimator=estimator)
    assert backwards.deviation == pytest.approx(deviation(record(seed), 1.0, estimator=estimator).deviation, rel=1e-9)


@given(seeds, st.sets(st.integers(0, 255), min_size=1, max_size=8))
def test_what_stands_in_a_hole_does_not_matter(seed, places):
    """Terms and deviations with holes are those of the samples that are there, and never more terms than without."""
    data = record(seed)
    data[sorted(places)] = np.nan
    holed = deviation(data, 1.0, [1.0, 2.0, 4.0], holes=True)
    assert (holed.terms < deviation(record(seed), 1.0, [1.0, 2.0, 4.0]).terms).all()
    steps = np.diff(data)
    assert holed.deviation[0] == pytest.approx(np.sqrt(np.nanmean(steps**2) / 2.0), rel=1e-9)


@given(st.floats(1e-3, 1e3), st.floats(0.1, 1e3))
def test_a_drift_is_seen_as_its_slope_times_tau_over_the_root_of_two(slope, rate):
    """A ramp R t alone has the deviation R tau / sqrt(2) at every averaging time."""
    curve = deviation(slope * np.arange(200) / rate, rate)
    assert curve.deviation == pytest.approx(slope * curve.tau / np.sqrt(2.0), rel=1e-9)


@given(seeds, st.floats(0.1, 1e3))
def test_the_rate_only_stretches_time(seed, rate):
    """The same samples at another rate have the same deviations at proportional averaging times."""
    curve = deviation(record(seed), rate)
    assert curve.deviation.tolist() == deviation(record(seed), 1.0).deviation.tolist()
    assert curve.tau == pytest.approx(curve.m / rate)


@given(seeds, st.floats(0.05, 0.6), st.floats(0.01, 0.3))
def test_more_confidence_is_a_wider_interval_around_the_deviation(seed, confidence, more):
    """Intervals hold the deviation for usual confidences, and nest."""
    narrow = deviation(record(seed), 1.0, confidence=confidence)
    wide = deviation(record(seed), 1.0, confidence=confidence + more)
    assert (wide.low < narrow.low).all()
    assert (narrow.low < narrow.high).all()
    assert (narrow.high < wide.high).all()
