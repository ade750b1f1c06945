"""The Allan analysis against published values, an independent library, and simulated noise of known level."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import allantools
import numpy as np
import pytest
import sweeps
from allantools import ci
from scipy.special import stdtrit

from hil.analysis.allan import deviation as estimators
from hil.analysis.allan.confidence import degrees, edf, total_bias
from hil.analysis.allan.deviation import ESTIMATORS, deviation
from hil.analysis.allan.fit import TERMS, variances
from hil.analysis.allan.noise import characterise
from hil.analysis.allan.tones import tones
from hil.model.figure import FigureStatus


def park_miller(count):
    """The portable test set of SP1065 section 12.4: uniform numbers between 0 and 1."""
    numbers = [1234567890]
    while len(numbers) < count:
        numbers.append(16807 * numbers[-1] % 2147483647)
    return np.array(numbers) / 2147483647


def noise(generator, count, rate, white=0.0, flicker=0.0, random_walk=0.0, quantisation=0.0, ramp=0.0):
    """Rate noise with exact levels: flicker shaped in the frequency domain, random walk as a running sum."""
    values = white * math.sqrt(rate) * generator.standard_normal(count)
    if flicker:
        spectrum = np.fft.rfft(generator.standard_normal(2 * count))
        frequency = np.fft.rfftfreq(2 * count, 1.0 / rate)
        frequency[0] = np.inf
        values += np.fft.irfft(spectrum * flicker * np.sqrt(rate / (2.0 * np.pi * frequency)))[:count]
    values += np.cumsum(random_walk / math.sqrt(rate) * generator.standard_normal(count))
    if quantisation:
        values += np.diff(generator.uniform(-1.0, 1.0, count + 1)) * math.sqrt(3.0) * quantisation * rate
    return values + ramp * np.arange(count) / rate


def within_band(hits, trials, probability):
    """Whether a count of hits agrees with a probability: a binomial band of 3.3 standard deviations, 1 in 1000."""
    return abs(hits - trials * probability) <= 3.3 * math.sqrt(trials * probability * (1.0 - probability))


PRINTED = {
    "overlapping": ["2.922319e-01", "9.159953e-02", "3.241343e-02"],
    "nonoverlapping": ["2.922319e-01", "9.965736e-02", "3.897804e-02"],
    "time": ["1.687202e-01", "3.563623e-01", "1.253382e+00"],
    "modified": ["2.922319e-01", "6.172376e-02", "2.170921e-02"],
    "hadamard": ["2.943883e-01", "9.581083e-02", "3.237638e-02"],
    "total": ["2.922319e-01", "9.134743e-02", "3.406530e-02"],
}


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_the_thousand_points_of_sp1065_give_the_printed_deviations(estimator):
    """SP1065, 1000-point test suite: every estimator at 1, 10 and 100 s, all seven digits."""
    curve = deviation(park_miller(1000), 1.0, [1.0, 10.0, 100.0], estimator=estimator)
    assert [f"{each:.6e}" for each in curve.deviation] == PRINTED[estimator]
    assert curve.estimator == estimator


def test_the_ten_points_of_nbs_monograph_140_give_the_printed_deviations():
    """SP1065, NBS Monograph 140 annex 8.E: nine frequencies, overlapping Allan deviation at 1 and 2 s."""
    data = [892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0]
    assert deviation(data, 1.0, [1.0, 2.0]).deviation == pytest.approx([91.22945, 85.95287], abs=5e-6)


ORACLES = {
    "overlapping": allantools.oadev,
    "nonoverlapping": allantools.adev,
    "time": allantools.tdev,
    "modified": allantools.mdev,
    "hadamard": allantools.ohdev,
    "total": allantools.totdev,
}


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("rate", [1.0, 100.0])
def test_deviations_agree_with_allantools(rate, estimator):
    """Dense times of 80,000 random samples, more than one block, agree with allantools to 1e-12 relative."""
    data = np.random.default_rng(1).standard_normal(80_000)
    curve = deviation(data, rate, "dense", estimator=estimator)
    _, expected, _, terms = ORACLES[estimator](data, rate=rate, data_type="freq", taus=curve.tau)
    assert curve.deviation == pytest.approx(expected, rel=1e-12)
    assert curve.terms.tolist() == terms.tolist()


def test_holes_leave_white_noise_as_it_is():
    """A tenth of the samples lost, one by one and in bursts: the intervals at 99 % hold the true deviation."""
    generator = np.random.default_rng(21)
    data = generator.standard_normal(200_000)
    data[generator.choice(200_000, 2000, replace=False)] = math.nan
    for first in generator.choice(190_000, 6, replace=False):
        data[first : first + 3000] = math.nan
    curve = deviation(data, 1.0, holes=True, confidence=0.99)
    assert curve.missing == np.isnan(data).sum()
    truth = 1.0 / np.sqrt(curve.tau)
    assert ((curve.low < 1.03 * truth) & (truth < curve.high)).all()
    assert curve.tau[-1] >= 4096.0


def test_terms_without_holes_are_those_of_the_plain_estimator():
    """Short averages: exactly the differences of which no sample is missing are averaged."""
    data = np.random.default_rng(22).standard_normal(500)
    data[[100, 101, 250]] = math.nan
    curve = deviation(data, 1.0, [3.0], holes=True)
    means = np.convolve(data, np.ones(3) / 3.0, "valid")
    differences = means[3:] - means[:-3]
    assert curve.terms.tolist() == [np.isfinite(differences).sum()]
    assert curve.deviation == pytest.approx([math.sqrt(np.nanmean(differences**2) / 2.0)], rel=1e-12)


def test_a_large_offset_costs_no_digits():
    """An offset of a million standard deviations changes the deviations by less than 1e-8 relative."""
    data = np.random.default_rng(2).standard_normal(20_000)
    assert deviation(data + 1e6, 1.0).deviation == pytest.approx(deviation(data, 1.0).deviation, rel=1e-8)


@pytest.mark.parametrize("alpha", [2, 1, 0, -1, -2])
@pytest.mark.parametrize("m", [1, 2, 10, 33, 34, 100, 250])
def test_degrees_of_freedom_agree_with_the_published_algorithm(alpha, m):
    """1000 samples: within 0.1 % of Greenhall and Riley's combined algorithm as allantools computes it."""
    expected = ci.edf_greenhall(alpha, 2, m, 1001, overlapping=True)
    assert edf({alpha: 1.0}, m, 1001 - 2 * m) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("alpha", [2, 1, 0, -1, -2, -3, -4])
