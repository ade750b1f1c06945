"""Simulated from a published table and analysed, a sensor gives its table back: 21 axes.

The levels are those of a public characterisation of sensors for a CubeSat (rad/s and uT; N, B, K of each axis), without
its quantisation, which no simulated angle has; they are the parameters of the plan `imu_closure`.
`python tests/numeric/test_noise_closure.py SEEDS` prints the table of docs/explanations/simulated-noise.md.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
import pytest
import sweeps
from scipy.signal import lfilter

from hil.analysis import NoiseLevels, SensorModel, characterise, deviation, simulate
from hil.analysis.allan.slopes import nearest_slopes
from hil.bench.file.reading import load_bench
from hil.model.figure import FigureStatus
from hil.requirements.parameters import load_parameters

ROOT = Path(__file__).parents[2]
RATE, HOURS = 40.0, 4


def published():
    """Return white noise, flicker and random walk of each axis, by sensor: the parameters of the plan `imu_closure`."""
    parameters = load_parameters(ROOT, ROOT / "testplans" / "imu_closure").rows()
    tables = {}
    for each in parameters:
        if isinstance(each.value, tuple):
            tables.setdefault(each.text.partition(",")[0], []).append(each.value)
    return {name: tuple(zip(*columns, strict=True)) for name, columns in tables.items()}


SENSORS = published()
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


def test_the_plan_simulates_what_is_printed():
    """Each level of the plan is that of the published table that its text names."""
    with (ROOT / "docs" / "data" / "imu-noise-tables.csv").open(encoding="utf-8", newline="") as stream:
        printed = {(row["table"], row["axis"]): row for row in csv.DictReader(stream)}
    levels = [
        each for each in load_parameters(ROOT, ROOT / "testplans" / "imu_closure").rows() if each.text[-1].isdigit()
    ]
    assert len(levels) == len(SENSORS) * 3 == 21
    for each in levels:
        kind, _, table = each.text.partition(", ")[2].partition(": table ")
        column = {"white noise": "white"}.get(kind, kind)
        assert each.value == tuple(float(printed[table, axis][column]) for axis in "xyz"), each.name


def test_the_magnetometers_of_the_bench_have_the_printed_slow_noise():
    """Flicker and random walk of each first unit; nothing is printed of the AK09916, which has those of the BNO055."""
    bench = load_bench(ROOT / "fixtures/benches", "imu", ROOT)
    truths = {peer.device: peer.truth.get("field_noise") for peer in bench.simulated.peers}
    for device, name in (("bno1", "BNO055"), ("icm1", "BNO055"), ("lsm1", "LSM9DS1"), ("lis1", "LIS3MDL")):
        _, flicker, walk = zip(*SENSORS[f"{name} magnetometer"], strict=True)
        assert tuple(map(float, truths[device]["flicker"])) == flicker
        assert tuple(map(float, truths[device]["random_walk"])) == walk


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


def by_the_published_loop(levels, seed):
    """Return white noise out over in, minus one, of a simulator and a read-out as the published comparison used them.

    At 1 Hz: white noise of N/sqrt(2), bias instability as a first-order process that forgets half in each sample, and
    random walk of sqrt(2) K; read by the tangent of the nearest slope.
    """
    draw = np.random.default_rng(seed)
    count = HOURS * 3600
    white, drift, walk = (level * draw.standard_normal(count) for level in levels)
    record = white / np.sqrt(2) + lfilter([1.0], [1.0, -0.5], drift) + np.cumsum(np.sqrt(2) * walk)
    return nearest_slopes(deviation(record, 1.0, unit="deg/s"))["white"].value / levels[0] - 1.0


@pytest.mark.system
def test_the_published_loop_is_explained():
    """What was printed as 27 % comes out: too low by 29 %, or too high where the short process is strong.

    Of the printed differences only the size is known. One axis differs by 9 %, the others by less than 6 %: where the
    tangent is laid depends on chance.
    """
    with (ROOT / "docs" / "data" / "imu-simulation-tables.csv").open(encoding="utf-8", newline="") as stream:
        printed = [abs(float(row["white"])) for row in csv.DictReader(stream)]
    levels = [each for table in SENSORS.values() for each in table]
    found = np.array([np.median([by_the_published_loop(each, seed) for seed in range(5)]) for each in levels])
    relative = np.array(printed) / [each[0] for each in levels]
    assert np.median(relative) == pytest.approx(0.274, abs=0.001)
    assert sum(np.abs(np.abs(found) - relative) < 0.06) == 20
    assert (found[-6:] > 0.1).all(), "the two magnetometers whose flicker is strong"
    assert (found[:-6] < -0.1).all()


if __name__ == "__main__":
    for name, table in SENSORS.items():
        away = [closed(levels, seed)[0].value / levels[0] - 1 for levels in table for seed in range(int(sys.argv[1]))]
        print(f"| {name} | {np.mean(away):+.2%} | {np.max(np.abs(away)):.2%} |")  # noqa: T201
