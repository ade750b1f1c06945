"""What a calibration of a magnetometer keeps: turned frames, other units, other orders of the samples."""

from __future__ import annotations

import numpy as np
import pytest
import sweeps
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.analysis.magnetometer.calibrate import METHODS, calibrate_magnetometer

COUNT = 60
DIRECTIONS = np.random.default_rng(1).standard_normal((COUNT, 3))
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]
MAGNITUDES = np.random.default_rng(2).uniform(25.0, 50.0, COUNT)
NOISE = 0.2 * np.random.default_rng(3).standard_normal((COUNT, 3))
GAIN = np.array([[1.1, 0.05, -0.02], [0.05, 0.9, 0.03], [-0.02, 0.03, 1.0]])


def calibrated(readings, field, method):
    """Bias, matrix and outliers."""
    known = None if method == "ellipsoid" else field
    report = calibrate_magnetometer(readings, "uT", field=known, method=method, shape="general")
    return np.array(report.calibration.bias), np.array(report.calibration.matrix), report


def recorded(method):
    """Readings and magnitudes; constant ones for the ellipsoid."""
    field = np.full(COUNT, 45.0) if method == "ellipsoid" else MAGNITUDES
    return (field[:, None] * DIRECTIONS) @ np.linalg.inv(GAIN) + [10.0, -20.0, 30.0] + NOISE, field


@pytest.mark.parametrize("method", METHODS)
@settings(max_examples=sweeps.examples(20))
@given(seed=st.integers(0, 10_000), unit=st.floats(1e-6, 1e6))
def test_frames_units_and_orders(method, seed, unit):
    """Readings in a turned frame, another unit and another order give the turned bias and matrix, in that unit."""
    generator = np.random.default_rng(seed)
    turn = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    order = generator.permutation(COUNT)
    readings, field = recorded(method)
    bias, matrix, report = calibrated(readings, field, method)
    other_bias, other, other_report = calibrated(unit * (readings @ turn.T)[order], unit * field[order], method)
    assert other_bias / unit == pytest.approx(turn @ bias, abs=2e-4)
    assert other == pytest.approx(turn @ matrix @ turn.T, abs=2e-5)
    assert {int(order[place]) for place in other_report.outliers} == set(report.outliers)
    assert other_report.noise.value / unit == pytest.approx(report.noise.value, rel=1e-4)