@pytest.mark.parametrize("m", [1, 2, 10, 24, 26, 100, 200])
def test_degrees_of_freedom_of_hadamard_agree_with_the_published_algorithm(alpha, m):
    """1000 samples, third differences: within 1 % of allantools, which lacks some values for alpha 2 and -4."""
    terms = 1001 - 3 * m
    if (alpha == -4 and 100 < 4 * m < terms) or (alpha == 2 and terms <= 3 * m):
        return
    expected = ci.edf_greenhall(alpha, 3, m, 1001, overlapping=True)
    assert edf({alpha: 1.0}, m, terms, order=3) == pytest.approx(expected, rel=1e-2)


@pytest.mark.parametrize("alpha", [2, 1, 0, -1, -2])
@pytest.mark.parametrize("m", [1, 2, 10, 33, 34, 100, 250])
def test_degrees_of_freedom_of_modified_agree_with_the_published_algorithm(alpha, m):
    """1000 samples, phases averaged first: within 1 % of allantools."""
    expected = ci.edf_greenhall(alpha, 2, m, 1001, overlapping=True, modified=True)
    assert edf({alpha: 1.0}, m, 1002 - 3 * m, modified=True) == pytest.approx(expected, rel=1e-2)


def coloured(generator, alpha, count=1000, repeats=2000):
    """Records of noise with a spectrum that goes as the frequency to the power alpha, shape (repeats, count)."""
    spectrum = np.fft.rfft(generator.standard_normal((repeats, 2048)))
    frequency = np.fft.rfftfreq(2048)
    frequency[0] = 1e-9
    gain = np.where(frequency > 1e-6, (2.0 * np.sin(np.pi * frequency)) ** (alpha / 2.0), 0.0)
    return np.fft.irfft(spectrum * gain)[:, :count]


@pytest.mark.system
@pytest.mark.parametrize(
    ("estimator", "alpha", "m"),
    sweeps.sample(
        [
            (estimator, alpha, m)
            for estimator in ESTIMATORS
            if estimator != "time"
            for alpha in (2, 0, -1, -2)
            if (estimator, alpha) != ("total", 2)  # nothing is published, and the Allan ones stand in
            for m in (16, 250)
        ],
        8,
    ),
)
def test_degrees_of_freedom_agree_with_simulation(estimator, alpha, m):
    """1000 samples: 2 mean^2 / variance of 2000 simulated variances is within 20 % of the edf."""
    records = coloured(np.random.default_rng(100 + m), alpha)
    found = []
    for record in records:
        phase = np.concatenate([[0.0], np.cumsum(record)])
        found.append(getattr(estimators, estimator)(phase, m))
    variances_ = np.array([variance for variance, _ in found])
    simulated = 2.0 * variances_.mean() ** 2 / variances_.var()
    assert degrees(estimator, alpha, m, found[0][1], 1000) == pytest.approx(simulated, rel=0.2)


