"""Noise of the gyroscope at rest: what averaging can do, and what it costs."""

from __future__ import annotations

import pytest

from hil.analysis import sampling
from hil.analysis.allan import averaging
from hil.analysis.allan.noise import characterise
from hil.analysis.quality.gate import Facts
from hil.analysis.quality.recording import tripped
from hil.model.figure import Figure

AXES = "xyz"


def doubts_of(recording, gyroscope, parameters):
    """Return why a recording at rest cannot be trusted, a sentence for every gate that tripped."""
    facts = Facts(
        rate=recording.rate,
        lsb=gyroscope.resolution().value,
        full_scale=gyroscope.full_scale().value,
        bandwidth=gyroscope.bandwidth().value,
        noise_density=parameters.in_unit("noise_density", "deg/s/sqrt(Hz)"),
        temperature="temperature",
    )
    channels = {name: recording[name] for name in (*AXES, "temperature")}
    return [str(gate) for gate in tripped(recording.time, channels, facts)]


@pytest.mark.requirement(
    "ADCS-GYR-010", "ADCS-GYR-011", "ADCS-GYR-012", "ADCS-GYR-013", "ADCS-GYR-014", "ADCS-GYR-015"
)
@pytest.mark.max_duration(24000)
def test_noise_at_rest(chamber, rotation, rate_sensor, record, check, step, parameters):
    """Allan deviation of every axis over four hours at rest, and the averaging that follows from it."""
    with step("Hold the resting board at room temperature"):
        rotation.stop()
        chamber.hold(parameters.rest_temperature)
        chamber.soak(parameters.soak, within=parameters.longest_soak, own=lambda: rate_sensor.temperature().value)
    with step("Record the gyroscope at rest"):
        rest = record("rest", rate_sensor, duration=parameters.rest_duration, rate=parameters.rate)
    with step("Look at the record before anything is concluded from it"):
        doubts = doubts_of(rest, rate_sensor, parameters)
        check("ADCS-GYR-015", "lost_frames", rest.stream.lost)
        drift = Figure(value=rest.stream.drift, unit="1", uncertainty=rest.stream.drift_uncertainty)
        check("ADCS-GYR-015", "clock_drift", drift)
    rate = sampling.assess(rest.time).rate
    queue = averaging.MovingAverage(samples=int(parameters.queue), rate=rate)
    check("ADCS-GYR-013", "delay", Figure(value=queue.delay, unit="s"))
    for axis in AXES:
        with step(f"Characterise axis {axis}"):
            model = characterise(rest[axis], rate, rest.unit(axis), tau_min=parameters.shortest_average)
            check("ADCS-GYR-011", "angle_random_walk", model.white, of=axis, doubts=doubts)
            check("ADCS-GYR-012", "bias_instability", model.flicker, of=axis, doubts=doubts)
            check("ADCS-GYR-013", "noise", Figure(value=queue.noise(model.curve), unit="deg/s"), of=axis, doubts=doubts)
            check("ADCS-GYR-014", "averaging_time", model.averaging_window, of=axis, doubts=doubts)
