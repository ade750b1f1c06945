"""What known attitudes show: fields on a table, orientation, what was put in, and what is left."""

from __future__ import annotations

import numpy as np
import pytest

from hil.analysis.magnetometer.attitudes import (
    coil_survey,
    fields_in_board,
    orientation,
    positive_factor,
    remaining_errors,
    set_apart,
    table_angles,
)
from hil.analysis.magnetometer.calibrate import calibrate_magnetometer
from hil.model.errors import Refused
from hil.model.figure import Figure, FigureStatus

GENERATOR = np.random.default_rng(3)
FIELDS = np.vstack(
    [fields_in_board([21.0, -3.0, up], np.arange(0.0, 360.0, 6.0), axis) for axis in "xyz" for up in (-30.0, 5.0, 30.0)]
)
GAIN = np.array([[1.1, 0.05, 0.0], [0.05, 0.9, 0.1], [0.0, 0.1, 1.0]])
BIAS = np.array([5.0, -6.0, 7.0])
READINGS = FIELDS @ np.linalg.inv(GAIN) + BIAS + 0.05 * GENERATOR.standard_normal(FIELDS.shape)
FOUND = calibrate_magnetometer(READINGS, "uT", field=np.linalg.norm(FIELDS, axis=1), shape="general").calibration


def turn(axis, degrees):
    """A rotation about an axis."""
    place = "xyz".index(axis)
    first, second = (place + 1) % 3, (place + 2) % 3
    matrix, angle = np.eye(3), np.radians(degrees)
    matrix[[first, second], [first, second]] = np.cos(angle)
    matrix[first, second], matrix[second, first] = -np.sin(angle), np.sin(angle)
    return matrix


def test_fields_in_the_frame_of_a_board():
    """A quarter turn counter-clockwise brings what lay along 90 deg of the table to the front, whatever points up."""
    assert fields_in_board([1.0, 2.0, 3.0], 90.0, "z")[0] == pytest.approx([2.0, -1.0, 3.0])
    assert fields_in_board([1.0, 2.0, 3.0], 0.0, "x")[0] == pytest.approx([3.0, 1.0, 2.0])
    assert fields_in_board([1.0, 2.0, 3.0], 0.0, "y")[0] == pytest.approx([2.0, 3.0, 1.0])
    with pytest.raises(Refused, match="no axis of a board"):
        fields_in_board([1.0, 2.0, 3.0], 0.0, "w")


@pytest.mark.parametrize(
    ("distortion", "handedness", "angle"),
    [
        (np.eye(3), 1.0, 0.0),
        (turn("y", 20.0), 1.0, 20.0),
        (np.eye(3)[[1, 0, 2]], -1.0, None),
        (np.diag([1.0, 1.0, -1.0]), -1.0, None),
        (np.diag([1.0, -1.0, -1.0]), 1.0, 180.0),
    ],
)
def test_swapped_and_turned_axes_are_seen(distortion, handedness, angle):
    """Magnitudes do not show them; known attitudes do."""
    found = orientation(FIELDS @ distortion.T, FIELDS, attitude=0.4)
    assert found.matrix == pytest.approx(distortion, abs=1e-9)
    assert found.handedness.value == handedness
    assert angle is None or found.angle.value == pytest.approx(angle, abs=1e-4)
    assert found.angle.uncertainty == pytest.approx(0.4)
    assert found.left.value < 1e-4
    with pytest.raises(Refused, match="show no orientation"):
        orientation(FIELDS[:1].repeat(4, axis=0), FIELDS[:1].repeat(4, axis=0))