@pytest.mark.system
@pytest.mark.parametrize(("alpha", "m"), sweeps.sample([(0, 250), (-1, 250), (-2, 250), (-1, 500)], 2))
def test_the_bias_of_total_is_the_published_one(alpha, m):
    """Mean of 2000 simulated total over Allan variances, at a quarter or half of the record: within 5 %."""
    records = coloured(np.random.default_rng(200 + m), alpha)
    phases = np.concatenate([np.zeros((2000, 1)), np.cumsum(records, axis=1)], axis=1)
    ratio = np.mean([estimators.total(phase, m)[0] for phase in phases]) / np.mean(
        [estimators.overlapping(phase, m)[0] for phase in phases]
    )
    assert total_bias(np.array([alpha]), np.array([m]), 1000)[0] == pytest.approx(ratio, rel=0.05)


def test_degrees_of_freedom_are_small_at_long_averaging_times():
    """At a tenth and a quarter of the record: 12.8 and 4.0 for white noise, 7.7 and 2.2 for random walk."""
    found = [edf({alpha: 1.0}, m, 1001 - 2 * m) for alpha in (0, -2) for m in (100, 250)]
    assert found == pytest.approx([12.8, 4.0, 7.75, 2.24], abs=0.05)


def test_degrees_of_freedom_of_a_mixture_lie_between_its_parts():
    """Half white, half random walk: between the two, and equal to one where its share is all."""
    white, walk = (edf({alpha: 1.0}, 64, 872) for alpha in (0, -2))
    assert walk < edf({0: 0.5, -1: 0.0, -2: 0.5}, 64, 872) < white
    assert edf({0: 1.0, -1: 0.0, -2: 0.0}, 64, 872) == pytest.approx(white)


@pytest.mark.system
@pytest.mark.parametrize("term", TERMS)
def test_model_variances_are_those_of_simulated_noise(term):
    """Mean of 400 simulated Allan variances agrees with the exact sampled form to four standard errors."""
    generator = np.random.default_rng(7)
    factors = np.array([1, 2, 4, 16, 64])
    found = []
    for _ in range(400):
        data = noise(generator, 1024, 10.0, **{term: 2.0})
        found.append(np.square(deviation(data, 10.0, factors / 10.0).deviation))
    expected = 4.0 * variances(factors, 10.0)[:, list(TERMS).index(term)]
    error = np.std(found, axis=0) / math.sqrt(len(found))
    assert (np.abs(np.mean(found, axis=0) - expected) < 4.0 * error).all()


UNKNOWN = math.nan
SLOPES = ("white", "flicker", "random_walk")
EXPECTED = {
    "overlapping": lambda m: variances(m, 1.0)[:, 1:],
    "total": lambda m: variances(m, 1.0)[:, 1:],
    "modified": lambda m: np.column_stack([(m**2 + 1.0) / (2.0 * m**3), UNKNOWN * m, UNKNOWN * m]),
    "hadamard": lambda m: np.column_stack([1.0 / m, UNKNOWN * m, (m**2 + 1.0) / (6.0 * m)]),
}


@pytest.mark.system
@pytest.mark.parametrize(
    ("estimator", "term"),
    sweeps.sample(
        [
            *(("overlapping", term) for term in SLOPES),
            *(("total", term) for term in SLOPES),
            ("modified", "white"),
            ("hadamard", "white"),
            ("hadamard", "random_walk"),
        ],
        5,
    ),
)
def test_intervals_of_the_curve_cover_as_they_claim(estimator, term):
    """150 records of 2048 samples, 10 octaves each: between 65 % and 77 % of the 68 % intervals hold the truth.

    The points of a record are correlated and the noise type is itself estimated, so the band is wider than binomial.
    Expected variances are exact for sampled noise: sums of squared weights of the differences.
    """
    generator = np.random.default_rng(3)
    hits = trials = 0
    for _ in range(150):
        curve = deviation(noise(generator, 2048, 1.0, **{term: 1.0}), 1.0, estimator=estimator)
        truth = np.sqrt(EXPECTED[estimator](curve.m)[:, SLOPES.index(term)])
        hits += int(((curve.low < truth) & (truth < curve.high)).sum())
        trials += curve.tau.size
    assert 0.65 < hits / trials < 0.77


