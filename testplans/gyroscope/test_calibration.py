"""Calibration of the gyroscope over temperature, exported, recomputed, and verified at rates that it has not seen."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.analysis import (
    Slow,
    as_c_header,
    as_json,
    assess,
    calibrate,
    from_json,
    not_observable,
    reading,
    reproduction,
    rest_mean,
    rippling,
    widened,
)
from hil.plan import Curve, Refused

AXES = "xyz"
REFERENCE = 25.0
MARGIN = 2.0
"""How far [K] beyond the temperatures of the calibration a reading may lie: soak does not repeat better."""


class Board:
    """The board at a temperature and on its table: brought there, recorded, and read with what is left in doubt.

    Attributes:
        doubts: why recordings cannot be trusted, of all so far.
    """

    def __init__(self, chamber, rotation, rate_sensor, doubts_of, record, step, parameters):
        self._chamber, self._rotation, self._sensor = chamber, rotation, rate_sensor
        self._doubts_of, self._record, self._step, self._parameters = doubts_of, record, step, parameters
        _, self._begun = rotation.mark()
        self._mounted = ""
        self.doubts = []

    def mount(self, axis):
        """Mount the board with an axis along that of the table."""
        self._rotation.mount(axis)
        self._mounted = axis

    def settle(self, target):
        """Bring the board to a temperature [degC] and wait until it has settled there."""
        with self._step(f"Soak at {target:g} degC"):
            self._chamber.hold(target)
            self._chamber.soak(self._parameters.soak, within=self._parameters.longest_soak, own=self._own)

    def rest(self):
        """Record the resting board."""
        with self._step("Record at rest"):
            self._rotation.stop()
            recording = self._recorded("static", self._parameters.static_duration)
        return self._read(recording)

    def turn(self, axis, rate):
        """Record the board turning at a rate [deg/s]; return its reading, and the true rate of the table's encoder."""
        with self._step(f"Turn at {rate:g} deg/s"):
            self._rotation.turn(rate)
            before = self._rotation.mark()
            recording = self._recorded("turning", self._parameters.turning_duration)
            true = self._rotation.true_rate(before)
            self._rotation.stop()
        return self._read(recording, {axis: true}), true

    def _recorded(self, name, duration):
        return self._record(name, self._sensor, duration=duration, rate=self._parameters.rate)

    def _read(self, recording, rates=None):
        """Return the means of a recording, with the temperature that the sensor itself told."""
        self._chamber.must_have_held(self._own)
        self.doubts += self._doubts_of(recording)
        _, now = self._rotation.mark()
        rate, at = assess(recording.time).rate, (now - self._begun).value
        turning = sum(each.value for each in (rates or {}).values())
        samples = {axis: recording[axis] for axis in AXES}
        if turning:
            samples = {axis: each - rippling(each, rate, turning) for axis, each in samples.items()}
        means = {axis: rest_mean(samples[axis], rate, recording.unit(axis)) for axis in AXES}
        return reading(recording["temperature"].mean(), means, rates, at=at, mounting=self._mounted)

    def _own(self):
        return self._sensor.temperature().value


def slow_of(parameters):
    """Return what no record of a minute shows: the Earth's rate, of unknown direction, and a bias that wanders."""
    return Slow(
        earth=parameters.earth_rate / math.sqrt(3.0),
        flicker=parameters.bias_instability,
        random_walk=parameters.bias_random_walk,
    )


def error_of(found, axis, measured, true, parameters):
    """Return by how much the calibrated rate is off [deg/s], when the sensor has just been started.

    The calibration is what is judged, so its own uncertainty is not part of the error's. That of the reading is, with
    the Earth's rate, and with how far the bias has wandered since the start; and that of the table's rate.
    """
    unseen = slow_of(parameters).uncertainty(measured.at)
    means = {name: widened(mean, absolute=unseen) for name, mean in measured.means.items()}
    return found.as_it_is().figures(means, measured.temperature)[axis] - true


def draw_bias(report, chart):
    """Draw the bias of every axis over temperature with its fit, and what the fit leaves."""
    for axis in AXES:
        fit = report.bias[axis]
        across = np.linspace(fit.polynomial.low, fit.polynomial.high, 21)
        chart(
            "Bias over temperature",
            Curve(
                name=f"axis {axis}",
                x=fit.temperature,
                y=fit.value,
                model=(across, fit.polynomial.at(across)),
                residual=fit.residual,
            ),
            x=("temperature", "degC"),
            y=("bias", "deg/s"),
            lines="the polynomials that were fitted",
        )


