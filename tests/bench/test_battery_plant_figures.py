"""What a battery costs that is cycled for weeks: its physics, and what a tester reads of it every five seconds."""

from __future__ import annotations

from battery_cycles import GRID_S, SECOND_NS, Cycles, battery

STEPS = 2000


def test_a_step_of_the_battery(cost):
    """Five seconds of charging on the grid, nobody looking."""

    def charged():
        plant = battery(charge="0.3")
        plant.command(charge_contact=True, supply_voltage=4.2, supply_current=0.7)
        plant.advance(STEPS * GRID_S * SECOND_NS)
        return plant

    assert cost("battery, a step of its physics", charged, units=STEPS).observe("charge") > 0.8


def test_a_cycle_of_the_battery(cost):
    """A charge and a discharge, with voltage, current and temperature read every five seconds."""

    def cycled():
        cycles = Cycles(battery(charge="0.02"))
        return cycles.charge().seconds + cycles.discharge().seconds

    steps = cycled() // GRID_S
    assert cost("battery, five seconds with three readings", cycled, units=steps, rounds=3) > 5 * 3600
