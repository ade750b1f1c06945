"""Calibration of the gyroscope over temperature, exported, recomputed, and verified at rates that it has not seen."""

from __future__ import annotations

import math

import pytest

from hil.analysis import sampling
from hil.analysis.allan.rest import rest_mean
from hil.analysis.gyroscope.c_header import as_c_header
from hil.analysis.gyroscope.calibrate import calibrate
from hil.analysis.gyroscope.interchange import as_json, from_json
from hil.analysis.gyroscope.readings import Reading
from hil.analysis.gyroscope.self_check import export_disagreements
from hil.analysis.quality.gate import Facts
from hil.analysis.quality.recording import tripped
from hil.model.figure import Figure

AXES = "xyz"
REFERENCE = 25.0
MARGIN = 2.0
"""How far [K] beyond the temperatures of the calibration a reading may lie: soak does not repeat better."""


def settled(chamber, rate_sensor, step, parameters, target):
    """Bring the board to a temperature [degC] and wait until it has settled there."""
    with step(f"Soak at {target:g} degC"):
        chamber.hold(target)
        chamber.soak(parameters.soak, within=parameters.longest_soak, own=lambda: rate_sensor.temperature().value)


def reading_of(recording, parameters, rates=None):
    """Return the means of a recording, with the temperature that the sensor itself told.

    What no record of a minute shows is shared by all its samples: the Earth's rate, whose direction on the board
    nobody measures (uniform within its size), and that a bias comes back to its value only so well.
    """
    rate = sampling.assess(recording.time).rate
    systematic = math.hypot(parameters.earth_rate / math.sqrt(3.0), parameters.repeatability)
    means = {axis: rest_mean(recording[axis], rate, recording.unit(axis), systematic=systematic) for axis in AXES}
    return Reading(temperature=float(recording["temperature"].mean()), means=means, rates=rates or {})


def doubts_of(recording, rate_sensor):
    """Return why a recording cannot be trusted, a sentence for every gate that tripped."""
    facts = Facts(
        rate=recording.rate,
        lsb=rate_sensor.resolution().value,
        full_scale=rate_sensor.full_scale().value,
        bandwidth=rate_sensor.bandwidth().value,
        temperature="temperature",
    )
    channels = {name: recording[name] for name in (*AXES, "temperature")}
    lost = [f"{recording.stream.lost} frames were lost"] if recording.stream.lost else []
    return [*lost, *(str(gate) for gate in tripped(recording.time, channels, facts))]


def at_rest(rotation, rate_sensor, record, step, parameters):
    """Record the resting board."""
    with step("Record at rest"):
        rotation.stop()
        return record("static", rate_sensor, duration=parameters.static_duration, rate=parameters.rate)


def turning(rotation, rate_sensor, record, step, parameters, rate):
    """Record the turning board; return the recording and the true rate of the table's encoder."""
    with step(f"Turn at {rate:g} deg/s"):
        rotation.turn(rate)
        before = rotation.mark()
        recording = record("turning", rate_sensor, duration=parameters.turning_duration, rate=parameters.rate)
        true = rotation.true_rate(before)
        rotation.stop()
    return recording, true


@pytest.mark.requirement("ADCS-GYR-020", "ADCS-GYR-021", "ADCS-GYR-022", "ADCS-GYR-030")
@pytest.mark.max_duration(80000)
def test_calibration(chamber, rotation, rate_sensor, record, check, step, artifact, parameters):
    """Bias, scale and alignment over temperature from four temperatures and three axes, verified at other rates."""
    readings, verification, doubts, spreads = [], [], [], []
    for axis in "zyx":
        with step(f"Turn about the {axis} axis"):
            rotation.mount(axis)
            for target in parameters.temperatures if axis == "z" else parameters.other_temperatures:
                settled(chamber, rate_sensor, step, parameters, target)
                resting = at_rest(rotation, rate_sensor, record, step, parameters)
                doubts += doubts_of(resting, rate_sensor)
                readings.append(reading_of(resting, parameters))
                if target in parameters.scale_temperatures:
                    for sign in (+1, -1):
                        rate = sign * parameters.calibration_rate
                        recording, true = turning(rotation, rate_sensor, record, step, parameters, rate)
                        doubts += doubts_of(recording, rate_sensor)
                        readings.append(reading_of(recording, parameters, {axis: true.value}))
                        spreads.append(abs(true.uncertainty / true.value))
                for rate in parameters.verification_rates:
                    recording, true = turning(rotation, rate_sensor, record, step, parameters, rate)
                    doubts += doubts_of(recording, rate_sensor)
                    verification.append((axis, reading_of(recording, parameters), true))
    with step("Bring the board back to room temperature"):
        chamber.hold(REFERENCE)

    report = calibrate(readings, reference=REFERENCE, rate_uncertainty=max(spreads), margin=MARGIN)
    found = report.calibration
    with step("Export the calibration, and recompute the export"):
        artifact("calibration.json", as_json(found))
        artifact("calibration.h", as_c_header(found))
        rejected = export_disagreements(from_json(as_json(found)), report)
        check("ADCS-GYR-022", "export", "; ".join(map(str, rejected)) or "reproduced")
    for axis in AXES:
        with step(f"State the calibration of axis {axis}"):
            check("ADCS-GYR-021", "bias", found.axes[axis].bias.figure(REFERENCE), of=axis, doubts=doubts)
            check("ADCS-GYR-021", "bias_degree", len(report.bias[axis].polynomial.coefficients) - 1, of=axis, doubts=doubts)
            check("ADCS-GYR-021", "scale", found.axes[axis].scale.figure(REFERENCE), of=axis, doubts=doubts)
    for axis, measured, true in verification:
        with step(f"Verify axis {axis} at {true.value:.1f} deg/s and {measured.temperature:.1f} degC"):
            corrected = found.figures(measured.means, measured.temperature)[axis]
            error = Figure(
                value=corrected.value - true.value,
                unit="deg/s",
                uncertainty=math.hypot(corrected.uncertainty, true.uncertainty),
            )
            check("ADCS-GYR-030", "rate_error", error, of=axis, doubts=doubts)
