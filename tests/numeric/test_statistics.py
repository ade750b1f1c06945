"""Means of samples that hang together."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sweeps
from scipy.signal import lfilter
from scipy.stats import binom
from scipy.stats import t as student

from hil.analysis.statistics import correlation_time, mean, root_sum_square
from hil.model.figure import Figure, FigureStatus, effective_dof


def wandering(generator, phi, size):
    """Return samples of a first-order autoregressive process with mean zero, settled from the first one on."""
    return lfilter([1.0], [1.0, -phi], generator.standard_normal(size + 500))[500:]


@pytest.mark.system
@pytest.mark.parametrize(("phi", "size", "seed"), [(0.0, 12, 1), (0.0, 200, 2), (0.6, 600, 3), (0.9, 3000, 4)])
def test_intervals_of_the_mean_cover(phi, size, seed):
    """95 % intervals hold the true mean 93 to 97.5 times in 100, for white and for correlated samples."""
    generator = np.random.default_rng(seed)
    hits, rounds = 0, sweeps.chosen(300, 600)
    for _ in range(rounds):
        found = mean(wandering(generator, phi, size), "uT")
        hits += abs(found.value) <= student.ppf(0.975, found.dof) * found.uncertainty
    # The estimate of the correlation itself moves the level a little; the band allows for that and for the count.
    assert binom.ppf(1e-4, rounds, 0.93) <= hits <= binom.ppf(1 - 1e-4, rounds, 0.975)


def test_correlation_widens_the_mean():
    """Correlated samples are worth fewer: the uncertainty is that of the theory, not s / sqrt(n)."""
    samples = wandering(np.random.default_rng(5), 0.9, 50_000)
    naive = samples.std(ddof=1) / math.sqrt(samples.size)
    found = mean(samples, "uT")
    assert found.uncertainty == pytest.approx(naive * math.sqrt(19), rel=0.1)
    assert found.dof == pytest.approx(50_000 / 19, rel=0.2)


def test_white_samples_are_worth_their_number():
    """White noise has a correlation time of one sample."""
    assert correlation_time(np.random.default_rng(6).standard_normal(5000)) == pytest.approx(1.0, abs=0.2)


def test_alternating_samples_are_not_rewarded():
    """Samples that alternate would make a mean look better than it is; they count as independent at most."""
    assert correlation_time(np.tile([1.0, -1.0], 50)) == 1.0


def test_independent_samples_have_the_textbook_uncertainty():
    """With a correlation time of one sample the uncertainty is s / sqrt(n), with n - 1 degrees of freedom."""
    found = mean(np.tile([1.0, -1.0], 5), "uT")
    assert found.uncertainty == pytest.approx(math.sqrt(10 / 9 / 10))
    assert found.dof == pytest.approx(9)


def test_systematic_part_is_added_with_infinite_degrees_of_freedom():
    """What all samples share is not averaged away."""
    samples = np.random.default_rng(7).standard_normal(100)
    bare, full = mean(samples, "V"), mean(samples, "V", systematic=0.5)
    assert full.uncertainty == pytest.approx(math.hypot(bare.uncertainty, 0.5))
    assert full.dof > 100 * bare.dof
    assert full.unit == "V"


def test_constant_samples_have_the_systematic_part_only():
    """A reading that never moves has no scatter, so the resolution must come from the caller."""
    assert mean([2.5] * 10, "V").uncertainty == 0.0
    assert mean([2.5] * 10, "V", systematic=0.1).uncertainty == pytest.approx(0.1)


@pytest.mark.parametrize("samples", [[], [1.0], [1.0, math.nan, 2.0], [1.0, math.inf]])
def test_too_little_or_not_finite_is_not_observable(samples):
    """Nothing, one sample, or a number that is not finite give no mean that could pass."""
    assert mean(samples, "uT").status is FigureStatus.NOT_OBSERVABLE


def test_table_of_samples_is_refused():
    """A mean over a table would mix channels."""
    with pytest.raises(ValueError, match=r"one row of samples, got an array of shape \(2, 3\)"):
        mean(np.ones((2, 3)), "uT")


def test_degrees_of_freedom_combine_as_in_the_guide():
    """The guide's end gauge (GUM H.1.6): 25 nm (18), 9.7 nm (25.6), 2.9 nm (50), 16.6 nm (2) have 16.7 together."""
    parts = [(25.0**2, 18.0), (9.7**2, 25.6), (2.9**2, 50.0), (16.6**2, 2.0)]
    assert effective_dof(parts) == pytest.approx(16.7, abs=0.1)


@pytest.mark.parametrize("parts", [[], [(0.0, 3.0)], [(1.0, math.inf)]])
def test_no_doubt_has_infinite_degrees_of_freedom(parts):
    """Nothing, no variance, or exactly known variance leave nothing to estimate."""
    assert effective_dof(parts) == math.inf


def test_tiny_variances_keep_their_degrees_of_freedom():
    """Variances near the smallest number do not vanish when squared."""
    assert effective_dof([(1e-200, 4.0), (1e-200, 4.0)]) == pytest.approx(8.0)


def test_one_unknown_makes_the_sum_unknown():
    """A figure of unknown uncertainty is not taken as exact."""
    known, unknown = Figure(value=1.0, unit="V", uncertainty=0.1), Figure(value=1.0, unit="V")
    assert root_sum_square([(1.0, known), (1.0, unknown)]) == (None, math.inf)
    assert root_sum_square([(3.0, known), (-4.0, known)])[0] == pytest.approx(0.5)
