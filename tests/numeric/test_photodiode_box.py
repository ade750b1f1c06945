"""The simulated black box: its photodiode solves the circuit as SciPy does, and it warms as one heat capacity."""

from __future__ import annotations

import math

import pytest
from photodiode_readings import solved

from hil.simulation.plants.photodiode_box import BoxTruth, PhotodiodeBox

SECOND = 1_000_000_000
LOAD, MIDDLE, LOW = 20e3, 1 / (1 / 20e3 + 1 / 8.2e3), 1 / (1 / 20e3 + 1 / 3.3e3)


def box(**truth):
    """Return a box with its lamp on, after ten minutes."""
    made = PhotodiodeBox("box", SECOND, BoxTruth(**{"droop": 0.0, **truth}))
    made.command(lamp=True)
    made.advance(600 * SECOND)
    return made


@pytest.mark.parametrize(("contacts", "ohms"), [({}, LOAD), ({"middle": True}, MIDDLE), ({"low": True}, LOW)])
@pytest.mark.parametrize("ambient", [-10.0, 13.0, 40.0])
def test_the_reading_is_that_of_the_circuit(contacts, ohms, ambient):
    """At every load and temperature, with shunt and series resistance."""
    made = box(ambient=ambient, shunt=1e6, series=60.0)
    made.command(**contacts)
    wanted = solved(1.0, made.observe("junction"), ohms, shunt=1e-6, series=60.0)
    assert made.observe("photodiode") == pytest.approx(float(wanted), rel=1e-9)


def test_the_box_warms_as_one_heat_capacity():
    """10 W against 1 W/K with 1500 J/K; the thermometer is behind the junction, and both are behind the box."""
    made = box()
    assert made.observe("box") == pytest.approx(13.0 + 10.0 * (1.0 - math.exp(-600.0 / 1500.0)), abs=1e-9)
    lags = [made.observe("box") - made.observe(name) for name in ("junction", "temperature")]
    slope = 10.0 / 1500.0 * math.exp(-600.0 / 1500.0)
    assert lags == pytest.approx([8.0 * slope, 12.0 * slope], rel=0.1)


@pytest.mark.parametrize(
    ("truth", "photodiode", "monitor"),
    [
        ({"lamp": 0.0}, 0.0, 0.0),
        ({"state": "shorted"}, 0.0, 1.6),
        ({"state": "open"}, 0.0, 1.6),
        ({"droop": 0.6}, None, 1.6 * 0.9),
    ],
)
def test_what_is_wrong_shows(truth, photodiode, monitor):
    """Ten minutes of a lamp that loses 60 % per hour are 10 %."""
    made = box(**truth)
    assert made.observe("monitor") == pytest.approx(monitor, rel=1e-6)
    if photodiode is not None:
        assert made.observe("photodiode") == photodiode


def test_light_leaks_into_the_dark():
    """With the lamp off the photodiode sees what comes through the lid, and the monitor does not."""
    made = PhotodiodeBox("box", SECOND, BoxTruth(leak=0.06, offset=273.15))
    assert made.observe("photodiode") == pytest.approx(
        float(solved(0.06, 13.0, LOAD, shunt=1e-8, series=20.0)), rel=1e-9
    )
    assert (made.observe("monitor"), made.observe("temperature")) == (0.0, pytest.approx(286.15))
