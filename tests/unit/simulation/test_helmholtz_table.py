"""A magnetometer on a table in coils: which field it sees, in whose frame, and what disturbs it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.analysis.magnetometer.attitudes import fields_in_board
from hil.simulation.plants.helmholtz_table import MODEL, per_ampere
from hil.simulation.truth import Truth, TruthError

SECOND = 1_000_000_000
TRUTH = {
    "turns": "50",
    "radius": "0.2",
    "resistance": "6.4",
    "ambient_field": ["21.0", "-3.0", "-39.0"],
    "articles": {"twice": {"soft": ["2", "0", "0", "0", "1", "0", "0", "0", "1"], "hard": ["1", "2", "3"]}},
}


def plant(**truth):
    """A plant whose truth differs by these."""
    return MODEL.build("cage", SECOND, Truth({**TRUTH, **truth}, ("plants", "cage", "truth")))


def seen(plant, group="field"):
    """The three axes of a group now."""
    return [plant.observe(f"{group}.{axis}") for axis in "xyz"]


def test_the_constant_of_the_pair():
    """(4/5)^1.5 mu0 N / R where the planes are a radius apart."""
    expected = 0.8**1.5 * 4e-7 * math.pi * 50 / 0.2 * 1e6
    assert per_ampere(50, 0.2, 0.2) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("up", "xyz")
def test_the_field_turns_in_the_frame_of_the_board(up):
    """As the analysis says it does, for each mounting and at any angle of the table."""
    table = plant()
    table.command(mounting=up, rate_command=30.0, acceleration=1000.0)
    table.advance(7 * SECOND)
    angle = table.observe("angle")
    assert angle == pytest.approx(209.55, abs=0.01)
    assert seen(table) == pytest.approx(fields_in_board([21.0, -3.0, -39.0], [angle], up)[0], abs=1e-9)
    assert seen(table, "reference") == [21.0, -3.0, -39.0]


@pytest.mark.parametrize(
    ("contacts", "winding", "sign"),
    [
        ((False, False), "right", 1),
        ((True, True), "right", -1),
        ((True, False), "right", 0),
        ((False, False), "left", -1),
    ],
)
def test_current_and_polarity(contacts, winding, sign):
    """The supply limits the current; relays and winding decide where the field points; one contact alone shorts it."""
    table = plant(winding=winding)
    table.command(supply_voltage=5.0, supply_current=0.1, contact_a=contacts[0], contact_b=contacts[1])
    assert table.observe("current") == pytest.approx(0.1 * abs(sign))
    assert table.observe("voltage") == pytest.approx(0.64 if sign else 5.0)
    assert seen(table)[2] == pytest.approx(-39.0 + sign * 0.1 * per_ampere(50, 0.2, 0.2))
    table.command(supply_voltage=0.32, supply_current=0.1)
    assert table.observe("current") == pytest.approx(0.05 * abs(sign))


def test_what_distorts_and_disturbs():
    """An article, an open winding, the motor while it drives, and iron from its time on."""
    table = plant(broken=True, motor_field=["0", "0", "5"], iron=["4", "0", "0"], iron_from="10")
    table.command(supply_voltage=5.0, supply_current=0.1, article="twice")
    assert table.observe("current") == 0.0
    assert seen(table) == pytest.approx([43.0, -1.0, -36.0])
    table.command(article="", rate_command=36.0, acceleration=1e9)
    assert seen(table)[2] == pytest.approx(-34.0)
    table.command(rate_command=0.0)
    table.advance(10 * SECOND)
    assert np.hypot(*seen(table)[:2]) == pytest.approx(math.hypot(25.0, 3.0))
    assert seen(table, "reference") == pytest.approx([23.0, -3.0, -39.0])
    assert table.choices("article") == ("", "twice")


def test_the_sensors_are_fed():
    """Below their least voltage they draw nothing; a limit below what they draw lets the voltage collapse."""
    table = plant()
    table.command(sensor_power_voltage=3.3, sensor_power_current=0.02)
    assert table.observe("sensor_power.current") == 8e-4
    table.command(sensor_power_current=1e-4)
    assert table.observe("sensor_power.voltage") == 0.0
    table.command(sensor_power_voltage=1.0)
    assert (table.observe("sensor_power.voltage"), table.observe("sensor_power.current")) == (1.0, 0.0)


def test_an_unknown_article_is_refused():
    """With the nearest."""
    with pytest.raises(TruthError, match="unknown article 'twize', did you mean 'twice'"):
        plant(article="twize")
