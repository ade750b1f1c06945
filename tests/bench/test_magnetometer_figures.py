"""What a calibration of a magnetometer costs, against the linear algebra that no method can do without."""

from __future__ import annotations

import time

import numpy as np
import pytest

from hil.analysis.magnetometer.calibrate import METHODS, calibrate_magnetometer

SAMPLES = 10_000
GENERATOR = np.random.default_rng(1)
DIRECTIONS = GENERATOR.standard_normal((SAMPLES, 3))
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]
MAGNITUDES = GENERATOR.uniform(25.0, 50.0, SAMPLES)
NOISE = 0.3 * GENERATOR.standard_normal((SAMPLES, 3))


@pytest.mark.parametrize("method", METHODS)
def test_ten_thousand_samples(pair, method):
    """At most the processor time of a hundred singular value decompositions of as many rows of ten: 50 ms or so."""
    field = 45.0 if method == "ellipsoid" else MAGNITUDES
    readings = np.broadcast_to(field, SAMPLES)[:, None] * DIRECTIONS + [12.0, -30.0, 8.0] + NOISE
    rows = np.hstack([readings, np.square(readings), readings * np.roll(readings, 1, axis=1), np.ones((SAMPLES, 1))])

    def ours():
        report = calibrate_magnetometer(readings, "uT", field=None if method == "ellipsoid" else field, method=method)
        assert report.conclusive

    what = f"{method} of 10,000 samples, and one decomposition"
    assert pair(what, ours, lambda: np.linalg.svd(rows, full_matrices=False), clock=time.process_time) < 100
