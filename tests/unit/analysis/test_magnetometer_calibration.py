"""What a calibration of a magnetometer says of itself: shapes, gates, what it refuses, and what it exports."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from hil.analysis.magnetometer.calibrate import calibrate_magnetometer
from hil.analysis.magnetometer.interchange import (
    magnetometer_as_c_header,
    magnetometer_as_json,
    magnetometer_from_json,
    sample_disagreement,
)
from hil.model.errors import Refused
from hil.model.figure import FigureStatus

GENERATOR = np.random.default_rng(7)
DIRECTIONS = GENERATOR.standard_normal((120, 3))
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]
NOISE = 0.1 * GENERATOR.standard_normal((120, 3))
GENERAL = np.array([[1.1, 0.05, 0.0], [0.05, 0.9, 0.1], [0.0, 0.1, 1.0]])
READINGS = 48.0 * DIRECTIONS @ np.linalg.inv(GENERAL) + [5.0, 6.0, 7.0] + NOISE
REPORT = calibrate_magnetometer(READINGS, "uT", field=48.0)


@pytest.mark.parametrize(
    ("shape", "gain"), [("sphere", 1.2 * np.eye(3)), ("aligned", np.diag([1.2, 1.0, 0.8])), ("general", GENERAL)]
)
@pytest.mark.parametrize("known", [False, True])
def test_the_evidence_chooses_the_shape(shape, gain, known):
    """The simplest that fits; what it does not have is exactly none, and certain."""
    readings = 48.0 * DIRECTIONS @ np.linalg.inv(gain) + NOISE
    report = calibrate_magnetometer(readings, "uT", field=48.0 if known else None)
    assert (report.calibration.shape, report.conclusive) == (shape, True)
    assert report.calibration.method == ("likelihood" if known else "ellipsoid")
    if shape != "general":
        assert report.calibration.elements["xy"].value == 0.0
        assert report.calibration.elements["xy"].uncertainty == 0.0
    if shape == "sphere" and not known:
        assert report.calibration.elements["xx"].uncertainty == 0.0  # of determinant 1 there is only one


def test_a_known_magnitude_gives_the_scale():
    """Without it the matrix has determinant 1, and the field is a result."""
    relative = calibrate_magnetometer(READINGS, "uT", method="likelihood").calibration
    scale = np.linalg.det(GENERAL) ** (1.0 / 3.0)
    assert np.linalg.det(relative.matrix) == pytest.approx(1.0, abs=1e-9)
    assert relative.expected_field.value == pytest.approx(48.0 / scale, abs=0.05)
    assert 0.0 < relative.expected_field.uncertainty < 0.02
    assert (relative.absolute, REPORT.calibration.absolute) == (False, True)
    assert REPORT.calibration.expected_field.uncertainty == 0.0
    assert np.array(REPORT.calibration.matrix) == pytest.approx(GENERAL, abs=0.003)
    assert "rotation" in REPORT.identifiability


def test_readings_in_one_plane_show_nothing():
    """No ellipsoid at all: a report with that reason, and no number."""
    flat = READINGS * [1.0, 1.0, 0.0]
    report = calibrate_magnetometer(flat, "uT")
    assert [gate.name for gate in report.gates] == ["ellipsoid"]
    assert not report.conclusive
    assert {figure.status for figure in report.calibration.biases.values()} == {FigureStatus.NOT_OBSERVABLE}
    with pytest.raises(Refused, match="do not show this calibration"):
        magnetometer_as_json(report.calibration)


def test_a_field_that_varies_is_no_constant_one():
    """The ellipsoid's residuals are then no noise of a sensor."""
    field = np.linspace(25.0, 50.0, 120)
    report = calibrate_magnetometer(field[:, None] * DIRECTIONS + NOISE, "uT")
    assert [gate.name for gate in report.gates if not gate.ok] == ["scatter"]


@pytest.mark.parametrize(
    ("given", "options", "told"),
    [
        (READINGS[:, :2], {}, r"shape \(120, 2\)"),
        (READINGS[:12], {}, None),
        (READINGS[:9], {}, "9 readings are fewer than the 10"),
        (READINGS, {"method": "twostep"}, "needs the magnitude"),
        (READINGS, {"method": "twostep", "field": 48.0, "shape": "sphere"}, "general matrix only"),
        (READINGS, {"method": "magcal"}, "no method magcal"),
        (READINGS, {"field": [48.0, 47.0]}, "one magnitude for each"),
        (READINGS, {"field": -48.0}, "not above zero"),
        (READINGS, {"noise": 0.0}, "noise of 0"),
        (READINGS, {"temperature": [20.0]}, "1 temperatures for 120"),
        (READINGS, {"temperature": np.full(120, 300.0)}, "no number of degC"),
        (READINGS * math.nan, {}, "not a finite number"),
    ],
)
def test_what_is_refused(given, options, told):
    """Errors say what is missing."""
    if told is None:
        assert len(calibrate_magnetometer(given, "uT", **options).residual) == 12
        return
    with pytest.raises(Refused, match=told):
        calibrate_magnetometer(given, "uT", **options)


