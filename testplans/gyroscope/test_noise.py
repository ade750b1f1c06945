"""Noise of the gyroscope at rest: what averaging can do, and what it costs."""

from __future__ import annotations

import numpy as np
import pytest

from hil.analysis import MovingAverage, agreement, assess, characterise, not_observable, observed, psd
from hil.plan import Curve, Figure

AXES = "xyz"


HEADLINES = {
    "angle_random_walk": "Angle random walk",
    "bias_instability": "Bias instability",
    "noise": "Noise after averaging",
}
"""What the first page of the report calls a parameter."""


def model_of(samples, rate, unit, bandwidth):
    """Return the noise of an axis; None of a record in which samples are no numbers: nothing is concluded from it.

    They were at a rail, or marked invalid. Averages that a filter of this bandwidth [Hz] bends are not fitted.
    """
    whole = np.isfinite(samples).all()
    return characterise(samples, rate, unit, bandwidth=bandwidth) if whole else None


def figures_of(model, unit, queue):
    """Return what the requirements ask of an axis, by requirement and parameter."""
    if model is None:
        noise = window = white = flicker = None
    else:
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
def test_noise_at_rest(chamber, rotation, rate_sensor, doubts_of, record, check, chart, step, parameters):
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
    rate, bandwidth = assess(rest.time).rate, rate_sensor.bandwidth().value
    queue = MovingAverage(samples=int(parameters.queue), rate=rate)
    check("ADCS-GYR-013", "delay", Figure(value=queue.delay, unit="s"))
    for axis in AXES:
        with step(f"Characterise axis {axis}"):
            unit = rest.unit(axis)
            model = model_of(rest[axis], rate, unit, bandwidth)
            disagreements = ()
            if model is not None:
                disagreements = agreement(psd(rest[axis], rate, unit), model).doubts()
                chart(
                    "Allan deviation at rest",
                    Curve(name=f"axis {axis}", x=model.curve.tau, y=model.curve.figures, model=model.line),
                    x=("averaging time", "s"),
                    y=("Allan deviation", unit),
                    log=True,
                    limit=("ADCS-GYR-011", "angle_random_walk"),
                    limit_power=-0.5,
                )
            for (requirement, parameter), figure in figures_of(model, unit, queue).items():
                headline = HEADLINES.get(parameter, "")
                told = [*doubts, *disagreements]
                check(requirement, parameter, figure, of=axis, doubts=told, at=f"axis {axis}", headline=headline)
