"""Generated noise against theory: Allan deviations inside chi-square bands, levels, filters, independence."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from hil.analysis.allan.deviation import deviation
from hil.analysis.allan.noise import characterise
from hil.analysis.noise.processes import autoregressive
from hil.analysis.noise.rate_noise import BLOCK, NoiseLevels, RateNoise
from hil.simulation.seeds import Seeds

RATE = 100.0
FLOOR = np.sqrt(2 * np.log(2) / np.pi)
CONFIDENCE = 0.99


def record(levels, *, count, seed=1, name="gyro", bandwidth=RATE / 2):
    """Return the first samples of one axis."""
    seeds = Seeds(seed)
    noise = RateNoise(lambda kind: seeds.stream(name, kind), levels, rate=RATE, bandwidth=bandwidth)
    return noise.samples(0, count)


def pooled(levels, *, count, records, bandwidth=RATE / 2):
    """Return averaging factors, mean Allan variance of independent records, and its degrees of freedom."""
    curves = [
        deviation(record(levels, count=count, seed=seed, bandwidth=bandwidth), RATE) for seed in range(1, records + 1)
    ]
    variance = np.mean([curve.deviation**2 for curve in curves], axis=0)
    return curves[0].m, variance, np.sum([curve.edf for curve in curves], axis=0)


def band(edf):
    """Return the ends between which all ratios of variances lie, with Bonferroni's share for each."""
    tail = (1 - CONFIDENCE) / 2 / edf.size
    return chi2.ppf(tail, edf) / edf, chi2.ppf(1 - tail, edf) / edf


def assert_within(variance, theory, edf, tolerance=0.0):
    """Every variance lies in its chi-square band around a theory that may be wrong by `tolerance` in the deviation."""
    low, high = band(edf)
    ratio = variance / theory
    assert (ratio > low * (1 - tolerance) ** 2).all(), ratio
    assert (ratio < high * (1 + tolerance) ** 2).all(), ratio


def test_white_noise():
    """N^2/tau at every averaging time (IEEE Std 952-1997, annex C), where the filter just fits the rate of samples."""
    m, variance, edf = pooled(NoiseLevels(white=3.4e-3), count=2**18, records=4)
    assert_within(variance, 3.4e-3**2 * RATE / m, edf)


def test_random_walk():
    """K^2 (2 m^2 + 1)/(6 m fs), which is K^2 tau/3 for all but the shortest times."""
    m, variance, edf = pooled(NoiseLevels(random_walk=1e-3), count=2**18, records=4)
    assert_within(variance, 1e-6 * (2 * m**2 + 1) / (6 * m * RATE), edf)


def test_quantisation_of_the_angle():
    """3 Q^2/tau^2."""
    m, variance, edf = pooled(NoiseLevels(quantisation=1e-4), count=2**18, records=4)
    # The intervals know no bluer noise than white, whose degrees of freedom are more at short times: 1 % is granted.
    assert_within(variance, 3e-8 * (RATE / m) ** 2, edf, tolerance=0.01)


@pytest.mark.system
def test_flicker_noise_is_flat_within_five_percent():
    """0.664 B from two samples to a sixteenth of three hours; 22 % above it at one sample."""
    m, variance, edf = pooled(NoiseLevels(flicker=2e-3), count=2**20, records=4)
    usable = (m >= 2) & (m <= 2**16)
    assert_within(variance[usable], (FLOOR * 2e-3) ** 2, edf[usable], tolerance=0.05)
    assert np.sqrt(variance[0]) / (FLOOR * 2e-3) == pytest.approx(1.22, abs=0.02)


@pytest.mark.system
def test_the_sum_is_what_an_analysis_finds():
    """Coefficients that were put in come out: N within 1 %, B within three standard deviations of 10 %."""
    levels = NoiseLevels(white=3.4e-3, flicker=1.5e-3, random_walk=1e-5)
    model = characterise(record(levels, count=1_440_000), RATE, unit="deg/s")
    assert not model.remark
    assert model.white.value == pytest.approx(3.4e-3, rel=0.01)
    assert model.flicker.value == pytest.approx(1.5e-3, rel=0.3)


@pytest.mark.parametrize("bandwidth", [50.0, 104.7, 400.0])
def test_a_wide_filter_folds_noise_into_the_record(bandwidth):
    """The variance is 2 N^2 BW, and an analysis finds N sqrt(2 BW/fs)."""
    m, variance, edf = pooled(NoiseLevels(white=1e-2), count=2**17, records=4, bandwidth=bandwidth)
    assert_within(variance, 1e-4 * 2 * bandwidth / m, edf)


def test_a_narrow_filter_takes_noise_away_at_short_times_only():
    """The variance is 2 N^2 BW; at long averaging times N is what it was."""
    samples = record(NoiseLevels(white=1e-2), count=2**19, bandwidth=10.0)
    assert samples.std() == pytest.approx(1e-2 * np.sqrt(20), rel=0.01)
    m, variance, edf = pooled(NoiseLevels(white=1e-2), count=2**18, records=4, bandwidth=10.0)
    assert_within(variance[m >= 256], 1e-4 * RATE / m[m >= 256], edf[m >= 256], tolerance=0.01)
    assert variance[0] < 0.1 * 1e-4 * RATE


@pytest.mark.parametrize("coefficient", [0.05, 0.5, 0.65, 0.9, 0.999])
@pytest.mark.parametrize("size", [1, 2, 100, BLOCK])
def test_autoregression_against_a_filter_of_scipy(coefficient, size):
    """The same numbers as the recursion, sample by sample."""
    driver = np.random.default_rng(3).standard_normal(size)
    expected, _ = lfilter([1], [1, -coefficient], driver, zi=[coefficient * 3.0])
    assert autoregressive(driver, coefficient, 3.0) == pytest.approx(expected, rel=1e-10, abs=1e-11)


def test_axes_kinds_and_seeds_are_independent():
    """Other devices, axes or seeds have other noise, without correlation."""
    levels = NoiseLevels(white=1.0)
    rows = [record(levels, count=2**16, seed=seed, name=name) for seed in (1, 2) for name in ("x", "y")]
    correlation = np.corrcoef(rows) - np.eye(4)
    assert np.abs(correlation).max() < 4.5 / 2**8


def test_what_is_not_there_is_zero():
    """No level, no noise."""
    assert not record(NoiseLevels(), count=100).any()


def test_a_block_that_has_gone_is_refused():
    """Noise goes forwards; back within the block it does not."""
    seeds = Seeds(1)
    noise = RateNoise(lambda kind: seeds.stream("x", kind), NoiseLevels(white=1.0), rate=RATE, bandwidth=50.0)
    later = noise.samples(BLOCK + 10, 5)
    assert noise.samples(BLOCK, 15)[10:].tolist() == later.tolist()
    with pytest.raises(ValueError, match="has gone"):
        noise.samples(BLOCK - 1, 1)
