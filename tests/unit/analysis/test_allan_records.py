"""What the Allan analysis does with records that hold little, nothing or nonsense."""

from __future__ import annotations

import math
import tracemalloc

import numpy as np
import pytest

from hil.analysis.allan.deviation import ESTIMATORS, deviation
from hil.analysis.allan.noise import characterise
from hil.model.errors import Refused
from hil.model.figure import FigureStatus


@pytest.mark.parametrize("data", [[], [1.0], [[1.0, 2.0], [3.0, 4.0]]])
def test_data_that_are_no_series_are_refused(data):
    """No sample, one sample or a table: a sentence that says what to give."""
    with pytest.raises(Refused, match="one series of two samples or more"):
        deviation(data, 1.0)


def test_a_hole_in_the_data_is_refused_and_named():
    """NaN and infinity are counted and the first is named; they never spread silently."""
    with pytest.raises(Refused, match="2 of 5 samples are not finite numbers, the first is number 3"):
        characterise([1.0, 2.0, math.nan, 3.0, math.inf], 1.0, "deg/s")


def test_samples_too_large_to_add_up_are_refused():
    """Finite samples whose sum overflows are refused too."""
    with np.errstate(over="ignore"), pytest.raises(Refused, match="their sum is too large"):
        deviation([1e308, 1e308, 1e308], 1.0)


@pytest.mark.parametrize("rate", [0.0, -1.0, math.nan, math.inf])
def test_an_impossible_rate_is_refused(rate):
    """A rate must be a finite number above zero."""
    with pytest.raises(Refused, match="rate of"):
        deviation([1.0, 2.0, 3.0], rate)


@pytest.mark.parametrize("confidence", [0.0, 1.0, 95.0])
def test_an_impossible_confidence_is_refused(confidence):
    """A confidence is a probability, not a percentage."""
    with pytest.raises(Refused, match="between 0 and 1"):
        deviation([1.0, 2.0, 3.0], 1.0, confidence=confidence)


@pytest.mark.parametrize("taus", [[0.1], [51.0], [math.nan], []])
def test_averaging_times_outside_the_record_are_refused(taus):
    """Averaging times lie between one sample and half of the record."""
    with pytest.raises(Refused, match="averaging times must lie between 1 s and 50 s"):
        deviation(np.arange(100.0), 1.0, taus)


def test_averaging_times_are_rounded_to_samples_and_sorted():
    """Each asked time is taken at the nearest number of samples, once."""
    curve = deviation(np.arange(100.0) % 7, 10.0, [1.02, 0.5, 0.98])
    assert curve.m.tolist() == [5, 10]
    assert curve.tau.tolist() == [0.5, 1.0]
    assert curve.terms.tolist() == [91, 81]


def test_octaves_end_at_a_quarter_of_the_record():
    """1000 samples give 1, 2, 4 ... 128 samples: 256 would be more than a quarter."""
    assert deviation(np.arange(1000.0) % 7, 1.0).m.tolist() == [1, 2, 4, 8, 16, 32, 64, 128]


@pytest.mark.parametrize("value", [0.0, 17.937, 1 / 3])
def test_a_stuck_channel_is_not_observable(value):
    """The same value over and over is no noise of zero: nothing is claimed, and the remark says why."""
    model = characterise(np.full(1000, value), 100.0, "uT")
    for figure in (model.white, model.flicker, model.random_walk, model.averaging_window):
        assert figure.status is FigureStatus.NOT_OBSERVABLE
        assert math.isnan(figure.value)
        assert figure.uncertainty is None
    assert "stuck" in model.remark


def test_a_short_record_is_not_observable():
    """Too few averaging times for a fit: the deviations are there, the coefficients are not."""
    model = characterise(np.random.default_rng(0).standard_normal(40), 1.0, "deg/s")
    assert model.curve.deviation.size == 4
    assert model.white.status is FigureStatus.NOT_OBSERVABLE
    assert "record longer" in model.remark


def test_the_fit_leaves_out_what_is_below_tau_min():
    """The caller's shortest averaging time is the first that is fitted; the curve keeps all."""
    model = characterise(np.random.default_rng(1).standard_normal(5000), 100.0, "deg/s", tau_min=0.08)
    assert model.tau_min == 0.08
    assert model.curve.tau[0] == 0.01


def test_a_chart_has_the_line_where_it_was_fitted_and_bars_by_the_degrees_of_freedom():
    """What the command and the plans draw; a stuck channel has neither a line nor bars."""
    found = characterise(np.random.default_rng(2).standard_normal(4000), 100.0, "deg/s", tau_min=0.04)
    tau, fitted = found.line
    assert tau.tolist() == [each for each in found.curve.tau.tolist() if each >= 0.04]
    assert fitted.tolist() == found.fitted[-tau.size :].tolist()
    bars = [each.uncertainty / each.value for each in found.curve.figures]
    assert bars == pytest.approx(1.0 / np.sqrt(2.0 * found.curve.edf))
    stuck = characterise(np.zeros(4000), 100.0, "deg/s")
    assert stuck.line is None
    assert not any(each.uncertainty for each in stuck.curve.figures)


def test_integers_are_read_as_rates():
    """Raw counts come as integers."""
    data = np.random.default_rng(2).integers(-30, 30, 1000)
    assert deviation(data, 1.0).deviation.tolist() == deviation(data.astype(float), 1.0).deviation.tolist()


def test_the_callers_data_stay_as_they_are():
    """The analysis works on a copy."""
    data = np.random.default_rng(3).standard_normal(1000)
    before = data.copy()
    characterise(data, 1.0, "deg/s")
    assert (data == before).all()


