"""What holds for the drift of every record: units, shifts and the direction of time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.analysis.drift import drift_of

TIME = np.arange(400.0)
TEMPERATURE = np.where(TIME < 200, 25 + 30 * (1 - np.exp(-TIME / 60)), 25 + 29 * np.exp(-(TIME - 200) / 60))

records = st.integers(0, 10_000).map(lambda seed: np.random.default_rng(seed).normal(0, 0.1, TIME.size).cumsum() / 10)
factors = st.floats(0.01, 100) | st.floats(-100, -0.01)


@settings(max_examples=3)
@given(records, factors, st.floats(-0.1, 0.1), st.floats(-10, 10))
def test_scaled_and_sloped_values_scale_and_slope_the_figures(values, factor, slope, shift):
    """Values times a factor, with a line over the temperature: noise is scaled, and the line is found whole."""
    plain = drift_of(TIME, TEMPERATURE, values, "uT")
    changed = drift_of(TIME, TEMPERATURE, factor * values + shift + slope * (TEMPERATURE - 25.0), "uT")
    assert changed.slope.value == pytest.approx(factor * plain.slope.value + slope, abs=1e-9)
    assert changed.offset.value == pytest.approx(factor * plain.offset.value + shift, abs=1e-8)
    assert changed.hysteresis.value == pytest.approx(factor * plain.hysteresis.value, abs=1e-8)
    for name in ("slope", "offset", "hysteresis"):
        one, other = getattr(plain, name).uncertainty, getattr(changed, name).uncertainty
        assert other == pytest.approx(abs(factor) * one, rel=1e-3)


@settings(max_examples=3)
@given(records)
def test_backwards_in_time_the_loop_turns_the_other_way(values):
    """Slope and offset stay, hysteresis and drift over time change their signs; only the edges of bins differ."""
    there = drift_of(TIME, TEMPERATURE, values, "uT")
    back = drift_of(TIME, TEMPERATURE[::-1], values[::-1], "uT")
    for name, sign in (("slope", 1), ("offset", 1), ("hysteresis", -1), ("per_hour", -1)):
        one, other = getattr(there, name), getattr(back, name)
        assert abs(other.value - sign * one.value) < 0.2 * one.uncertainty
