"""Noise of the gyroscope at rest: what averaging can do, and what it costs."""

from __future__ import annotations

import numpy as np
import pytest

from hil.analysis import MovingAverage, assess, characterise, not_observable, observed
from hil.plan import Figure

AXES = "xyz"


def figures_of(samples, rate, unit, queue, parameters):
    """Return what the requirements ask of an axis, by requirement and parameter.

    Nothing is concluded from a record in which samples are no numbers: they were at a rail, or marked invalid.
    """
    if not np.isfinite(samples).all():
        noise = window = white = flicker = None
    else:
        model = characterise(samples, rate, unit, tau_min=parameters.shortest_average)
        white, flicker, window = model.white, model.flicker, model.averaging_window
        noise = Figure(value=queue.noise(model.curve), unit=unit)
    return {
        ("ADCS-GYR-011", "angle_random_walk"): white or not_observable(f"{unit}/sqrt(Hz)"),
        ("ADCS-GYR-012", "bias_instability"): flicker or not_observable(unit),
        ("ADCS-GYR-013", "noise"): noise or not_observable(unit),
        ("ADCS-GYR-014", "averaging_time"): window or not_observable("s"),
    }


@pytest.mark.requirement("ADCS-GYR-010", "ADCS-GYR-011", "ADCS-GYR-012", "ADCS-GYR-013", "ADCS-GYR-014", "ADCS-GYR-015")
@pytest.mark.max_duration(24000)
@pytest.mark.repeatable(
    "a sensor at rest is the same before and after an interruption, and the gap is not judged as data"
)
def test_noise_at_rest(chamber, rotation, rate_sensor, doubts_of, record, check, step, parameters):
    """Allan deviation of every axis over four hours at rest, and the averaging that follows from it."""

    def own():
        return rate_sensor.temperature().value

    with step("Hold the resting board at room temperature"):
        rotation.stop()
        chamber.hold(parameters.rest_temperature)
        chamber.soak(parameters.soak, within=parameters.longest_soak, own=own)
    with step("Record the gyroscope at rest"):
        rest = record("rest", rate_sensor, duration=parameters.rest_duration, rate=parameters.rate)
        chamber.must_have_held(own)
    with step("Look at the record before anything is concluded from it"):
        doubts = doubts_of(rest, parameters.in_unit("noise_density", "deg/s/sqrt(Hz)"))
        check("ADCS-GYR-015", "lost_frames", rest.stream.lost)
        check("ADCS-GYR-015", "clock_drift", observed(rest.stream.drift, "1", rest.stream.drift_uncertainty))
    rate = assess(rest.time).rate
    queue = MovingAverage(samples=int(parameters.queue), rate=rate)
    check("ADCS-GYR-013", "delay", Figure(value=queue.delay, unit="s"))
    for axis in AXES:
        with step(f"Characterise axis {axis}"):
            found = figures_of(rest[axis], rate, rest.unit(axis), queue, parameters)
            for (requirement, parameter), figure in found.items():
                check(requirement, parameter, figure, of=axis, doubts=doubts)