def test_the_averaging_window_is_where_the_deviation_is_smallest():
    """White noise with a random walk has its smallest deviation inside the record, near sqrt(3) N / K."""
    generator = np.random.default_rng(4)
    data = generator.standard_normal(50_000) + np.cumsum(0.03 * generator.standard_normal(50_000))
    window = characterise(data, 1.0, "deg/s").averaging_window
    assert window.status is FigureStatus.MEASURED
    assert 16.0 <= window.value <= 128.0
    assert window.unit == "s"


def test_a_long_average_that_is_low_by_chance_is_not_the_window():
    """The deviation at a quarter of this record is the smallest, with two degrees of freedom; sqrt(3) N / K is 69 s."""
    generator = np.random.default_rng(21)
    data = generator.standard_normal(4096) + np.cumsum(0.025 * generator.standard_normal(4096))
    model = characterise(data, 1.0, "deg/s")
    assert model.curve.tau[np.argmin(model.curve.deviation)] == 1024.0
    assert (model.averaging_window.value, model.averaging_window.status) == (64.0, FigureStatus.MEASURED)


def test_the_averaging_window_of_falling_deviations_is_not_observable():
    """White noise alone falls to the end of the record: the best window may be longer."""
    window = characterise(np.random.default_rng(5).standard_normal(4096), 1.0, "deg/s").averaging_window
    assert window.status is FigureStatus.NOT_OBSERVABLE


def test_an_unknown_estimator_is_refused():
    """The message lists those that exist."""
    with pytest.raises(Refused, match="choose one of overlapping, nonoverlapping, modified, time, hadamard, total"):
        deviation(np.arange(10.0), 1.0, estimator="theo1")


def test_holes_are_counted_and_need_the_overlapping_estimator():
    """NaN is a missing sample only where the caller says so, and other estimators refuse it."""
    data = np.random.default_rng(6).standard_normal(1000)
    data[500] = math.nan
    curve = deviation(data, 1.0, [1.0, 30.0], holes=True)
    assert (curve.samples, curve.missing) == (1000, 1)
    assert curve.terms.tolist() == [997, 941]
    with pytest.raises(Refused, match="the modified deviation needs a record without holes, and 1 samples are missing"):
        deviation(data, 1.0, estimator="modified", holes=True)


def test_infinity_is_no_hole():
    """An overflow is not taken for a missing sample."""
    with pytest.raises(Refused, match="1 of 3 samples are not finite numbers, the first is number 2"):
        deviation([1.0, math.inf, math.nan], 1.0, holes=True)


@pytest.mark.parametrize(
    ("data", "why"), [([math.nan] * 5, "all 5 samples are missing"), ([1.0, math.nan] * 20, "neighbouring averages")]
)
def test_records_that_are_all_hole_are_refused(data, why):
    """No sample at all, or no two averages side by side."""
    with pytest.raises(Refused, match=why):
        deviation(data, 1.0, holes=True)


def test_averaging_times_in_holes_are_left_out():
    """Bursts of 20 samples with holes between them hold no average of 16."""
    data = np.random.default_rng(7).standard_normal(400)
    data[np.arange(400) % 30 >= 20] = math.nan
    assert deviation(data, 1.0, holes=True).m.tolist() == [1, 2, 4, 8]


def test_dense_times_are_twenty_a_decade():
    """Distinct whole numbers of samples up to a quarter of the record, 20 in the last full decade."""
    factors = deviation(np.arange(40_000.0) % 7, 1.0, "dense").m
    assert factors[0] == 1
    assert factors[-1] == 10_000
    assert (np.diff(factors) > 0).all()
    assert ((factors >= 1000) & (factors < 10_000)).sum() == 20


def test_the_analysis_needs_one_copy_of_the_data():
    """Peak memory beyond the caller's data stays below 1.2 times their size, for every estimator."""
    data = np.random.default_rng(8).standard_normal(1_000_000)
    for estimator in ESTIMATORS:
        tracemalloc.start()
        deviation(data, 1.0, [1.0, 1000.0], estimator=estimator)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 1.2 * data.nbytes


@pytest.mark.parametrize("rate", [1e30, 1e-30, 0.0, -1.0, math.nan])
def test_a_rate_that_no_sensor_has_is_refused(rate):
    """A unit of time that is wrong by far is told, before numbers leave their range."""
    with pytest.raises(Refused, match="no sampling rate of a sensor; check the unit of time"):
        characterise(np.random.default_rng(0).standard_normal(4000), rate, "deg/s")


@pytest.mark.parametrize("scale", [2.0**-310, 2.0**310])
def test_the_largest_and_smallest_data_are_fitted_as_any_other(scale):
    """Fourth powers of 1e90 are no numbers: what is fitted is near 1, and the coefficients are in the data's unit."""
    generator = np.random.default_rng(0)
    values = generator.standard_normal(2000) + np.cumsum(generator.standard_normal(2000)) * 0.05
    usual, found = characterise(values, 100.0, "deg/s"), characterise(values * scale, 100.0, "deg/s")
    for name in ("white", "flicker", "random_walk", "ramp"):
        one, other = getattr(usual, name), getattr(found, name)
        assert (other.value / scale, other.uncertainty / scale) == pytest.approx((one.value, one.uncertainty))
        assert (other.status, other.dof) == (one.status, pytest.approx(one.dof))
    assert found.fitted / scale == pytest.approx(usual.fitted)
    assert found.curve.deviation / scale == pytest.approx(usual.curve.deviation)
    assert found.averaging_window == usual.averaging_window
