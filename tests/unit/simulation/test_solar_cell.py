"""A solar panel under a lamp: its curve, what a load takes of it, what the light warms, and what can be wrong."""

from __future__ import annotations

import math

import pytest

from hil.simulation.plants.solar_cell import build
from hil.simulation.truth import Truth, TruthError

SECOND = 10**9


def panel(seconds=600, **truth):
    """Return a panel whose lamp was lit for so long."""
    told = {key: value if isinstance(value, bool) else str(value) for key, value in truth.items()}
    made = build("panel", SECOND // 2, Truth(told, ()))
    made.command(given=24.0, limit=2.5)
    made.advance(seconds * SECOND)
    return made


def point(made, mode, level):
    """Return voltage and current with a load."""
    made.command(mode=mode, level=level)
    return made.observe("load.voltage"), made.observe("load.current")


@pytest.mark.parametrize(
    ("mode", "level"), [("", 0.0), ("CV", 2.0), ("CV", 2.5), ("CR", 6.0), ("CC", 0.2), ("CP", 0.3)]
)
def test_every_point_obeys_the_equation(mode, level):
    """Current and voltage fulfil the implicit equation of one diode; and the load has what it asked for."""
    made = panel()
    volts, amperes = point(made, mode, level)
    kelvin, light = made.observe("temperature") + 273.15, made.observe("irradiance")
    thermal = 3.6 * 8.617333262e-5 * kelvin
    grown = (kelvin / 301.15) ** 2.5 * math.exp(4.2 / thermal * (kelvin / 301.15 - 1))
    saturation = 0.4 / math.expm1(2.7 / (thermal / kelvin * 301.15)) * grown
    inner = volts + 0.12 * amperes
    expected = (
        (0.4 + 2.4e-4 * (kelvin - 301.15)) * light / 1367 - inner / 900 - saturation * math.expm1(inner / thermal)
    )
    assert amperes == pytest.approx(expected, abs=2e-7)
    told = {"": amperes, "CV": volts, "CR": volts / amperes if amperes else 0.0, "CC": amperes, "CP": volts * amperes}
    assert told[mode] == pytest.approx(level, rel=1e-3, abs=1e-6)


def test_a_load_comes_as_near_to_short_circuit_as_its_leads_let_it():
    """At 0 V asked for, what is left is the drop over leads and the wide-open load."""
    volts, amperes = point(panel(leads=0.2, least=0.05), "CV", 0.0)
    assert volts == pytest.approx(0.25 * amperes, rel=1e-6)


def test_light_warms_both_cells_and_falls_with_time():
    """Towards the room plus the rise in its share of the light."""
    made = panel(1800, droop=0.1)
    share = made.observe("irradiance") / 1290
    assert share == pytest.approx(1 - 0.1 / 2, abs=2e-3)
    assert made.observe("temperature") == pytest.approx(22 + 17 * share, abs=0.1)
    assert made.observe("reference.temperature") == pytest.approx(22 + 9 * share, abs=0.1)
    expected = 2e-5 * made.observe("irradiance") * (1 + 5e-4 * (made.observe("reference.temperature") - 25))
    assert made.observe("reference.current") == pytest.approx(expected, rel=1e-9)


def test_a_cold_filament_takes_the_limit_and_then_its_power():
    """At first the supply limits; warm, the lamp is a resistor of 12 ohm; without contact it is dark."""
    made = build("panel", SECOND // 20, Truth({}, ()))
    made.command(given=24.0, limit=2.5)
    assert (made.observe("current"), made.observe("voltage")) == pytest.approx((2.5, 3.0))
    made.advance(20 * SECOND)
    assert (made.observe("current"), made.observe("voltage")) == pytest.approx((2.0, 24.0), rel=1e-6)
    made.command(contact=False)
    made.advance(40 * SECOND)
    assert made.observe("current") == 0.0
    assert made.observe("irradiance") == pytest.approx(0.4)


def test_what_can_be_wrong_with_panel_and_reference():
    """Half of the strings give half of the current; reversed leads both signs; a shade hides light from one cell."""
    whole = point(panel(), "CV", 0.0)[1]
    assert point(panel(broken=1), "CV", 0.0)[1] == pytest.approx(whole / 2, rel=1e-3)
    volts, amperes = point(panel(reversed=True), "CV", 0.0)
    assert volts < -0.6
    assert amperes < -0.9 * whole
    assert panel(shade=0.1).observe("reference.current") == pytest.approx(0.9 * panel().observe("reference.current"))
    with pytest.raises(TruthError, match="less than the number of strings"):
        panel(broken=2)
