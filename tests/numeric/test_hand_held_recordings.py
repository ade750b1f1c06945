"""Recordings as people make them by hand, against least squares and a robust distance fit of scipy.

A hand tumbles the sensor without a plan: attitudes crowd together, some come in bursts, iron is near at the beginning,
a twentieth of the readings is wrong, and the magnitude of the field is not known.
"""

from __future__ import annotations

import json
from types import MappingProxyType

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.optimize import least_squares

from hil.analysis.magnetometer.calibrate import calibrate_magnetometer
from hil.cli.commands.analyse import command

FIELD = 47.3  # uT
BIAS = np.array([-21.4, 35.2, 8.9])
GAIN = np.array([[1.08, 0.03, -0.02], [0.03, 0.93, 0.04], [-0.02, 0.04, 1.01]])
NOISE = 0.35
COUNT = 900
DISTURBED, OUTLIERS = 25, 45
UNITS = MappingProxyType({"uT": 1.0, "nT": 1e3, "mT": 1e-3, "gauss": 1e-2, "mgauss": 10.0, "LSB": 6.842})


def tumbled(generator, count):
    """Directions of a hand that turns about axes that wander, at rates that come in bursts."""
    attitude, spin, found = np.eye(3), generator.standard_normal(3), []
    for _ in range(count):
        spin = 0.9 * spin + 0.5 * generator.standard_normal(3)
        rate = spin * (0.12 if generator.random() < 0.8 else 0.45)
        angle = np.linalg.norm(rate)
        axis = rate / angle
        cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        attitude = attitude @ (np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)
        found.append(attitude[0])
    return np.array(found)


def recorded(seed, *, outliers=OUTLIERS):
    """Readings in uT, and which of them are wrong by far."""
    generator = np.random.default_rng(seed)
    readings = FIELD * tumbled(generator, COUNT) @ np.linalg.inv(GAIN) + BIAS
    readings += NOISE * generator.standard_normal((COUNT, 3))
    near = 30.0 * np.exp(-np.arange(DISTURBED) / 12.0)
    readings[:DISTURBED] += near[:, None] * [0.8, -0.4, 0.5]
    wrong = generator.choice(np.arange(DISTURBED, COUNT), outliers, replace=False)
    readings[wrong] += generator.choice([-1.0, 1.0], (outliers, 3)) * generator.uniform(6.0, 60.0, (outliers, 3))
    return readings, wrong


def direct_ellipsoid(readings):
    """Bias and A of determinant 1 by plain least squares of ten coefficients, as `magcal` and the tools of its kind."""
    centre, size = readings.mean(axis=0), readings.std()
    x, y, z = ((readings - centre) / size).T
    rows = np.stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z, 2 * x, 2 * y, 2 * z], axis=1)
    a, b, c, d, e, f, *slope = np.linalg.lstsq(rows, np.ones(len(rows)), rcond=None)[0]
    quadric = np.array([[a, d, e], [d, b, f], [e, f, c]])
    middle = -np.linalg.solve(quadric, slope)
    return middle * size + centre, normalised(quadric)


def normalised(quadric):
    """The positive root of determinant 1."""
    values, vectors = np.linalg.eigh(quadric * np.sign(np.trace(quadric)))
    matrix = (vectors * np.sqrt(values)) @ vectors.T
    return matrix / np.cbrt(np.linalg.det(matrix))


def robust_distances(readings):
    """Bias and A by a robust fit of distances to the ellipsoid, started where the direct fit is."""
    bias, matrix = direct_ellipsoid(readings)
    radius = np.median(np.linalg.norm((readings - bias) @ matrix, axis=1))
    upper = np.triu_indices(3)

    def unpacked(theta):
        gain = np.zeros((3, 3))
        gain[upper] = theta[3:]
        return theta[:3], gain + gain.T - np.diag(np.diag(gain))

    def distances(theta):
        centre, gain = unpacked(theta)
        field = (readings - centre) @ gain
        length = np.linalg.norm(field, axis=1)
        return (length - 1.0) * length / np.linalg.norm(field @ gain, axis=1)

    start = np.concatenate([bias, (matrix / radius)[upper]])
    scale = np.concatenate([np.full(3, radius), np.full(6, 0.1 / radius)])
    found = least_squares(distances, start, loss="cauchy", f_scale=2.0 * NOISE, x_scale=scale)
    centre, gain = unpacked(found.x)
    return centre, gain / np.cbrt(np.linalg.det(gain))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_ellipsoid_agrees_with_what_established_methods_give(seed):
    """On clean readings with plain least squares, and on dirty ones with a robust fit of distances."""
    clean, _ = recorded(seed, outliers=0)
    clean = clean[DISTURBED:]
    found = calibrate_magnetometer(clean, "uT", shape="general").calibration
    bias, matrix = direct_ellipsoid(clean)
    assert found.bias == pytest.approx(bias, abs=0.15)
    assert np.array(found.matrix) == pytest.approx(matrix, abs=5e-3)
    readings, wrong = recorded(seed)
    report = calibrate_magnetometer(readings, "uT", shape="general")
    bias, matrix = robust_distances(readings)
    assert report.conclusive, [str(gate) for gate in report.gates if not gate.ok]
    assert report.calibration.bias == pytest.approx(bias, abs=0.15)
    assert np.array(report.calibration.matrix) == pytest.approx(matrix, abs=5e-3)
    assert report.calibration.bias == pytest.approx(BIAS, abs=0.25)
    assert len(set(wrong) - set(report.outliers)) <= 3  # what moved along the ellipsoid, nobody sees
    assert np.mean(np.subtract(direct_ellipsoid(readings)[0], BIAS) ** 2) > 4.0 * np.mean(
        np.subtract(report.calibration.bias, BIAS) ** 2
    ), "a fit that keeps outliers is worse"


@pytest.mark.parametrize("unit", UNITS)
def test_files_of_any_unit_and_form(tmp_path, unit):
    """With header lines, semicolons and decimal commas; the bias in any unit is the same."""
    readings, _ = recorded(1)
    table = tmp_path / "hand.csv"
    lines = ["# logger 3.2", "# recorded by hand, outdoors", "time;mx;my;mz"]
    cells = UNITS[unit] * readings
    lines += [";".join(f"{each:.9g}" for each in (0.02 * place, *row)) for place, row in enumerate(cells)]
    table.write_text("\n".join(lines).replace(".", ",") + "\n", encoding="utf-8")
    scaled = ("--scale", str(1 / UNITS[unit]), "--scaled-unit", "uT") if unit == "LSB" else ()
    asked = ("magnetometer", str(table), "--columns", "mx,my,mz", "--unit", unit, *scaled, "--json")
    ran = CliRunner().invoke(command, asked, standalone_mode=False, catch_exceptions=False)
    document = json.loads(ran.stdout)
    each = 1.0 if scaled else UNITS[unit]
    assert document["status"] == "conclusive", document["reasons"]
    plain = calibrate_magnetometer(readings, "uT").calibration
    for axis, value in zip("xyz", plain.bias, strict=True):
        assert document["bias"][axis]["value"] / each == pytest.approx(value, abs=1e-3)
        assert document["bias"][axis]["unit"] == ("uT" if scaled else unit)
