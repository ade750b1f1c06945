"""By how much a fit is less certain where residuals of neighbours are alike."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.analysis.magnetometer.likeness import inflation


def shares(generator, alike, count=4000):
    """Return what residuals add to nine parameters; they keep a part of the last one's from reading to reading."""
    residual = generator.standard_normal(count)
    for place in range(1, count):
        residual[place] = alike * residual[place - 1] + math.sqrt(1.0 - alike**2) * residual[place]
    return (
        residual
        * generator.standard_normal((9, 1))
        * np.cos(np.multiply.outer(np.arange(9.0), np.arange(count) / 700.0))
    )


def test_independent_residuals_are_as_certain_as_they_say():
    """One in hundreds is called alike, and then by little."""
    found = [inflation(shares(np.random.default_rng(seed), 0.0)) for seed in range(300)]
    assert sum(each > 1.0 for each in found) <= 6
    assert max(found) < 2.0


@pytest.mark.parametrize("alike", [0.5, 0.8, 0.95])
def test_sums_of_residuals_that_are_alike_scatter_more(alike):
    """By (1 + a) / (1 - a) of a process that keeps the part a, as its directions change slowly."""
    found = [inflation(shares(np.random.default_rng(seed), alike)) for seed in range(30)]
    assert np.mean(found) == pytest.approx((1.0 + alike) / (1.0 - alike), rel=0.25)


def test_few_readings_or_singular_ones_tell_nothing():
    """Then the uncertainty is that of the fit."""
    generator = np.random.default_rng(1)
    assert inflation(shares(generator, 0.9, count=31)) == 1.0
    assert inflation(np.zeros((9, 100))) == 1.0
    assert inflation(np.ones((9, 1)) * shares(generator, 0.9)[0]) == 1.0
