"""A chip in a package of its own: role, driver, peer, plant and fault are found and work like ours."""

from __future__ import annotations

import math
from importlib import import_module

import pytest
from other_packages import INA226, install, uninstall
from sensor_bench import Bench, SensorChip

from hil.instruments.registry import DRIVERS, ROLES
from hil.model.errors import Garbled, NoReply, Refused, Rejected, WrongIdentity
from hil.simulation.registry import FAULTS, PEERS, PLANTS

MS = 1_000_000


@pytest.fixture(scope="module", autouse=True)
def _package(tmp_path_factory):
    """Install the package for these tests."""
    folder = tmp_path_factory.mktemp("site")
    install(INA226, folder)
    yield
    uninstall(INA226, folder)


class Rail:
    """What is at the chip's terminals."""

    def __init__(self, value):
        self.value = value

    def observe_at(self, at_ns):
        """Return it."""
        return self.value


def bench(volts=5.0, amperes=0.25, settings=None, faults=()):
    """Return a chip on a rail."""
    chip = SensorChip(
        driver=DRIVERS["ina226"], model=PEERS["ina226"], role="power_monitor", unit="V", named="INA226", address=0x40,
        strapped=0x41, power_on=(0x00, b"\x41\x27"), ranges=(), rates=(), narrow=0.0, truth={}, expected=(), close=0.0,
        sleep=(0x00, 0x00),
    )  # fmt: skip
    made = Bench(chip, truth={"noise": "0"}, settings=settings, faults=faults)
    made.peer._peer._points = (Rail(volts), Rail(amperes))
    return made


def test_registers_are_those_of_the_data_sheet():
    """Power-on values, and the counts of table 6's weights: 1.25 mV and 2.5 uV."""
    made = bench(12.0, -0.5)
    made.clock.sleep(0.01)
    found = [made.read(register, 2).hex() for register in (0x00, 0xFF, 0x02, 0x01, 0x06, 0x06)]
    assert found == ["4127", "2260", "2580", "b1e0", "0008", "0000"]


@pytest.mark.parametrize("averages", ["1", "64"])
def test_the_driver_reads_what_is_at_its_terminals(averages):
    """Voltage and current, each sample a new one."""
    made = bench(settings={"averages": averages, "shunt": "0.1 ohm"})
    made.sensor.start()
    assert made.sensor.voltage().value == pytest.approx(5.0, abs=1e-3)
    assert made.sensor.sample() == pytest.approx((5.0, 0.25), abs=1e-3)
    assert made.driver.identify().model == "INA226"
    made.sensor.stop()
    with pytest.raises(Refused, match="has not been started"):
        made.sensor.sample()


def test_its_faults_are_those_of_the_package():
    """A line that is held low: at the start it is another chip, later it forgot its name."""
    with pytest.raises(WrongIdentity, match="Die ID is 0x2200, the INA226 has 0x2260"):
        bench(faults=[{"kind": "sda-low", "after": "1"}]).sensor.start()
    made = bench(faults=[{"kind": "sda-low", "from": "1 s"}, {"kind": "overflow"}])
    made.sensor.start()
    made.clock.sleep(1)
    with pytest.raises((Garbled, NoReply)):
        made.sensor.sample()
    made = bench(faults=[{"kind": "sda-low"}])
    with pytest.raises((Rejected, WrongIdentity)):
        made.sensor.start()


def test_the_rail_starts_softly():
    """One time constant brings it by 1 - 1/e; it does not depend on who looks."""
    module = import_module("hil_ina226.plant")
    assert PLANTS["soft-start"].build is module.build
    rail = module.SoftStart("rail", 10 * MS, module.RailTruth())
    rail.advance(100_000 * MS)
    assert rail.observe("voltage") == pytest.approx(5.0 * (1 - 1 / math.e), abs=1e-3)


def test_everything_is_found_by_entry_point():
    """Role, driver, peer, plant and fault are where everybody looks for them."""
    for offers, name in ((ROLES, "power_monitor"), (DRIVERS, "ina226"), (PEERS, "ina226"), (PLANTS, "soft-start")):
        assert name in offers
        assert offers[name]
    assert FAULTS["sda-low"].name == "sda-low"
    assert ROLES["power_monitor"].operations["voltage"].unit == "V"