LEVELS = [
    {"white": 1.0, "flicker": 0.3, "random_walk": 0.0},
    {"white": 1.0, "flicker": 0.0, "random_walk": 0.3},
    {"white": 0.0, "flicker": 1.0, "random_walk": 0.0},
]


@pytest.mark.system
def test_uncertainties_of_the_coefficients_cover_as_they_claim():
    """Over 400 measured coefficients, in a soak, of 16,384-sample records: intervals within binomial bands.

    A level that is not there is hardly ever called measured, and bounds at 95 % hold at least that often.
    """
    generator = np.random.default_rng(11)
    trials = inside = wide = bounds = held = invented = 0
    rounds = sweeps.chosen(30, 90)
    for level in LEVELS * rounds:
        model = characterise(noise(generator, 16_384, 10.0, **level), 10.0, "deg/s")
        for term, truth in level.items():
            figure = getattr(model, term)
            if figure.status is FigureStatus.UPPER_LIMIT:
                bounds += 1
                held += figure.value >= truth
                continue
            assert figure.status in {FigureStatus.MEASURED, FigureStatus.MODEL_REJECTED}
            if figure.status is FigureStatus.MEASURED and not truth:
                invented += 1
            elif figure.status is FigureStatus.MEASURED:
                error = abs(figure.value - truth) / figure.uncertainty
                trials += 1
                inside += error < stdtrit(figure.dof, 0.84134)
                wide += error < stdtrit(figure.dof, 0.975)
    assert trials >= sweeps.chosen(120, 400)
    assert within_band(inside, trials, 0.6827)
    assert within_band(wide, trials, 0.95)
    assert held >= 0.95 * bounds
    assert invented < 0.03 * len(LEVELS) * rounds


def test_a_mixture_near_a_datasheet_is_recovered():
    """4 h at 10 Hz of N = 3.4e-3, B = 4.5e-4, K = 1.04e-5: N to 1 %, B to 30 %, K only bounded from above."""
    data = noise(np.random.default_rng(5), 144_000, 10.0, white=3.4e-3, flicker=4.5e-4, random_walk=1.04e-5)
    model = characterise(data, 10.0, "deg/s")
    assert model.white.value == pytest.approx(3.4e-3, rel=0.01)
    assert model.white.unit == "deg/s/sqrt(Hz)"
    assert model.flicker.status is FigureStatus.MEASURED
    assert model.flicker.value == pytest.approx(4.5e-4, rel=0.3)
    assert model.flicker.unit == "deg/s"
    assert model.random_walk.status is FigureStatus.UPPER_LIMIT
    assert model.random_walk.value > 1.04e-5
    assert 0.0 < model.random_walk.uncertainty < 0.31 * model.random_walk.value
    assert model.random_walk.unit == "deg/s*sqrt(Hz)"


@pytest.mark.system
@pytest.mark.parametrize("known", [{}, {"bandwidth": 8.1}, {"tau_min": 0.5}])
def test_a_filtered_sensor_keeps_its_white_noise(known):
    """White noise behind a first-order filter, whether it is given, found or left out: N to 2.5 u, and no Q claimed."""
    from scipy.signal import lfilter  # noqa: PLC0415 - slow to import

    data = lfilter([0.4], [1.0, -0.6], np.random.default_rng(6).standard_normal(200_000)) * 10.0
    model = characterise(data, 100.0, "deg/s", **known)
    assert model.white.status is FigureStatus.MEASURED
    assert abs(model.white.value - 1.0) < 2.5 * model.white.uncertainty < 0.1
    assert model.quantisation.status is FigureStatus.NOT_OBSERVABLE
    assert model.tau_min > 0.01


def test_the_longest_averaging_time_that_is_fitted_can_be_given():
    """A random walk beyond tau_max is not seen."""
    data = noise(np.random.default_rng(14), 16_384, 1.0, white=1.0, random_walk=0.02)
    assert characterise(data, 1.0, "deg/s").random_walk.status is FigureStatus.MEASURED
    assert characterise(data, 1.0, "deg/s", tau_max=32.0).random_walk.status is FigureStatus.UPPER_LIMIT


@pytest.mark.system
def test_a_fit_that_is_too_good_is_doubted():
    """A single spike follows the slope of white noise more closely than white noise does."""
    data = 1e-3 * np.random.default_rng(12).standard_normal(20_000)
    data[9000] = 100.0
    model = characterise(data, 10.0, "deg/s")
    assert model.white.status is FigureStatus.MODEL_REJECTED
    assert "better than noise allows" in model.remark


