"""What is peculiar to the LIS3MDL, driver against peer; what all sensors share is tested for the family."""

from __future__ import annotations

import math

import pytest
from sensor_bench import LIS3MDL, Bench


def test_samples_come_once_each_at_the_sensors_rate():
    """Two hundred samples at 80 Hz take two and a half seconds, and none comes twice."""
    bench = Bench(LIS3MDL)
    bench.sensor.start()
    began = bench.clock.now()
    samples = [bench.sensor.sample() for _ in range(200)]
    assert bench.clock.now() - began == pytest.approx(199 / 80, abs=0.01)
    assert len({sample[:3] for sample in samples}) > 190


def test_a_wider_range_holds_what_a_narrow_one_cannot():
    """500 uT is beyond 4 gauss though not at a rail, and within 8."""
    truth = {"offset": ["500", "0", "0"], "noise": ["0.02"] * 3}
    for settings, x in (({}, math.nan), ({"range": "8 gauss"}, 500.0)):
        bench = Bench(LIS3MDL, truth=truth, settings=settings)
        bench.sensor.start()
        assert bench.sensor.sample()[0] == pytest.approx(x, abs=0.2, nan_ok=True)
