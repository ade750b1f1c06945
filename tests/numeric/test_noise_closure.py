"""Simulated from a published table and analysed, a sensor gives its table back: 21 axes.

The levels are those of a public characterisation of sensors for a CubeSat (rad/s and uT; N, B, K of each axis), without
its quantisation, which no simulated angle has. `python tests/numeric/test_noise_closure.py SEEDS` prints the table of
docs/explanations/simulated-noise.md.
"""

from __future__ import annotations

import sys

import numpy as np
import pytest
import sweeps

from hil.analysis import NoiseLevels, SensorModel, characterise, simulate
from hil.model.figure import FigureStatus

RATE, HOURS = 40.0, 4
SENSORS = {
    "BNO055 gyroscope": (
        (0.0015144, 0.00039819, 1.3132e-7),
        (0.0018760, 7.5660e-5, 5.4495e-7),
        (0.0011311, 1.5180e-5, 1.9297e-7),
    ),
    "LSM9DS1 gyroscope": (
        (0.0033869, 0.00045392, 1.0430e-5),
        (0.0032936, 0.00042520, 1.0454e-5),
        (0.0027094, 0.00031994, 8.1093e-6),
    ),
    "ICM-20948 gyroscope": (
        (0.0021258, 0.00010799, 1.7954e-6),
        (0.0020037, 0.00016730, 4.4752e-6),
        (5.2654e-5, 3.3104e-6, 6.2968e-8),
    ),
    "BMI088 gyroscope": (
        (0.0059126, 0.00041034, 2.0865e-5),
        (0.0059868, 0.00022277, 3.5723e-6),
        (0.0089710, 0.00012293, 8.1563e-5),
    ),
    "BNO055 magnetometer": (
        (1.2057, 0.048810, 0.00063294),
        (1.1557, 0.098254, 0.0016865),
        (0.5924, 0.015409, 0.00018817),
    ),
    "LSM9DS1 magnetometer": (
        (0.27762, 0.15262, 0.0040556),
        (0.33568, 0.16374, 0.0029923),
        (0.394803, 0.24484, 0.018179),
    ),
    "LIS3MDL magnetometer": (
        (0.27599, 0.14688, 0.0021535),
        (0.27017, 0.14360, 0.0040602),
        (0.40829, 0.24637, 0.0065963),
    ),
}
AXES = [
    pytest.param(levels, id=f"{name} {axis}")
    for name, table in SENSORS.items()
    for axis, levels in zip("xyz", table, strict=True)
]


def closed(levels, seed, rate=RATE):
    """Return the coefficients of four simulated hours at rest: N, B, K."""
    model = SensorModel(levels=NoiseLevels(white=levels[0], flicker=levels[1], random_walk=levels[2]), rate=rate)
    found = characterise(simulate(model, round(HOURS * 3600 * rate), seed=seed).values, rate, unit="deg/s")
    return found.white, found.flicker, found.random_walk


def holds(figure, truth):
    """Say whether a coefficient is what was put in: within its interval, or below its bound."""
    if figure.status is FigureStatus.MEASURED:
        return abs(figure.value - truth) <= 3.3 * figure.uncertainty
    return figure.status is FigureStatus.UPPER_LIMIT and truth <= figure.value


@pytest.mark.system
@pytest.mark.parametrize("seed", range(sweeps.chosen(1, 10)))
@pytest.mark.parametrize("levels", AXES)
def test_a_table_comes_back(levels, seed):
    """White noise within 1 %, and all three within what is said of them."""
    found = closed(levels, seed)
    assert found[0].status is FigureStatus.MEASURED
    assert found[0].value == pytest.approx(levels[0], rel=0.01)
    assert [holds(figure, truth) for figure, truth in zip(found, levels, strict=True)] == [True] * 3


def test_half_a_level_does_not_pass():
    """What a simulator with the other convention gives, N over the root of two, is found at once."""
    levels = SENSORS["LSM9DS1 gyroscope"][0]
    found = closed((levels[0] / np.sqrt(2), *levels[1:]), 0, rate=1.0)
    assert not holds(found[0], levels[0])
    assert found[0].value / levels[0] - 1 == pytest.approx(-0.293, abs=0.03)


if __name__ == "__main__":
    for name, table in SENSORS.items():
        away = [closed(levels, seed)[0].value / levels[0] - 1 for levels in table for seed in range(int(sys.argv[1]))]
        print(f"| {name} | {np.mean(away):+.2%} | {np.max(np.abs(away)):.2%} |")  # noqa: T201
