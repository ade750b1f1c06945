"""The temperature controller's driver against its peer and the chamber, under the virtual clock."""

from __future__ import annotations

import math
from contextlib import suppress

import pytest
from chamber_bench import CLAMPS, THERMAL, chamber
from facing import facing

from hil.instruments.driver import Outlet
from hil.instruments.eurotherm_3216 import Eurotherm3216
from hil.model.bench import Wire
from hil.model.errors import ClampExceeded, DeviceFault, Garbled, NoReply, Refused, Rejected
from hil.model.identity import Identity
from hil.simulation.peers.eurotherm.controller import MODEL

CONNECTS = {"sensor": "chamber.plate", "drive": "chamber.tec", "ambient": "chamber.ambient"}
QUIET = {"sensor_noise": "0"}
OPEN = {"kind": "sensor-open", "from": "10 s", "until": "20 s"}


def controller(*, faults=(), truth=None, address=0, plant=None):
    """Return a driver facing a controller on a 9600 baud line, with the chamber behind it."""
    return facing(
        MODEL,
        driver=Eurotherm3216,
        truth={**QUIET, **(truth or {})},
        faults=faults,
        clamps=CLAMPS,
        connects=CONNECTS,
        plants={"chamber": plant or chamber()},
        baud=9600,
        address=address,
    )


def wire(decimals):
    """Return the wire of a display with so many decimals."""
    return Wire(role="thermal", instance="", instrument="device", settings={"decimals": decimals})


def test_identity_and_outlet():
    """The type code reads like the model, and the version says that it is simulated; in standby its output is off."""
    with controller() as (driver, _):
        assert driver.identify() == Identity(model="3216", firmware="SIMULATED")
        assert driver.outlets() == (Outlet(0, on=False),)


def test_another_type_is_not_taken_for_it():
    """A controller of another series says so."""
    with controller(faults=[{"kind": "identity", "value": "0x2480"}]) as (driver, _):
        assert driver.identify() == Identity(model="type code 0x2480", firmware="SIMULATED")


def test_the_whole_role():
    """Held below zero, it gets there, tells temperature, setpoint and power, and stops."""
    plant = chamber()
    with controller(plant=plant) as (driver, clock):
        thermal = driver.role(THERMAL)
        thermal.hold(-7.3)
        clock.sleep(900)
        assert thermal.setpoint().value == -7.3
        assert thermal.temperature().value == pytest.approx(plant.observe("plate"), abs=0.06)
        assert thermal.temperature().value == pytest.approx(-7.3, abs=0.11)
        assert -80 < thermal.output().value < -20
        assert (thermal.output().unit, thermal.setpoint().unit, thermal.temperature().unit) == ("%", "degC", "degC")
        assert driver.outlets() == (Outlet(0, on=True),)
        thermal.standby()
        assert driver.outlets() == (Outlet(0, on=False),)
        assert thermal.output().value == 0
        assert plant.inputs["tec"] == 0


def test_a_controller_found_regulating_is_on():
    """Whoever left it so; standby makes it safe."""
    with controller(truth={"mode": "operating", "setpoint": "30"}) as (driver, clock):
        clock.sleep(5)
        assert driver.outlets() == (Outlet(0, on=True),)
        driver.role(THERMAL).standby()
        assert driver.outlets() == (Outlet(0, on=False),)


def test_the_memory_is_written_only_where_something_differs():
    """A campaign that asks for the same setpoint every five seconds writes it once; so do modes."""
    written = []

    def watched(setup):
        written.append(MODEL.build(setup))
        return written[0]

    model = type(MODEL)(link="serial", fault_kinds=MODEL.fault_kinds, build=watched)
    with facing(model, driver=Eurotherm3216, clamps=CLAMPS, baud=9600) as (driver, clock):
        thermal = driver.role(THERMAL)
        for _ in range(200):
            thermal.hold(25.0)
            clock.sleep(5)
        for _ in range(3):
            thermal.standby()
        assert dict(written[0].writes) == {24: 1, 199: 2}


@pytest.mark.parametrize("temperature", [-20.1, 45.1, 1e9, math.nan])
def test_clamps_come_before_the_line(temperature):
    """A setpoint beyond the bench file is refused, and nothing was sent."""
    with controller() as (driver, clock):
        with pytest.raises(ClampExceeded, match="outside its clamp -20 to 45 degC"):
            driver.role(THERMAL).hold(temperature)
        assert clock.now_ns() == 0


@pytest.mark.parametrize("truth", [{"decimals": "0"}, {"decimals": "2"}, {"unit": "degF"}, {"unit": "K"}])
def test_another_display_is_refused_and_nothing_is_set(truth):
    """25.0 would be 2.5 or 250 degrees; standby needs no scale."""
    with controller(truth=truth) as (driver, _):
        thermal = driver.role(THERMAL)
        for ask in (lambda: thermal.hold(25.0), thermal.temperature, thermal.setpoint):
            with pytest.raises(Rejected, match="the wiring says 1 decimals"):
                ask()
        thermal.standby()
        assert driver.outlets() == (Outlet(0, on=False),)


