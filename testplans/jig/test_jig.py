"""The magnetometer jig before a campaign: is its sensor fed, quiet and plausible?"""

from __future__ import annotations

import numpy as np
import pytest

from hil.analysis import mean
from hil.plan import Figure


@pytest.mark.requirement("JIG-MAG-010")
@pytest.mark.max_duration(60)
def test_sensor_supply(supply, field, check, step):
    """The magnetometer is fed as its data sheet asks."""
    with step("Measure the sensor's supply"):
        check("JIG-MAG-010", "voltage", supply.sensor.voltage())
        check("JIG-MAG-010", "current", supply.sensor.current())


@pytest.mark.requirement("JIG-MAG-020", "JIG-MAG-030")
@pytest.mark.max_duration(60)
def test_background(field, record, check, step, parameters):
    """Without a coil current the jig shows the Earth's field, quietly."""
    with step("Record the background"):
        background = record("background", field, duration=parameters.duration, rate=parameters.rate)
    means = {axis: mean(background[axis], background.unit(axis)) for axis in "xyz"}
    for axis in "xyz":
        samples = background[axis]
        # Standard uncertainty of a standard deviation of n samples: s / sqrt(2 (n - 1)).
        noise = float(np.std(samples, ddof=1))
        uncertainty = noise / np.sqrt(2 * (len(samples) - 1))
        figure = Figure(value=noise, unit=background.unit(axis), uncertainty=uncertainty, dof=len(samples) - 1)
        check("JIG-MAG-020", "noise", figure, of=axis)
    vector = np.array([means[axis].value for axis in "xyz"])
    systematic = np.array([background.uncertainty(axis) for axis in "xyz"])
    magnitude = float(np.linalg.norm(vector))
    figure = Figure(value=magnitude, unit="uT", uncertainty=float(np.linalg.norm(vector / magnitude * systematic)))
    check("JIG-MAG-020", "magnitude", figure)
