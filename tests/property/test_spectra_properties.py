"""What holds for the spectrum of any data."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.analysis import Welch, spectrum

seeds = st.integers(0, 2**32 - 1)


@given(seeds, st.integers(16, 200), st.floats(1e-3, 1e6))
def test_the_sum_of_the_densities_is_the_mean_square(seed, count, rate):
    """Parseval, for one segment without window and trend, even and odd."""
    data = np.random.default_rng(seed).standard_normal(count) + 1.0
    found = spectrum(data, rate, how=Welch(segment=count, window="boxcar", detrend="none"))
    assert found.density.sum() * rate / count == pytest.approx(np.square(data).mean(), rel=1e-9)


@given(seeds, st.floats(1e-6, 1e6), st.floats(-1e3, 1e3))
def test_scale_and_offset_of_the_data(seed, factor, offset):
    """A factor counts squared, an offset not at all."""
    data = np.random.default_rng(seed).standard_normal(512)
    one, other = spectrum(data, 10.0), spectrum((data + offset) * factor, 10.0)
    for name in ("density", "low", "high"):
        expected = getattr(one, name)[1:] * factor**2
        assert getattr(other, name)[1:] == pytest.approx(expected, rel=1e-6, abs=1e-9 * float(expected.max()))


@given(seeds, st.floats(1e-3, 1e3))
def test_the_rate_moves_frequencies_and_densities(seed, factor):
    """At a higher rate the same samples have less density over more frequencies."""
    data = np.random.default_rng(seed).standard_normal(512)
    one, other = spectrum(data, 10.0), spectrum(data, 10.0 * factor)
    assert other.frequency == pytest.approx(one.frequency * factor)
    assert other.density == pytest.approx(one.density / factor)
    assert other.edf == pytest.approx(one.edf)
