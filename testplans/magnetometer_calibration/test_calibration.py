"""Calibration of a magnetometer on a rotation table in Helmholtz coils, verified by readings that it has not seen.

One table turns about one axis. The attitudes come from its angles, from the field upwards, which the coils add to the
Earth's across them, and from three mountings by a person: each axis of the board points up once. The thesis whose
campaigns these are had no table: it simulated attitudes at random, and distortions that no board has.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from hil.analysis import (
    calibrate_magnetometer,
    fields_in_board,
    magnetometer_as_c_header,
    magnetometer_as_json,
    magnetometer_from_json,
    magnetometer_reproduction,
    not_observable,
    orientation,
    positive_factor,
    remaining_errors,
    set_apart,
    table_angles,
    widened,
)
from hil.plan import Curve, Refused

UPWARD_AXES = ("z", "x", "y")
DISTORTIONS = ("bias_1", "bias_2", "bias_3", "bias_4", "matrix_1", "matrix_2", "matrix_3", "matrix_4")
"""The sets of Table 3.3, each with the first matrix of Table 3.4; and those of Table 3.4, each with the second bias."""

ARTICLES = ("none", *(f"{model}_{each}" for model in ("magcal", "twostep") for each in DISTORTIONS))
METHODS = {"MAG-CAL-050": "ellipsoid", "MAG-CAL-051": "TWOSTEP"}
ELEMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")
DRAWN = 400
"""Points of a chart: all of some thousands would hide each other."""


@dataclass
class Readings:
    """What was read, and in which field of the board's frame.

    Attributes:
        turning: readings on the turning table (n, 3); these are fitted.
        true: the field of each in the frame of the board.
        resting: means of readings at rest (m, 3), which are not.
        rested: their fields.
        disturbed: by how much each reading at rest differs from the turning ones at the same angle.
        doubts: why they cannot be trusted.
    """

    turning: list[Any] = field(default_factory=list)
    true: list[Any] = field(default_factory=list)
    resting: list[Any] = field(default_factory=list)
    rested: list[Any] = field(default_factory=list)
    disturbed: list[float] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)


class Attitudes:
    """The board in many attitudes: mounted, in fields of the coils, turned and stopped."""

    def __init__(self, cage, rotation, magnetometer, doubts_of_field, record, step, parameters):
        self._cage, self._rotation, self._sensor = cage, rotation, magnetometer.board
        self._doubts_of, self._record, self._step, self._parameters = doubts_of_field, record, step, parameters
        self.readings = Readings()

    def all(self, upward, *, rest):
        """Record every mounting in fields with these components up [uT], between two surveys of the reference."""
        with self._step("Survey the field with the reference"):
            survey = self._cage.survey()
        for up in UPWARD_AXES[: int(self._parameters.mountings)]:
            with self._step(f"Turn about the {up} axis"):
                self._rotation.stop()
                self._cage.mount(up)
                for each in upward:
                    self._one(survey, up, each, rest=rest)
        with self._step("Survey the field again"):
            self._rotation.stop()
            last = self._cage.survey()
        with self._step("Switch coils and sensors off"):
            self._cage.end()
        self._compare(survey, last)
        return self.readings

    def _one(self, survey, up, upward, *, rest):
        found, outside = self.readings, survey.field(self._cage.upward(survey, upward))
        with self._step(f"Record {upward:g} uT upwards"):
            back = self._rotation.table.turns().value > 0.0  # the harness has only so many
            self._rotation.turn(-self._parameters.turn_rate if back else self._parameters.turn_rate)
            before = self._rotation.mark()
            turning = self._record("turning", self._sensor, duration=self._parameters.turn, rate=self._parameters.rate)
            rate = self._rotation.true_rate(before)
            self._rotation.stop()
        angle = table_angles(turning.time, before, rate)
        samples = np.column_stack([turning[axis] for axis in "xyz"])
        found.doubts += [each for each in self._doubts_of(turning) if each not in found.doubts]
        found.turning.append(samples)
        found.true.append(fields_in_board(outside, angle, up))
        if not rest:
            return
        with self._step(f"Record {upward:g} uT upwards at rest"):
            stands, _ = self._rotation.mark()
            resting = self._record("rest", self._sensor, duration=self._parameters.rest, rate=self._parameters.rate)
        mean = np.column_stack([resting[axis] for axis in "xyz"]).mean(axis=0)
        found.resting.append(mean)
        found.rested.append(fields_in_board(outside, stands.value, up)[0])
        found.disturbed.append(float(np.abs(mean - at_angle(samples, angle, stands.value)).max()))

    def _compare(self, first, last):
        """Doubt the readings where the surroundings changed, or the motor of the table disturbed them."""
        steady, still = (self._parameters.in_unit(name, "uT") for name in ("steady", "undisturbed"))
        moved = first.moved(last)
        if not moved <= steady:
            self.readings.doubts.append(
                f"the ambient field at the reference changed by {moved:.3g} uT, where {steady:g} uT"
                " are permitted: look for iron that was brought near"
            )
        most = max(self.readings.disturbed, default=0.0)
        if not most <= still:
            self.readings.doubts.append(
                f"readings change by up to {most:.3g} uT when the table stops, where"
                f" {still:g} uT are permitted: its motor disturbs them"
            )


def at_angle(samples, angle, stands):
    """Return what a recording of a turning board (n, 3) reads at one angle: a constant, a sine and a cosine fit it."""

    def rows(degrees):
        turn = np.radians(np.atleast_1d(degrees))
        return np.column_stack([np.ones(turn.size), np.cos(turn), np.sin(turn)])

    return (rows(stands) @ np.linalg.lstsq(rows(angle), samples, rcond=None)[0])[0]


def whole(readings):
    """Return readings and fields without samples that are no numbers: those at a rail."""
    turning, true = np.concatenate(readings.turning), np.concatenate(readings.true)
    numbers = np.isfinite(turning).all(axis=1)
    return turning[numbers], true[numbers]


def fitted(turning, true, readings, **how):
    """Return the calibration, and everything that speaks against it; None where there is none at all."""
    try:
        report = calibrate_magnetometer(turning, "uT", **how)
    except Refused as refusal:
        return None, [*readings.doubts, str(refusal)]
    return report, [*readings.doubts, *(str(gate) for gate in report.gates if gate.ok is False)]


def draw(report, readings, turning, true, chart):
    """Draw where on the sphere the readings are, and the error of the magnitude before and, below, after."""
    field_of = report.calibration.correct(turning)
    some = slice(None, None, max(1, len(turning) // DRAWN))
    turn, height = report.calibration.directions(turning[some])
    chart(
        "Directions of the calibrated readings",
        Curve(name="readings", x=turn, y=height),
        x=("direction about z", "deg"),
        y=("z of the direction", "1"),
    )
    known = np.linalg.norm(true, axis=1)
    number = np.arange(1.0, len(turning) + 1.0)[some]
    chart(
        "Error of the magnitude",
        Curve(
            name="as read",
            x=number,
            y=(np.linalg.norm(turning, axis=1) - known)[some],
            residual=(np.linalg.norm(field_of, axis=1) - known)[some],
        ),
        x=("reading", "1"),
        y=("error as read", "uT"),
    )


def state(report, doubts, check, parameters):
    """State bias, matrix and noise, and how far the readings show them.

    What the fit says of bias and matrix is the noise of the sensor alone. The field is not known any better than by the
    reference.
    """
    field, relative = parameters.in_unit("field_uncertainty", "uT"), parameters.relative_uncertainty
    check("MAG-CAL-020", "coverage", report.coverage, doubts=doubts, headline="Share of the sphere covered")
    check("MAG-CAL-020", "condition", report.condition, doubts=doubts)
    for axis, figure in report.calibration.biases.items():
        check("MAG-CAL-021", "bias", widened(figure, absolute=field), of=axis, doubts=doubts, at=f"axis {axis}")
    for name, figure in report.calibration.elements.items():
        check("MAG-CAL-021", "matrix", widened(figure, absolute=relative), of=name, doubts=doubts)
    check("MAG-CAL-021", "noise", report.noise, doubts=doubts)


def leave_open(doubts, check):
    """Say of every criterion that the readings do not tell it."""
    check("MAG-CAL-020", "coverage", not_observable("1"), doubts=doubts)
    check("MAG-CAL-020", "condition", not_observable("1"), doubts=doubts)
    for axis in "xyz":
        check("MAG-CAL-021", "bias", not_observable("uT"), of=axis, doubts=doubts)
    for name in ELEMENTS:
        check("MAG-CAL-021", "matrix", not_observable("1"), of=name, doubts=doubts)
    check("MAG-CAL-021", "noise", not_observable("uT"), doubts=doubts)
    verify_nothing(doubts, check)


def verify_nothing(doubts, check):
    """Leave open what only a calibration tells."""
    check("MAG-CAL-022", "export", "no calibration", doubts=doubts)
    for requirement, parameter, unit in (
        ("MAG-CAL-030", "magnitude_error", "uT"),
        ("MAG-CAL-031", "heading_error", "deg"),
        ("MAG-CAL-032", "handedness", "1"),
        ("MAG-CAL-032", "turned", "deg"),
        ("MAG-CAL-033", "raw_magnitude_error", "uT"),
        ("MAG-CAL-033", "raw_heading_error", "deg"),
    ):
        check(requirement, parameter, not_observable(unit), doubts=doubts)


def verify(exported, readings, doubts, check, parameters):
    """Hold the calibration, as it was exported, against readings that did not go into the fit, in known attitudes."""
    resting, rested = np.vstack(readings.resting), np.vstack(readings.rested)
    attitude = parameters.attitude_uncertainty
    field_uncertainty = parameters.in_unit("field_uncertainty", "uT")
    left = remaining_errors(exported, resting, rested, field=field_uncertainty, attitude=attitude)
    headline = "Largest error of the magnitude"
    check("MAG-CAL-030", "magnitude_error", left.magnitude, doubts=doubts, headline=headline)
    check("MAG-CAL-031", "heading_error", left.heading, doubts=doubts, headline="Largest error of the heading")
    check("MAG-CAL-033", "raw_magnitude_error", left.raw_magnitude, doubts=doubts)
    check("MAG-CAL-033", "raw_heading_error", left.raw_heading, doubts=doubts)
    turned = orientation(exported.correct(resting), rested, attitude=attitude)
    check("MAG-CAL-032", "handedness", turned.handedness, doubts=doubts)
    check("MAG-CAL-032", "turned", turned.angle, doubts=doubts)


@pytest.mark.requirement(
    *("MAG-CAL-010", "MAG-CAL-020", "MAG-CAL-021", "MAG-CAL-022", "MAG-CAL-030", "MAG-CAL-031", "MAG-CAL-032"),
    "MAG-CAL-033",
)
@pytest.mark.max_duration(3600)
def test_calibration(cage, rotation, magnetometer, doubts_of_field, record, check, chart, step, artifact, parameters):
    """Bias and matrix of the board as it is, from fields of known magnitude that varies, exported and verified."""
    with step("Take every distortion away"):
        cage.distort("none", ARTICLES)
    attitudes = Attitudes(cage, rotation, magnetometer, doubts_of_field, record, step, parameters)
    readings = attitudes.all(parameters.in_unit("upward", "uT"), rest=True)
    turning, true = whole(readings)
    known = np.linalg.norm(true, axis=1)
    report, doubts = fitted(
        turning, true, readings, field=known, method="likelihood", noise=parameters.in_unit("noise", "uT")
    )
    if report is None or not np.isfinite(np.vstack(readings.resting)).all():
        with step("Leave the calibration open"):
            leave_open(doubts, check)
        return
    with step("State the calibration"):
        state(report, doubts, check, parameters)
    if not report.calibration.observable:
        with step("Leave open what it would have to show"):
            verify_nothing(doubts, check)
        return
    with step("Export the calibration, and recompute the export"):
        text = magnetometer_as_json(report.calibration)
        artifact("calibration.json", text)
        artifact("calibration.h", magnetometer_as_c_header(report.calibration))
        exported = magnetometer_from_json(text)
        told = magnetometer_reproduction(exported, report, turning, known)
        check("MAG-CAL-022", "export", told, doubts=doubts)
        draw(report, readings, turning, true, chart)
    with step("Verify it at rest, in attitudes that it has not seen"):
        verify(exported, readings, doubts, check, parameters)


def put_in(distortion, parameters):
    """Return bias and matrix of a set of Table 3.3 or 3.4."""
    which, number = distortion.split("_")
    bias = parameters.in_unit(distortion if which == "bias" else "bias_2", "uT")
    matrix = getattr(parameters, "matrix_1" if which == "bias" else f"matrix_{number}")
    return np.array(bias), np.reshape(matrix, (3, 3))


def campaign(model, distortion, upward, bench, step, parameters):
    """Return readings and fields of one distortion."""
    cage, rotation, magnetometer, doubts_of_field, record = bench
    with step(f"Put the distortion {model}_{distortion} about the sensor"):
        cage.distort(f"{model}_{distortion}", ARTICLES)
    attitudes = Attitudes(cage, rotation, magnetometer, doubts_of_field, record, step, parameters)
    readings = attitudes.all(upward, rest=False)
    return readings, *whole(readings)


def judge(requirement, distortion, report, doubts, truth, check, parameters):
    """Hold what was found against what was put in."""
    factor, bias = truth
    found = (not_observable("1"),) * 2
    if report is not None:
        found = set_apart(report.calibration, factor, bias, relative=parameters.relative_uncertainty)
    method = METHODS[requirement]
    for parameter, figure in zip(("bias_error", "factor_error"), found, strict=True):
        headline = f"Error of the {parameter.removesuffix('_error')}, {method}"
        check(requirement, parameter, figure, doubts=doubts, at=distortion, headline=headline)


@pytest.mark.requirement("MAG-CAL-050")
@pytest.mark.max_duration(1800)
@pytest.mark.parametrize("distortion", DISTORTIONS)
def test_constant_magnitude(distortion, cage, rotation, magnetometer, doubts_of_field, record, check, step, parameters):
    """The ellipsoid gives bias and inverse positive factor of each published distortion, in one magnitude."""
    bench = (cage, rotation, magnetometer, doubts_of_field, record)
    readings, turning, true = campaign(
        "magcal", distortion, parameters.in_unit("constant_upward", "uT"), bench, step, parameters
    )
    report, doubts = fitted(turning, true, readings, method="ellipsoid", shape="general")
    with step("Compare with what was put in"):
        bias, matrix = put_in(distortion, parameters)
        factor, _ = positive_factor(np.linalg.inv(matrix.T), bias)
        judge("MAG-CAL-050", distortion, report, doubts, (factor, bias), check, parameters)


@pytest.mark.requirement("MAG-CAL-051")
@pytest.mark.max_duration(1800)
@pytest.mark.parametrize("distortion", DISTORTIONS)
def test_varying_magnitude(distortion, cage, rotation, magnetometer, doubts_of_field, record, check, step, parameters):
    """TWOSTEP gives the positive factor of each published distortion, in fields of known magnitude that varies."""
    bench = (cage, rotation, magnetometer, doubts_of_field, record)
    readings, turning, true = campaign(
        "twostep", distortion, parameters.in_unit("upward", "uT"), bench, step, parameters
    )
    report, doubts = fitted(turning, true, readings, field=np.linalg.norm(true, axis=1), method="twostep")
    with step("Compare with what was put in"):
        bias, matrix = put_in(distortion, parameters)
        factor, offset = positive_factor(np.eye(3) + matrix, bias)
        judge("MAG-CAL-051", distortion, report, doubts, (factor, np.linalg.solve(factor, offset)), check, parameters)