def conclude(readings, verification, spread, doubts, check, chart, step, artifact, parameters):
    """Fit the calibration, export it, and hold it against what it has not seen.

    Args:
        readings: from which it is fitted.
        verification: axis, reading and true rate, which are not.
        spread: relative standard uncertainty of the table's rates.
        doubts: why recordings cannot be trusted.
    """
    report = calibrate(
        readings,
        reference=REFERENCE,
        rate_uncertainty=spread,
        slow=slow_of(parameters),
        mounting_uncertainty=parameters.mounting,
        margin=MARGIN,
    )
    found = report.calibration
    with step("Export the calibration, and recompute the export"):
        artifact("calibration.json", as_json(found))
        artifact("calibration.h", as_c_header(found))
        check("ADCS-GYR-022", "export", reproduction(from_json(as_json(found)), report))
        draw_bias(report, chart)
    for axis in AXES:
        with step(f"State the calibration of axis {axis}"):
            told = f"axis {axis}, {REFERENCE:g} degC"
            degree = report.bias[axis].polynomial.degree
            check("ADCS-GYR-021", "bias", found.axes[axis].bias.figure(REFERENCE), of=axis, doubts=doubts, at=told)
            check("ADCS-GYR-021", "bias_degree", degree, of=axis, doubts=doubts, at=f"axis {axis}")
            check("ADCS-GYR-021", "scale", found.axes[axis].scale.figure(REFERENCE), of=axis, doubts=doubts, at=told)
    for axis, measured, true in verification:
        told = f"axis {axis}, {true.value:.1f} deg/s, {measured.temperature:.1f} degC"
        with step(f"Verify {told}"):
            error = error_of(found, axis, measured, true, parameters)
            check("ADCS-GYR-030", "rate_error", error, of=axis, doubts=doubts, at=told, headline="Error of the rate")


def leave_open(doubts, check, step):
    """Say of every criterion that recordings in doubt do not tell it."""
    with step("Leave the calibration open"):
        check("ADCS-GYR-022", "export", "no calibration", doubts=doubts)
        for axis in AXES:
            check("ADCS-GYR-021", "bias", not_observable("deg/s"), of=axis, doubts=doubts)
            check("ADCS-GYR-021", "bias_degree", not_observable("1"), of=axis, doubts=doubts)
            check("ADCS-GYR-021", "scale", not_observable("1"), of=axis, doubts=doubts)
            check("ADCS-GYR-030", "rate_error", not_observable("deg/s"), of=axis, doubts=doubts)


@pytest.mark.requirement("ADCS-GYR-020", "ADCS-GYR-021", "ADCS-GYR-022", "ADCS-GYR-030")
@pytest.mark.max_duration(80000)
@pytest.mark.repeatable("the table sets rate and temperature again, and reading a sensor does not change it")
def test_calibration(chamber, rotation, rate_sensor, doubts_of, record, check, chart, step, artifact, parameters):
    """Bias, scale and alignment over temperature from four temperatures and three axes, verified at other rates."""
    board = Board(chamber, rotation, rate_sensor, doubts_of, record, step, parameters)
    readings, verification, spreads = [], [], []
    for axis in "zyx":
        with step(f"Turn about the {axis} axis"):
            board.mount(axis)
            for target in parameters.temperatures if axis == "z" else parameters.other_temperatures:
                board.settle(target)
                readings.append(board.rest())
                if target in parameters.scale_temperatures:
                    for sign in (+1, -1):
                        turned, true = board.turn(axis, sign * parameters.calibration_rate)
                        readings.append(turned)
                        spreads.append(abs(true.uncertainty / true.value))
                verification += [(axis, *board.turn(axis, rate)) for rate in parameters.verification_rates]
    with step("Bring the board back to room temperature"):
        chamber.hold(REFERENCE)
    try:
        conclude(readings, verification, max(spreads), board.doubts, check, chart, step, artifact, parameters)
    except Refused as refusal:  # means that are no numbers, or a temperature that cannot be
        if not board.doubts:
            raise
        leave_open([*board.doubts, str(refusal)], check, step)