@pytest.mark.parametrize(("term", "expected"), [("white", 0), ("flicker", -1), ("random_walk", -2)])
def test_the_noise_type_is_not_redder_than_the_record(term, expected):
    """Twenty records of 16,384 samples: at most one is called another type at 512 samples and beyond."""
    generator = np.random.default_rng(31)
    types = [deviation(noise(generator, 16_384, 1.0, **{term: 1.0}), 1.0).alpha[9:] for _ in range(20)]
    assert sum(bool((each != expected).any()) for each in types) <= 1


def test_nearest_slopes_read_what_matlab_reads():
    """On exact model deviations of a single term the tangent reads its coefficient, at any rate."""
    from hil.analysis.allan.slopes import nearest_slopes  # noqa: PLC0415 - only here

    curve = deviation(np.random.default_rng(1).standard_normal(20_000), 10.0, unit="deg/s")
    for place, (name, unit) in enumerate(
        [("quantisation", "deg/s*s"), ("white", "deg/s/sqrt(Hz)"), ("flicker", "deg/s")]
    ):
        exact = replace(curve, deviation=3.0 * np.sqrt(variances(curve.m, 10.0)[:, place]))
        figure = nearest_slopes(exact)[name]
        assert (figure.value, figure.unit) == (pytest.approx(3.0, rel=0.01), unit)
        assert figure.uncertainty is None


def test_motion_is_rejected_by_the_model():
    """A slow oscillation ten times the noise is no noise: every coefficient says so and has no uncertainty."""
    generator = np.random.default_rng(8)
    data = generator.standard_normal(20_000) + 10.0 * np.sin(np.arange(20_000) * 2.0 * np.pi / 500.0)
    model = characterise(data, 100.0, "deg/s")
    figures = (model.white, model.flicker, model.random_walk)
    assert {figure.status for figure in figures} == {FigureStatus.MODEL_REJECTED}
    assert {figure.uncertainty for figure in figures} == {None}
    assert "motion" in model.remark


@pytest.mark.parametrize("amplitude", [0.3, 3.0])
def test_the_variance_of_a_line_is_that_of_a_sine(amplitude):
    """Frequency to a tenth of a point, square of the amplitude to 10 %, and with it the deviation of the sine alone."""
    time = np.arange(40_000) / 100.0
    sine = amplitude * np.sin(2.0 * np.pi * 23.7 * time + 1.0)
    (line,) = tones(sine + np.random.default_rng(1).standard_normal(time.size), 100.0)
    assert line.frequency == pytest.approx(23.7, abs=0.1 * 100.0 / 2048)
    assert line.square == pytest.approx(amplitude**2, rel=0.1)
    curve = deviation(sine, 100.0, [0.01, 0.02, 0.03, 0.07])
    exact = replace(line, frequency=23.7, square=amplitude**2)
    assert exact.variances(curve.m, 100.0) == pytest.approx(np.square(curve.deviation), rel=1e-3)


@pytest.mark.parametrize("seed", range(8))
def test_a_line_is_neither_quantisation_nor_white_noise(seed):
    """Near a third of the rate it looks like quantisation, elsewhere it moves white noise: rejected, or not moved."""
    generator, time = np.random.default_rng(seed), np.arange(8192) / 100.0
    hertz = generator.uniform(33.0, 33.7) if seed % 2 else generator.uniform(2.0, 49.0)
    sine = np.sin(2.0 * np.pi * hertz * time)
    model = characterise(generator.standard_normal(time.size) + sine, 100.0, "deg/s")
    if model.white.status is FigureStatus.MODEL_REJECTED:
        found = re.match(r"a line near ([\d.]+) Hz", model.remark)
        assert found is not None
        assert float(found[1]) == pytest.approx(hertz, abs=0.1)
    else:
        assert model.quantisation.status is not FigureStatus.MEASURED
        assert abs(model.white.value - 0.1) < 3.0 * model.white.uncertainty


def test_a_line_that_moves_nothing_is_left_alone():
    """A tenth of the white noise of a sample, and no line at all."""
    generator, time = np.random.default_rng(2), np.arange(16_384) / 100.0
    noise = generator.standard_normal(time.size)
    assert tones(noise, 100.0) == ()
    for record in (noise, noise + 0.1 * np.sin(2.0 * np.pi * 33.3 * time)):
        assert characterise(record, 100.0, "deg/s").white.status is FigureStatus.MEASURED
    assert tones(noise[:1000], 100.0) == ()
