"""Drift over temperature and time: what was put in is read back, and what a record does not tell is not told."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
import sweeps
from scipy import stats

from hil.analysis.drift import drift_of, fragments
from hil.analysis.noise.rate_noise import NoiseLevels, RateNoise
from hil.model.errors import Refused
from hil.model.figure import FigureStatus
from hil.simulation.seeds import Seeds

RATE, LENGTH = 10.0, 600
TIME = np.arange(int(LENGTH * RATE)) / RATE
_TOP = 25 + 35 * (1 - math.exp(-300 / 86))
HEATED = np.where(TIME < 300, 25 + 35 * (1 - np.exp(-TIME / 86)), 25 + (_TOP - 25) * np.exp(-(TIME - 300) / 86))
"""Five minutes of lamp and five of cooling, the temperature after time constants of 86 s [degC]."""
RAMP = np.linspace(-20, 40, TIME.size)
LEVELS = {
    "a gyroscope": NoiseLevels(white=0.003, flicker=0.001, random_walk=1e-5),
    "a magnetometer": NoiseLevels(white=0.39, flicker=0.245, random_walk=0.018),
    "white": NoiseLevels(white=0.01),
    "random walk": NoiseLevels(white=1e-3, random_walk=0.01),
}


def noise(levels, seed, count=TIME.size):
    """Return noise of these levels."""
    streams = Seeds(seed)
    made = RateNoise(lambda kind: streams.stream("axis", kind), levels, rate=RATE, bandwidth=RATE / 2)
    return np.concatenate([made.samples(first, min(1000, count - first)) for first in range(0, count, 1000)])


def white(seed=1, sigma=0.01):
    """Return plain white noise."""
    return np.random.default_rng(seed).normal(0, sigma, TIME.size)


def covers(figure, true):
    """Return whether the 95 % interval of a figure holds the true value."""
    return abs(figure.value - true) <= stats.t.ppf(0.975, figure.dof) * figure.uncertainty


@pytest.mark.system
@pytest.mark.parametrize(("name", "levels"), LEVELS.items())
def test_intervals_hold_the_truth(name, levels):
    """Pooled over seeds at least 90 % of the 95 % intervals do, though 6000 samples are far from independent."""
    trials, right, naive = sweeps.chosen(12, 150), {"slope": 0, "hysteresis": 0, "per_hour": 0}, 0
    for seed in range(trials):
        values = noise(levels, seed)
        found = drift_of(TIME, HEATED, values + 0.02 * (HEATED - 25), "uT")
        right["slope"] += covers(found.slope, 0.02)
        right["hysteresis"] += covers(found.hysteresis, 0.0)
        right["per_hour"] += covers(drift_of(TIME, RAMP, values + TIME * 0.5 / 3600, "uT").per_hour, 0.5)
        plain = stats.linregress(HEATED, values)
        naive += abs(plain.slope) <= 1.96 * plain.stderr
    least = stats.binom.ppf(0.001, trials, 0.9)
    assert all(count >= least for count in right.values()), right
    if name in {"a magnetometer", "random walk"}:
        assert naive < 0.7 * trials


def test_the_line_is_that_of_an_independent_library():
    """Slope and offset of the averages as scipy fits them; for white noise its standard error, too."""
    found = drift_of(TIME, HEATED, 0.3 + 0.02 * HEATED + white(), "deg/s", reference=30.0)
    plain = stats.linregress(found.temperature - 30.0, found.value)
    assert found.slope.value == pytest.approx(plain.slope, rel=1e-9)
    assert found.offset.value == pytest.approx(plain.intercept, rel=1e-9)
    assert 0.7 * plain.stderr < found.slope.uncertainty < 2.5 * plain.stderr
    assert (found.slope.unit, found.offset.unit, found.per_hour.unit) == ("deg/s/K", "deg/s", "deg/s/h")


def test_the_line_of_a_chart_is_that_of_the_figures():
    """At the reference it is the offset, and it rises by the slope."""
    found = drift_of(TIME, HEATED, white() + 0.02 * (HEATED - 25), "uT", reference=30.0)
    at, above = found.line([30.0, 31.0])
    assert at == pytest.approx(found.offset.value, abs=1e-12)
    assert above - at == pytest.approx(found.slope.value)


def test_hysteresis_is_the_mean_of_heating_minus_cooling():
    """A value that lags its thermometer by five seconds; the truth is the mean over the temperatures of both legs."""
    lag, slope = 5.0, 0.074
    lagging = HEATED - lag * np.gradient(HEATED, TIME)
    found = drift_of(TIME, HEATED, slope * lagging + white(), "deg/s")
    up, down = TIME < 300, TIME >= 300
    at = np.linspace(HEATED[down].min() + 0.5, HEATED.max() - 0.5, 200)
    legs = [
        np.interp(at, HEATED[up], lagging[up]),
        np.interp(at, HEATED[down][::-1], lagging[down][::-1]),
    ]
    assert found.hysteresis.value == pytest.approx(slope * (legs[0] - legs[1]).mean(), rel=0.1)
    assert found.probability("hysteresis") < 0.001
    assert covers(found.slope, slope)


def test_a_drift_that_is_none_is_not_told_from_zero():
    """The t-test against zero, and one that finds a drift of the same record."""
    values = noise(LEVELS["a gyroscope"], 4)
    assert drift_of(TIME, HEATED, values, "deg/s").probability("slope") > 0.05
    assert drift_of(TIME, HEATED, values + 0.002 * HEATED, "deg/s").probability("slope") < 1e-3


@pytest.mark.parametrize(
    ("temperature", "values", "poor", "said"),
    [
        (HEATED, np.full(TIME.size, 17.937), ("slope", "offset", "hysteresis", "per_hour"), "stuck: all samples are"),
        (HEATED, np.where(TIME < 1, np.nan, white()), ("slope", "per_hour"), "finite: 10 of 6000 samples"),
        (np.rint((HEATED - 25) * 256), white(), ("slope", "offset", "hysteresis", "warming"), "raw counts"),
        (HEATED + 273.15, white(), ("slope", "offset", "hysteresis"), "kelvin"),
        (25 + 0.01 * white(), white(), ("slope", "offset", "hysteresis"), "changed by .* only, 5 K are needed"),
        (RAMP, white(), ("hysteresis",), "the temperature only rose"),
        (RAMP[::-1], white(), ("hysteresis",), "the temperature only fell"),
        (HEATED + 15, white(), ("offset",), "25 degC is not within the 41"),
    ],
)
def test_what_a_record_does_not_tell_is_not_observable(temperature, values, poor, said):
    """With its reason; a temperature in raw counts makes no drift per kelvin."""
    found = drift_of(TIME, temperature, values, "deg/s")
    assert set(found.reasons) >= set(poor)
    for name in poor:
        assert getattr(found, name).status is FigureStatus.NOT_OBSERVABLE
        assert found.why(name)[0].startswith(f"{name} is not observable: ")
        assert math.isnan(found.probability(name))
    assert any(re.search(said, each) for each in found.reasons.values()), found.reasons
    assert found.why("nothing of it") == []


def test_drift_over_time_needs_no_temperature():
    """With raw counts it is told all the same, and the change of the temperature is not."""
    found = drift_of(TIME, np.rint(RAMP * 256), white() + TIME * 0.01, "deg/s")
    assert covers(found.per_hour, 36.0)
    assert found.warming.status is FigureStatus.NOT_OBSERVABLE


def test_a_fragment_that_is_too_short_says_so():
    """Of eight bins with four samples each nothing may be missing."""
    short = slice(0, 31)
    found = drift_of(TIME[short], RAMP[short], white()[short], "deg/s")
    assert found.why("per_hour") == [
        "per_hour is not observable: 31 samples in 3 s are too few: 8 bins of 4 samples are needed"
    ]
    assert drift_of([], [], [], "deg/s").reasons["slope"].startswith("0 samples")


def test_a_log_with_gaps_falls_into_fragments():
    """At gaps, and where a clock was set back."""
    log = np.concatenate([TIME[:100], TIME[200:300], TIME[:50]])
    assert fragments(log, RATE) == [slice(0, 100), slice(100, 200), slice(200, 250)]
    assert fragments(log[:200], RATE, longest_gap=20.0) == [slice(0, 200)]
    assert fragments([], RATE) == []


def test_gaps_within_a_record_are_left_out():
    """The line goes on beyond them, and the noise knows how far apart the averages are."""
    kept = (TIME < 150) | (TIME > 350)
    found = drift_of(TIME[kept], HEATED[kept], (0.02 * HEATED + white())[kept], "deg/s")
    assert len(found.time) < 45
    assert covers(found.slope, 0.02)


def test_arrays_of_different_shapes_are_refused():
    """One of each per sample."""
    with pytest.raises(Refused, match="different shapes"):
        drift_of(TIME, HEATED[:-1], white(), "deg/s")


@pytest.mark.parametrize(("step", "from_", "frozen"), [(0.01, 300, True), (1.0, 300, True), (1.0, 600, False)])
def test_a_thermometer_that_freezes_tells_no_slope(step, from_, frozen):
    """Also a coarse one, which gives each reading for a while when it is sound; the drift over time remains."""
    time = np.arange(600.0)
    degrees = np.round((25.0 + 30.0 * np.sin(np.pi * time / 600.0)) / step) * step
    degrees[from_:] = degrees[from_ - 1]
    found = drift_of(time, degrees, np.random.default_rng(4).normal(size=600), "uT")
    assert (found.slope.status is FigureStatus.NOT_OBSERVABLE) == frozen
    assert found.per_hour.status is FigureStatus.MEASURED
    if frozen:
        assert found.why("slope")[0].startswith("slope is not observable: the temperature is frozen: it reads ")
