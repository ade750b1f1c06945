"""Transients of whatever waveform: shifts, scales and parts."""

from __future__ import annotations

import numpy as np
import pytest
import sweeps
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hil.analysis import charge, crossing, peak, time_above, time_below

WAVES = st.lists(st.floats(-10, 10).map(lambda value: round(value, 3)), min_size=4, max_size=40)


@settings(max_examples=sweeps.examples(300))
@given(WAVES, st.floats(-9, 9).map(lambda level: round(level, 3) + 0.0005), st.floats(-5, 5), st.floats(0.1, 10))
@example([0.0, 0.0, 0.0, 0.0, 0.0, 5.0, 1.0, 0.0], 4.0005, 0.0, 1.0)  # falls farther than it ever rose
def test_shifted_and_scaled(values, level, shift, gain):
    """Time above and below add up to the capture; nothing but a crossing depends on where zero is; gains cancel."""
    time, signal = np.arange(len(values)) * 0.5, np.array(values)
    above, below = time_above(time, signal, level), time_below(time, signal, level)
    assert above.value + below.value == pytest.approx(time[-1])
    assert time_above(time + shift, gain * signal, gain * level).value == pytest.approx(above.value)
    found, later = crossing(time, signal, level), crossing(time + shift, gain * signal, gain * level)
    assert found.status is later.status
    assert later.value == pytest.approx(found.value + shift, nan_ok=True)
    assert peak(time, gain * signal, "A").status is peak(time, signal, "A").status


@settings(max_examples=sweeps.examples(200))
@given(WAVES, st.floats(0.1, 10))
def test_charge_is_linear_and_additive(values, gain):
    """Twice the current is twice the charge, and two parts make the whole."""
    time, signal = np.arange(len(values)) * 0.5, np.array(values)
    whole = charge(time, signal, "A", baseline=0.0).value
    assert charge(time, gain * signal, "A", baseline=0.0).value == pytest.approx(gain * whole, abs=1e-9)
    until = float(time[len(time) // 2])
    first = charge(time, signal, "A", baseline=0.0, until=until).value
    rest = np.trapezoid(signal[time >= until], time[time >= until])
    assert first + rest == pytest.approx(whole, abs=1e-9)
