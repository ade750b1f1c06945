"""The magnetometer jig before a campaign: is its sensor fed, quiet and plausible?"""

from __future__ import annotations

import pytest

from hil.analysis import magnitude, standard_deviation
from hil.plan import Figure


def static(recording, axis):
    """Return the mean of an axis with what the certificate says: its noise is judged for itself."""
    return Figure(value=recording[axis].mean(), unit=recording.unit(axis), uncertainty=recording.uncertainty(axis))


@pytest.mark.requirement("JIG-MAG-010")
@pytest.mark.max_duration(60)
def test_sensor_supply(supply, field, check, step):
    """The magnetometer is fed as its data sheet asks."""
    with step("Measure the sensor's supply"):
        check("JIG-MAG-010", "voltage", supply.sensor.voltage(), headline="Supply of the sensor")
        check("JIG-MAG-010", "current", supply.sensor.current(), headline="Current of the sensor")


@pytest.mark.requirement("JIG-MAG-020", "JIG-MAG-030")
@pytest.mark.max_duration(60)
def test_background(field, record, check, step, parameters):
    """Without a coil current the jig shows the Earth's field, quietly."""
    with step("Record the background"):
        background = record("background", field, duration=parameters.duration, rate=parameters.rate)
    for axis in "xyz":
        noise = standard_deviation(background[axis], background.unit(axis))
        check("JIG-MAG-020", "noise", noise, of=axis, at=f"axis {axis}", headline="Noise")
    found = magnitude([static(background, axis) for axis in "xyz"])
    check("JIG-MAG-020", "magnitude", found, headline="Field without a coil current")
