"""A heated plate: what its foil draws, how it warms, and when its thermostat looks."""

from __future__ import annotations

from math import exp

import pytest

from hil.simulation.plants.heated_plate import build
from hil.simulation.truth import Truth, TruthError

SECOND = 10**9


def plate(**truth):
    """Return a plate at the epoch."""
    return build("plate", SECOND // 10, Truth({key: str(value) for key, value in truth.items()}, ()))


def test_the_foil_is_a_resistor_behind_its_leads():
    """Up to the limit of current; with an open contact, nothing."""
    made = plate()
    made.command(given=12.0, limit=2.0)
    assert made.observe("current") == pytest.approx(12 / 12.1)
    assert (made.observe("voltage"), made.observe("power")) == pytest.approx((12.0, (12 / 12.1) ** 2 * 12))
    made.command(limit=0.5)
    assert (made.observe("current"), made.observe("voltage")) == pytest.approx((0.5, 6.05))
    made.command(contact=False)
    assert (made.observe("current"), made.observe("power")) == (0.0, 0.0)


def test_it_ends_where_heat_in_is_heat_out():
    """The plate is warmer than the room by power over conductance, and the foil warmer than the plate."""
    made = plate()
    made.command(given=12.0, limit=2.0)
    made.advance(4 * 3600 * SECOND)
    watts = made.observe("power")
    assert made.observe("plate") == pytest.approx(22 + watts / 0.2, abs=1e-6)
    assert made.observe("foil") == pytest.approx(22 + watts / 0.2 + watts / 1.5, abs=1e-6)


def test_without_a_foil_that_stores_heat_it_is_one_exponential():
    """Against the closed form of a single capacity."""
    made = plate(foil_capacity=1e-6, foil_plate=1000)
    made.command(given=12.0, limit=2.0)
    made.advance(300 * SECOND)
    rise = made.observe("power") / 0.2 * (1 - exp(-300 * 0.2 / 90))
    assert made.observe("plate") - 22 == pytest.approx(rise, rel=1e-4)


def test_the_thermostat_opens_and_closes():
    """It keeps the plate near both of its temperatures."""
    made = plate(opens=40.5, closes=38.5)
    made.command(given=12.0, limit=2.0)
    seen = []
    for second in range(300, 1200):
        made.advance(second * SECOND)
        seen.append((made.observe("plate"), made.observe("current") > 0))
    temperatures = [temperature for temperature, _ in seen]
    assert 38.3 < min(temperatures) < 38.6
    assert 40.4 < max(temperatures) < 41.0
    assert {on for _, on in seen} == {True, False}


def test_a_truth_that_is_none_is_refused():
    """A foil without resistance would be a short."""
    with pytest.raises(TruthError, match="resistance"):
        plate(resistance=0)