@pytest.mark.parametrize(("decimals", "step"), [("0", 1.0), ("1", 0.1), ("2", 0.01)])
def test_decimals_of_the_wire(decimals, step):
    """With the display's decimals in the wiring, setpoint and reading mean what they say."""
    with controller(truth={"decimals": decimals}) as (driver, clock):
        thermal = driver.role(wire(decimals))
        thermal.hold(31.0)
        clock.sleep(900)
        assert thermal.setpoint().value == 31.0
        assert thermal.temperature().value == pytest.approx(31.0, abs=1.01 * step)


def test_a_setpoint_that_the_instrument_clips_is_rejected():
    """Its own limits are narrower than the clamp; it stays in standby."""
    with controller(truth={"setpoint_low": "0"}) as (driver, _):
        thermal = driver.role(THERMAL)
        with pytest.raises(Rejected, match="the setpoint was set to -100 and reads back 0"):
            thermal.hold(-10.0)
        assert driver.outlets() == (Outlet(0, on=False),)


def test_a_broken_sensor_is_no_number():
    """While it is broken the temperature is NaN and the output safe; then it is there again."""
    with controller(faults=[OPEN]) as (driver, clock):
        thermal = driver.role(THERMAL)
        thermal.hold(30.0)
        clock.sleep(12)
        assert math.isnan(thermal.temperature().value)
        assert thermal.output().value == 0
        clock.sleep(20)
        assert 20 < thermal.temperature().value < 35


def test_a_detached_sensor_reads_the_room():
    """Nothing on the line tells: the plate runs away behind a number that stands still."""
    plant = chamber()
    with controller(plant=plant, faults=[{"kind": "sensor-detached"}]) as (driver, clock):
        thermal = driver.role(THERMAL)
        thermal.hold(40.0)
        clock.sleep(300)
        assert thermal.temperature().value == 22.0
        assert plant.observe("plate") > 80


@pytest.mark.parametrize(("kind", "share"), [("stuck", 0.0), ("runaway", 1.0)])
def test_what_an_output_does_is_not_what_it_says(kind, share):
    """A stuck cooler and one that runs away read as usual; only the plate tells."""
    plant = chamber()
    with controller(plant=plant, faults=[{"kind": kind}]) as (driver, clock):
        thermal = driver.role(THERMAL)
        thermal.hold(10.0)
        clock.sleep(60)
        assert thermal.output().value == -100
        assert plant.inputs["tec"] == share
        thermal.standby()
        assert plant.inputs["tec"] == share


def test_one_hold_takes_what_the_line_takes():
    """Ten exchanges of some 20 ms; a reading takes two, after the first."""
    with controller() as (driver, clock):
        thermal = driver.role(THERMAL)
        thermal.hold(25.0)
        assert 0.2 < clock.now() < 0.6
        before = clock.now()
        thermal.temperature()
        assert 0.03 < clock.now() - before < 0.06


def test_a_dead_controller_is_no_reply_within_bounded_time():
    """Every operation ends, and says who is silent."""
    with controller(faults=[{"kind": "dead"}]) as (driver, clock):
        thermal = driver.role(THERMAL)
        for ask in (lambda: thermal.hold(25.0), thermal.temperature, thermal.output, thermal.standby, driver.outlets):
            before = clock.now()
            with pytest.raises(NoReply, match="device"):
                ask()
            assert clock.now() - before < 4.6


def test_standby_leaves_although_nothing_can_be_read():
    """A controller whose answers are spoiled is told to stop all the same."""
    plant = chamber()
    garbled = {"kind": "garbled", "from": "5 s", "until": "60 s"}
    with controller(plant=plant, faults=[garbled]) as (driver, clock):
        thermal = driver.role(THERMAL)
        thermal.hold(-10.0)
        clock.sleep(10)
        with pytest.raises(Garbled):
            thermal.standby()
        clock.sleep(2)
        assert plant.inputs["tec"] == 0


@pytest.mark.parametrize(
    "fault",
    [
        {"kind": "garbled", "share": "0.02"},
        {"kind": "partial", "bytes": "4"},
        {"kind": "late", "by": "0.52 s"},
        {"kind": "chatty", "every": "70 ms", "text": "?"},
    ],
)
def test_no_fault_of_the_line_becomes_a_temperature(fault):
    """Whatever gets through a bad line is true; everything else is a fault of the device."""
    plant = chamber()
    with controller(plant=plant, faults=[fault]) as (driver, clock):
        thermal = driver.role(THERMAL)
        for _ in range(30):
            with suppress(DeviceFault):
                assert thermal.temperature().value == pytest.approx(plant.observe("plate"), abs=0.06)
            clock.sleep(0.05)


def test_what_it_is_not_is_refused():
    """Another role, an unknown setting, a display that does not exist."""
    with controller() as (driver, _):
        with pytest.raises(Refused, match="the driver eurotherm-3216 does not fill the role relays"):
            driver.role(Wire(role="relays", instance="", instrument="device"))
        with pytest.raises(Refused, match="unknown key 'decimal', did you mean 'decimals'"):
            driver.role(Wire(role="thermal", instance="", instrument="device", settings={"decimal": "1"}))
        with pytest.raises(Refused, match="'decimals' must be at most 2"):
            driver.role(wire("3"))