def test_the_export_gives_back_the_samples():
    """Through JSON and back every residual is the same; a changed number is seen."""
    text = magnetometer_as_json(REPORT.calibration)
    found = magnetometer_from_json(text)
    assert not sample_disagreement(found, REPORT, READINGS, 48.0)
    moved = replace(found, bias=(found.bias[0] + 0.01, *found.bias[1:]))
    assert "differs from it by" in sample_disagreement(moved, REPORT, READINGS, 48.0)
    assert found.biases["x"].uncertainty == pytest.approx(REPORT.calibration.biases["x"].uncertainty)
    with pytest.raises(Refused, match="changed after it was exported"):
        magnetometer_from_json(text.replace('"general"', '"sphere"'))
    document = json.loads(text)
    assert document["unit"] == "uT"
    assert "positive-definite" in document["identifiability"]


def test_directions_are_those_of_the_calibrated_field():
    """Along x, y and -z once bias and matrix are taken off."""
    calibration = REPORT.calibration
    axes = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
    readings = axes @ np.linalg.inv(np.array(calibration.matrix)).T * 30.0 + np.array(calibration.bias)
    turn, height = calibration.directions(readings)
    assert turn[:2] == pytest.approx([0.0, 90.0], abs=1e-6)
    assert height == pytest.approx([0.0, 0.0, -1.0], abs=1e-9)


def test_a_stated_noise_is_used_and_held_against_the_residuals():
    """Uncertainties follow from it; residuals that are far larger trip the gate."""
    calm = calibrate_magnetometer(READINGS, "uT", field=48.0, noise=0.2)
    assert calm.calibration.biases["x"].dof == math.inf
    assert calm.calibration.biases["x"].uncertainty > 1.7 * REPORT.calibration.biases["x"].uncertainty
    assert calm.noise.value == REPORT.noise.value
    loud = calibrate_magnetometer(READINGS, "uT", field=48.0, noise=0.03)
    assert [gate.name for gate in loud.gates if not gate.ok] == ["noise"]
    assert loud.calibration.biases["x"].uncertainty == REPORT.calibration.biases["x"].uncertainty


def test_temperatures_tag_or_slope():
    """Over less than five kelvin the calibration is tagged; over more it has a slope, that its exports carry."""
    steady = calibrate_magnetometer(READINGS, "uT", field=48.0, temperature=np.linspace(24.0, 26.0, 120)).calibration
    assert (steady.warmth.low, steady.warmth.high, steady.drifts) == (24.0, 26.0, {})
    assert steady.bias == REPORT.calibration.bias
    degrees = np.linspace(0.0, 40.0, 120)
    warm = calibrate_magnetometer(READINGS + 0.1 * degrees[:, None], "uT", field=48.0, temperature=degrees)
    again = magnetometer_from_json(magnetometer_as_json(warm.calibration))
    assert again.warmth.drift == pytest.approx((0.1, 0.1, 0.1), abs=0.005)
    assert not sample_disagreement(again, warm, READINGS + 0.1 * degrees[:, None], 48.0, degrees)
    assert sample_disagreement(again, warm, READINGS + 0.1 * degrees[:, None], 48.0)
    header = magnetometer_as_c_header(warm.calibration)
    assert "magnetometer_drift[3]" in header
    assert "#define MAGNETOMETER_REFERENCE_TEMPERATURE 20" in header
    assert magnetometer_from_json(magnetometer_as_json(steady)).warmth == steady.warmth


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_the_header_computes_what_python_computes(tmp_path):
    """Compiled C gives the fields of Python."""
    (tmp_path / "calibration.h").write_text(magnetometer_as_c_header(REPORT.calibration))
    (tmp_path / "main.c").write_text(
        """#include <stdio.h>
        #include "calibration.h"
        int main(void) {
            const double measured[3] = {10.0, -20.0, 30.0};
            for (int i = 0; i < 3; i++) {
                double field = 0.0;
                for (int j = 0; j < 3; j++)
                    field += magnetometer_matrix[i][j] * (measured[j] - magnetometer_bias[j]);
                printf("%.9f ", field);
            }
            printf("%s %.9f", MAGNETOMETER_UNIT, MAGNETOMETER_FIELD);
            return 0;
        }"""
    )
    program = tmp_path / "program"
    subprocess.run(["cc", "-std=c99", "-Wall", "-Werror", "-o", program, tmp_path / "main.c"], check=True)
    told = subprocess.run([program], check=True, capture_output=True, text=True).stdout.split()
    assert [float(each) for each in told[:3]] == pytest.approx(
        REPORT.calibration.correct([[10.0, -20.0, 30.0]])[0], abs=1e-6
    )
    assert told[3:] == ["uT", "48.000000000"]
