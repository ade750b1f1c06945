"""What the Allan analysis does with records that hold little, nothing or nonsense."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.analysis.allan import characterise, overlapping
from hil.model.errors import Refused
from hil.model.figure import FigureStatus


@pytest.mark.parametrize("data", [[], [1.0], [[1.0, 2.0], [3.0, 4.0]]])
def test_data_that_are_no_series_are_refused(data):
    """No sample, one sample or a table: a sentence that says what to give."""
    with pytest.raises(Refused, match="one series of two samples or more"):
        overlapping(data, 1.0)


def test_a_hole_in_the_data_is_refused_and_named():
    """NaN and infinity are counted and the first is named; they never spread silently."""
    with pytest.raises(Refused, match="2 of 5 samples are not finite numbers, the first is number 3"):
        characterise([1.0, 2.0, math.nan, 3.0, math.inf], 1.0, "deg/s")


def test_samples_too_large_to_add_up_are_refused():
    """Finite samples whose sum overflows are refused too."""
    with np.errstate(over="ignore"), pytest.raises(Refused, match="their sum is too large"):
        overlapping([1e308, 1e308, 1e308], 1.0)


@pytest.mark.parametrize("rate", [0.0, -1.0, math.nan, math.inf])
def test_an_impossible_rate_is_refused(rate):
    """A rate must be a finite number above zero."""
    with pytest.raises(Refused, match="rate of"):
        overlapping([1.0, 2.0, 3.0], rate)


@pytest.mark.parametrize("confidence", [0.0, 1.0, 95.0])
def test_an_impossible_confidence_is_refused(confidence):
    """A confidence is a probability, not a percentage."""
    with pytest.raises(Refused, match="between 0 and 1"):
        overlapping([1.0, 2.0, 3.0], 1.0, confidence=confidence)


@pytest.mark.parametrize("taus", [[0.1], [51.0], [math.nan], []])
def test_averaging_times_outside_the_record_are_refused(taus):
    """Averaging times lie between one sample and half of the record."""
    with pytest.raises(Refused, match="averaging times must lie between 1 s and 50 s"):
        overlapping(np.arange(100.0), 1.0, taus)


def test_averaging_times_are_rounded_to_samples_and_sorted():
    """Each asked time is taken at the nearest number of samples, once."""
    curve = overlapping(np.arange(100.0) % 7, 10.0, [1.02, 0.5, 0.98])
    assert curve.m.tolist() == [5, 10]
    assert curve.tau.tolist() == [0.5, 1.0]
    assert curve.terms.tolist() == [91, 81]


def test_octaves_end_at_a_quarter_of_the_record():
    """1000 samples give 1, 2, 4 ... 128 samples: 256 would be more than a quarter."""
    assert overlapping(np.arange(1000.0) % 7, 1.0).m.tolist() == [1, 2, 4, 8, 16, 32, 64, 128]


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


def test_integers_are_read_as_rates():
    """Raw counts come as integers."""
    data = np.random.default_rng(2).integers(-30, 30, 1000)
    assert overlapping(data, 1.0).deviation.tolist() == overlapping(data.astype(float), 1.0).deviation.tolist()


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


def test_the_averaging_window_of_falling_deviations_is_not_observable():
    """White noise alone falls to the end of the record: the best window may be longer."""
    window = characterise(np.random.default_rng(5).standard_normal(4096), 1.0, "deg/s").averaging_window
    assert window.status is FigureStatus.NOT_OBSERVABLE