def test_what_is_left_after_calibration():
    """Small errors of magnitude and heading where uncalibrated readings are off by far."""
    left = remaining_errors(FOUND, READINGS[::9], FIELDS[::9], field=0.1, attitude=0.4)
    assert abs(left.magnitude.value) < 0.3
    assert abs(left.raw_magnitude.value) > 5.0
    assert left.heading.value < 0.6
    assert left.raw_heading.value > 10.0
    assert (left.magnitude.uncertainty, left.heading.uncertainty) == (0.1, 0.4)
    cone = calibrate_magnetometer(READINGS[:30], "uT", field=np.linalg.norm(FIELDS[:30], axis=1)).calibration
    nothing = remaining_errors(cone, READINGS, FIELDS, field=0.1, attitude=0.4)
    assert nothing.heading.status is FigureStatus.NOT_OBSERVABLE
    assert set_apart(cone, GAIN, BIAS, relative=0.0)[0].status is FigureStatus.NOT_OBSERVABLE


def test_what_was_put_in_comes_back():
    """Within its uncertainty; a factor that is 3 % off in one direction shows as 3 %."""
    bias, factor = set_apart(FOUND, GAIN, BIAS, relative=0.0)
    assert bias.value < 4.0 * bias.uncertainty < 0.01
    assert factor.value < 4.0 * factor.uncertainty < 0.01
    values, vectors = np.linalg.eigh(GAIN)
    other = (vectors * (values * [1.0, 1.03, 1.0])) @ vectors.T
    assert set_apart(FOUND, other, BIAS, relative=0.0)[1].value == pytest.approx(0.03, abs=0.003)
    factor, offset = positive_factor(turn("x", 50.0) @ GAIN, turn("x", 50.0) @ GAIN @ BIAS)
    assert factor == pytest.approx(GAIN, abs=1e-12)
    assert np.linalg.solve(factor, offset) == pytest.approx(BIAS, abs=1e-12)
    with pytest.raises(Refused, match="no field along some direction"):
        positive_factor(np.diag([1.0, 1.0, 0.0]), BIAS)


def test_a_survey_tells_ambient_and_coils():
    """Half of the difference of both directions over the current; the drift of the surroundings is no part of it."""
    ambient, coils = np.array([21.0, -3.0, -39.0]), np.array([1.0, -0.5, 225.0])
    times = np.arange(6.0).reshape(2, 3)
    recorded = [
        [(ambient + sign * 0.25 * coils + 0.01 * times[row, place])[np.newaxis].repeat(5, axis=0) for row in (0, 1)]
        for place, sign in enumerate((1, 0, -1))
    ]
    current = Figure(value=0.25, unit="A", uncertainty=0.001)
    found = coil_survey(*recorded, times=times, currents=[current] * 4)
    assert found.per_ampere == pytest.approx(coils, abs=1e-9)
    assert found.constant.value == pytest.approx(225.0)
    assert found.constant.uncertainty == pytest.approx(0.9, rel=0.1)
    assert found.constant.unit == "uT/A"
    assert found.field(Figure(value=-0.1, unit="A")) == pytest.approx(ambient + 0.025 - 0.1 * coils, abs=1e-9)
    assert found.moved(found) == 0.0


def test_an_ambient_field_is_the_mean_of_all_phases():
    """Its noise is that of all readings: of those without current alone it would be 1.7 times larger."""
    generator, ambient, coils = np.random.default_rng(5), np.array([21.0, -3.0, -39.0]), np.array([1.0, -0.7, 225.0])
    current, errors = Figure(value=0.25, unit="A", uncertainty=0.001), []
    for _ in range(300):
        phases = [
            [ambient + sign * 0.25 * coils + 0.4 * generator.standard_normal((40, 3)) for _ in range(2)]
            for sign in (1, 0, -1)
        ]
        found = coil_survey(*phases, times=[[0.0, 2.0, 4.0], [6.0, 8.0, 10.0]], currents=[current] * 4)
        errors.append(found.ambient - ambient)
    assert np.std(errors) == pytest.approx(0.4 / np.sqrt(240.0), rel=0.1)
    assert np.abs(np.mean(errors, axis=0)).max() < 0.006


def test_angles_of_a_steady_table():
    """From one mark and the rate."""
    mark = (Figure(value=10.0, unit="deg"), Figure(value=2.0, unit="s"))
    assert table_angles([2.0, 3.0], mark, Figure(value=60.0, unit="deg/s")) == pytest.approx([10.0, 70.0])
