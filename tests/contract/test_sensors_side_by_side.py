"""Every chip with several sensors: they start, run and stop side by side, whatever the order, and so does its die."""

from __future__ import annotations

from itertools import permutations

import pytest
import sweeps
from sensor_bench import CHIPS, Bench

from hil.model.bench import Wire

DRIVERS = {chip.driver: [each for each in CHIPS if each.driver is chip.driver] for chip in CHIPS}
SEVERAL = [chips for chips in DRIVERS.values() if len(chips) > 1]
ORDERS = [
    pytest.param(order, wide, id=f"{order[0].named} {', '.join(chip.role for chip in order)}{', wide' * wide}")
    for chips in SEVERAL
    for order in permutations(chips)
    for wide in (False, True)
]
NONE = ["0", "0", "0"]
NO_RATE_NOISE = {"white": NONE, "flicker": NONE, "random_walk": NONE}
ALONE = pytest.mark.parametrize("chips", DRIVERS.values(), ids=lambda chips: chips[0].named)


def together(chips):
    """Return a truth in which each sensor of a chip is what it is alone, at the temperature of the first; no noise."""
    truth = {key: value for chip in reversed(chips) for key, value in chip.truth.items()} | NO_RATE_NOISE
    truth["accelerometer"] = {**truth["accelerometer"], "white": NONE}
    return truth | ({"noise": NONE} if any(chip.role == "magnetometer" for chip in chips) else {})


def asleep(bench, chip):
    """Return whether the registers say that a sensor sleeps."""
    register, value = chip.sleep
    return bench.bus.read_byte_data(chip.die or chip.address, register) == value


@pytest.mark.parametrize(("order", "wide"), sweeps.sample(ORDERS, 12))
def test_sensors_of_one_chip_live_side_by_side(order, wide):
    """None resets the others or changes their settings, takes them to sleep with it, or keeps the die awake for ever.

    Each has its range from its wire: the narrowest or the widest, one of which is not that of power-on.
    """
    chips = DRIVERS[order[0].driver]
    bench = Bench(chips[0], truth=together(chips))
    roles, heat = {}, chips[0].expected[3]
    for chip in order:
        settings = {"range": chip.ranges[-wide]} if chip.ranges else {}
        roles[chip.role] = bench.driver.role(Wire(role=chip.role, instance="", instrument="sensor", settings=settings))
    thermometer = bench.driver.role(Wire(role="thermometer", instance="", instrument="sensor"))

    def all_are_right(running):
        for chip in running:
            bench.clock.sleep(0.6)
            sample = roles[chip.role].sample()
            assert sample[:3] == pytest.approx(chip.expected[:3], abs=0.1), chip.role
            assert sample[3] == pytest.approx(heat, abs=0.01), chip.role
            assert thermometer.temperature().value == pytest.approx(heat, abs=0.01), chip.role

    for count, chip in enumerate(order, 1):
        roles[chip.role].start()
        all_are_right(order[:count])
    roles[order[0].role].start()
    all_are_right(order)
    for count, chip in enumerate(order, 1):
        roles[chip.role].stop()
        all_are_right(order[count:])
    assert all(asleep(bench, chip) for chip in chips)


@ALONE
def test_the_thermometer_of_a_chip_alone(chips):
    """It wakes what measures the temperature, and needs no wire of another role."""
    bench = Bench(chips[0], truth=chips[0].truth)
    thermometer = bench.driver.role(Wire(role="thermometer", instance="", instrument="sensor"))
    thermometer.start()
    assert thermometer.temperature().value == pytest.approx(chips[0].expected[3], abs=0.1)
    thermometer.stop()
    assert all(asleep(bench, chip) for chip in chips)
