"""The calibration over temperature against a published campaign, and against simulated tables of known truth."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sweeps
from scipy.special import stdtrit

from hil.analysis.allan.averaging import MovingAverage, rest_mean
from hil.analysis.gyroscope.calibrate import calibrate
from hil.analysis.gyroscope.calibration import Polynomial
from hil.analysis.gyroscope.fitting import fit
from hil.analysis.gyroscope.readings import Reading
from hil.analysis.gyroscope.self_check import disagreements
from hil.model.figure import Figure

# Published with a CubeSat's IIM-42652: slopes (true rate over measured rate) at 25 and 40 degC, and the equations
# slope = c0 + c1 T that were printed for them.
SLOPES = {
    "x": ((25.0, 1.073), (40.0, 1.085)),
    "y": ((25.0, 1.026), (40.0, 0.9912)),
    "z": ((25.0, 1.042), (40.0, 1.005)),
}
EQUATIONS = {"x": (1.05, -0.0009231), "y": (1.099, -0.0029), "z": (1.093, 0.002056)}
ONE_PERCENT = 0.01


def within_band(hits, trials, probability):
    """Whether a count of hits agrees with a probability: a binomial band of 3.3 standard deviations, 1 in 1000."""
    return abs(hits - trials * probability) <= 3.3 * math.sqrt(trials * probability * (1.0 - probability))


def published(axis):
    """The printed equation of an axis."""
    return Polynomial(coefficients=EQUATIONS[axis], unit="1", reference=0.0, low=25.0, high=40.0)


def test_the_published_slopes_are_reproduced_by_our_fit():
    """Two slopes of each axis: our line goes through both, and says that nothing checks it."""
    for points in SLOPES.values():
        found = fit([where for where, _ in points], [Figure(value=value, unit="1") for _, value in points])
        assert found.polynomial.at([25.0, 40.0]) == pytest.approx([value for _, value in points], rel=1e-12)
        assert found.polynomial.covariance is None
        assert "nothing checks the line" in found.remark


def test_the_published_equations_are_rejected_for_x_and_z():
    """Within 1 % the equation of Y gives back its slopes; those of X and Z have the wrong sign, and are told so."""
    rejected = disagreements({axis: published(axis) for axis in SLOPES}, SLOPES, ONE_PERCENT)
    assert [rejection.axis for rejection in rejected] == ["x", "z"]
    x, z = rejected
    assert (x.temperature, z.temperature) == (40.0, 40.0)
    assert x.recomputed == pytest.approx(1.0131, abs=1e-4)
    assert z.recomputed == pytest.approx(1.1752, abs=1e-4)
    assert "x: the equation gives 1.0131 at 40 degC, where its table has 1.085" in str(x)


def test_a_turned_sign_is_named():
    """X agrees with its slopes to 0.2 % once the sign of its slope is turned."""
    (rejected,) = disagreements({"x": published("x")}, {"x": SLOPES["x"]}, 0.0025)
    assert rejected.remark == "with the sign of its slope turned it would agree"


BIAS = {"x": (-0.2, 0.0139), "y": (-0.04, 0.00056), "z": (0.25, 0.0034)}
SCALE = {"x": (1.073, 0.0008), "y": (1.026, -0.0023), "z": (1.042, -0.0025)}
TEMPERATURES = (-16.0, 0.0, 10.0, 25.0, 40.0, 45.0)


def table(generator, noise, *, curvature=0.0, rate=13.6, temperatures=TEMPERATURES):
    """Readings of a gyroscope with known bias and scale: at rest, and at both rates about each axis."""

    def mean(axis, temperature, rate_about):
        offset = temperature - 25.0
        bias = sum(c * offset**k for k, c in enumerate((*BIAS[axis], curvature)))
        scale = sum(c * offset**k for k, c in enumerate(SCALE[axis]))
        return Figure(
            value=bias + rate_about / scale + noise * generator.standard_normal(), unit="deg/s", uncertainty=noise
        )

    readings = []
    for temperature in temperatures:
        for turning in ({}, *({axis: sign * rate} for axis in BIAS for sign in (1.0, -1.0))):
            means = {axis: mean(axis, temperature, turning.get(axis, 0.0)) for axis in BIAS}
            readings.append(Reading(temperature=temperature, means=means, rates=turning))
    return readings


@pytest.mark.system
@pytest.mark.parametrize("curvature", [0.0, 2e-4])
def test_intervals_of_bias_and_scale_cover_as_they_claim(curvature):
    """1200 intervals in a soak, pooled over axes, parameters and seeds, tables of six temperatures: 68 % and 95 %."""
    generator = np.random.default_rng(31)
    inside = wide = trials = 0
    rounds = sweeps.chosen(15, 100)
    for _ in range(rounds):
        report = calibrate(table(generator, 0.004, curvature=curvature))
        for axis, calibrated in report.calibration.axes.items():
            for polynomial, truth in ((calibrated.bias, (*BIAS[axis], curvature)), (calibrated.scale, SCALE[axis])):
                for power in (0, 1):
                    error = abs(polynomial.coefficients[power] - truth[power])
                    error /= math.sqrt(polynomial.covariance[power][power])
                    trials += 1
                    inside += error < stdtrit(polynomial.dof, 0.84134)
                    wide += error < stdtrit(polynomial.dof, 0.975)
    assert trials == 12 * rounds
    assert within_band(inside, trials, 0.6827)
    assert within_band(wide, trials, 0.95)


def test_intervals_without_stated_uncertainties_cover_as_they_claim():
    """600 lines in a soak, six points of unknown uncertainty: Student intervals from the scatter, at 95 %."""
    generator = np.random.default_rng(32)
    hits = trials = 0
    rounds = sweeps.chosen(100, 300)
    for _ in range(rounds):
        values = 1.0 + 0.01 * (np.array(TEMPERATURES) - 25.0) + 0.01 * generator.standard_normal(6)
        found = fit(TEMPERATURES, [Figure(value=value, unit="deg/s") for value in values.tolist()]).polynomial
        if len(found.coefficients) > 2:
            continue
        for power, truth in ((0, 1.0), (1, 0.01)):
            error = abs(found.coefficients[power] - truth) / math.sqrt(found.covariance[power][power])
            trials += 1
            hits += error < stdtrit(found.dof, 0.975)
    assert trials > 1.6 * rounds
    assert within_band(hits, trials, 0.95)


def test_intervals_with_estimated_uncertainties_cover_as_they_claim():
    """1800 intervals in a soak, of ten points whose uncertainties have ten degrees of freedom: 95 %, not 90 %.

    And of the lines in them, one in twenty is taken for a curve, which is what AICc does to exact ones.
    """
    generator = np.random.default_rng(39)
    where = np.array([-16.0, 10.0, 25.0, 40.0, -16.1, 25.1, 40.1, -16.2, 25.2, 40.2])
    hits = trials = curved = 0
    rounds = sweeps.chosen(200, 600)
    for _ in range(rounds):
        estimates = 1e-3 * np.sqrt(generator.chisquare(10, where.size) / 10)
        values = 0.1 + 0.01 * (where - 25.0) + 1e-3 * generator.standard_normal(where.size)
        points = zip(values.tolist(), estimates.tolist(), strict=True)
        figures = [Figure(value=value, unit="deg/s", uncertainty=each, dof=10.0) for value, each in points]
        found = fit(where.tolist(), figures).polynomial
        curved += len(found.coefficients) > 2
        for temperature in (-15.0, 10.0, 40.0):
            bias = found.figure(temperature)
            error = abs(bias.value - 0.1 - 0.01 * (temperature - 25.0))
            trials += 1
            hits += error < bias.uncertainty * stdtrit(bias.dof, 0.975)
    assert trials == 3 * rounds
    assert 0.93 <= hits / trials <= 0.97
    assert curved <= 0.06 * rounds


def test_what_all_readings_share_is_added_to_what_their_scatter_says():
    """A shared rate widens the bias at every temperature alike, and a mounting the alignment; nothing else moves."""
    readings = table(np.random.default_rng(40), 0.004)
    plain = calibrate(readings).calibration
    told = calibrate(readings, bias_uncertainty=0.01, mounting_uncertainty=0.002).calibration
    for axis in "xyz":
        for temperature in (-16.0, 25.0, 45.0):
            own = plain.axes[axis].bias.figure(temperature)
            wide = told.axes[axis].bias.figure(temperature)
            assert wide.value == own.value
            assert wide.uncertainty == pytest.approx(math.hypot(own.uncertainty, 0.01))
        assert told.axes[axis].scale == plain.axes[axis].scale
    across = ~np.eye(3, dtype=bool)
    own, wide = (np.array(each.alignment_uncertainty)[across] for each in (plain, told))
    assert wide == pytest.approx(np.hypot(own, 0.002), rel=1e-3)


@pytest.mark.system
def test_intervals_of_calibrated_rates_cover_as_they_claim():
    """600 corrected readings in a soak, at 13.6 deg/s and 33 degC: 95 % of reading, bias and scale together."""
    generator = np.random.default_rng(33)
    hits = trials = 0
    for _ in range(sweeps.chosen(30, 200)):
        calibration = calibrate(table(generator, 0.004)).calibration
        for axis, calibrated in calibration.axes.items():
            bias = BIAS[axis][0] + 8.0 * BIAS[axis][1]
            scale = SCALE[axis][0] + 8.0 * SCALE[axis][1]
            measured = bias + 13.6 / scale + 0.01 * generator.standard_normal()
            rate = calibrated.figure(Figure(value=measured, unit="deg/s", uncertainty=0.01), 33.0)
            trials += 1
            hits += abs(rate.value - 13.6) < rate.uncertainty * stdtrit(rate.dof, 0.975)
    assert within_band(hits, trials, 0.95)


@pytest.mark.system
@pytest.mark.parametrize(("alpha", "band"), [("white", (0.93, 0.97)), ("walk", (0.9, 1.0))])
def test_intervals_of_means_at_rest_cover(alpha, band):
    """400 records in a soak: 95 % intervals hold the mean of white noise, and the middle of a random walk."""
    generator = np.random.default_rng(34)
    hits, rounds = 0, sweeps.chosen(200, 400)
    for _ in range(rounds):
        white = generator.standard_normal(2048)
        walk = np.cumsum(white) if alpha == "walk" else white
        found = rest_mean(walk, 10.0, "deg/s")
        truth = walk[1024] if alpha == "walk" else 0.0
        hits += abs(found.value - truth) < found.uncertainty * stdtrit(found.dof, 0.975)
    assert band[0] <= hits / rounds <= band[1]


def test_slow_noise_costs_more_than_the_number_of_samples_says():
    """White noise: s / sqrt(n). Under a random walk: many times more."""
    generator = np.random.default_rng(35)
    white = generator.standard_normal(20_000)
    assert rest_mean(white, 100.0, "deg/s").uncertainty == pytest.approx(1.0 / math.sqrt(20_000), rel=0.4)
    walk = white + np.cumsum(0.05 * generator.standard_normal(20_000))
    assert rest_mean(walk, 100.0, "deg/s").uncertainty > 20.0 * walk.std() / math.sqrt(20_000)


@pytest.mark.system
def test_curvature_is_found_where_it_is_and_only_there():
    """Of 100 tables in a soak: a curvature of ten uncertainties is always found, and seldom invented."""
    generator = np.random.default_rng(36)
    curved = [
        calibrate(table(generator, 0.004, curvature=2e-4)).bias["x"].polynomial for _ in range(sweeps.chosen(6, 50))
    ]
    assert all(len(each.coefficients) > 2 for each in curved)
    straight = [calibrate(table(generator, 0.004)).bias["x"].polynomial for _ in range(sweeps.chosen(24, 100))]
    assert sum(len(each.coefficients) > 2 for each in straight) <= 0.25 * len(straight)


def test_misalignment_of_three_axes_is_undone():
    """A sensor with cross-axis gains of a few percent: rates come back about the table's axes, within noise."""
    generator = np.random.default_rng(37)
    mixing = np.array([[0.95, 0.02, -0.03], [0.01, 0.98, 0.025], [-0.015, 0.03, 0.96]])
    names = ("x", "y", "z")
    readings = []
    for temperature in (10.0, 25.0, 40.0):
        for axis, sign in ((0, 0.0), *((axis, sign) for axis in range(3) for sign in (1.0, -1.0))):
            true = np.zeros(3)
            true[axis] = sign * 20.0
            measured = mixing @ true + np.array([0.1, -0.2, 0.3]) + 0.001 * generator.standard_normal(3)
            means = {
                name: Figure(value=value, unit="deg/s", uncertainty=0.001)
                for name, value in zip(names, measured.tolist(), strict=True)
            }
            readings.append(
                Reading(temperature=temperature, means=means, rates={names[axis]: sign * 20.0} if sign else {})
            )
    calibration = calibrate(readings).calibration
    true = np.array([5.0, -7.0, 11.0])
    measured = mixing @ true + np.array([0.1, -0.2, 0.3])
    found = calibration.correct(dict(zip(names, measured.tolist(), strict=True)), 30.0)
    assert [float(found[name]) for name in names] == pytest.approx(true.tolist(), abs=0.005)
    assert np.max(calibration.alignment_uncertainty) < 1e-4


def test_a_moving_average_does_to_white_noise_what_it_says():
    """100,000 samples through a queue of 100: a tenth of the noise, and the step response of the docs."""
    average = MovingAverage(samples=100, rate=10.0)
    noise = np.random.default_rng(38).standard_normal(100_000)
    assert average.filtered(noise).std() == pytest.approx(0.1, rel=0.1)
    step = np.concatenate([np.zeros(200), np.ones(200)])
    response = average.filtered(step)[200 - 99 :]
    assert response == pytest.approx(average.step(np.arange(response.size) / 10.0))
    assert average.delay == pytest.approx(4.95)
    assert average.settling == pytest.approx(9.9)


def test_the_gain_of_a_moving_average_is_its_spectrum():
    """|sin(pi f N / rate) / (N sin(pi f / rate))| is the Fourier transform of the queue's weights."""
    average = MovingAverage(samples=8, rate=100.0)
    spectrum = np.abs(np.fft.rfft(np.full(8, 1.0 / 8.0), 256))
    assert average.gain(np.fft.rfftfreq(256, 0.01)) == pytest.approx(spectrum, abs=1e-12)
