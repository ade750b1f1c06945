"""Eurotherm 3216: the frames that leave, written out; what is read back; what a register means."""

from __future__ import annotations

import math

import pytest
from scripted import ScriptedPort

from hil.clock.virtual import VirtualClock
from hil.instruments.driver import Clamps, Connection, Outlet
from hil.instruments.eurotherm_3216 import Eurotherm3216
from hil.model.bench import Wire
from hil.model.errors import Refused, Rejected

WIRE = Wire(role="thermal", instance="", instrument="tec1")


def sealed(text):
    """Return a frame with the checksum of the Modbus specification, computed bit by bit (section 6.2.2)."""
    data = bytes.fromhex(text)
    register = 0xFFFF
    for bit in (byte >> place & 1 for byte in data for place in range(8)):
        register = (register >> 1) ^ (0xA001 if (register ^ bit) & 1 else 0)
    return data + bytes((register & 0xFF, register >> 8))


def read(address, value):
    """Return request and reply of one register."""
    return sealed(f"01 03 {address:04X} 0001"), sealed(f"01 03 02 {value & 0xFFFF:04X}")


def write(address, value):
    """Return request and echo of a write of one register."""
    frame = sealed(f"01 06 {address:04X} {value & 0xFFFF:04X}")
    return frame, frame


AGREED = (read(525, 1), read(516, 0))


def thermal(*script):
    """Return driver, role and port of a written-down dialogue."""
    port = ScriptedPort(VirtualClock(), script)
    driver = Eurotherm3216(Connection(device="tec1", clock=port.clock, clamps=Clamps(), port=port, address=0))
    return driver, driver.role(WIRE), port


def test_the_checksum_of_these_tests_is_the_known_one():
    """Frames that stand in many manuals."""
    assert sealed("01 03 00 01 00 01") == bytes.fromhex("01 03 00 01 00 01 D5 CA")
    assert sealed("01 06 00 02 00 19") == bytes.fromhex("01 06 00 02 00 19 E9 C0")


def test_hold_sets_the_setpoint_before_anything_regulates():
    """-16 degC is FF60 in tenths; then local setpoint, automatic, operating; each is read, written, read."""
    _, role, port = thermal(
        *AGREED,
        *(read(2, 220), write(2, -160), read(2, -160)),
        *(read(276, 1), write(276, 0), read(276, 0)),
        *(read(273, 1), write(273, 0), read(273, 0)),
        *(read(199, 1), write(199, 0), read(199, 0)),
    )
    role.hold(-16.0)
    assert port.done
    assert port.written[3] == bytes.fromhex("01 06 00 02 FF 60 69 D2")


def test_hold_writes_nothing_that_is_there_already():
    """The memory of setpoints and modes wears."""
    _, role, port = thermal(
        *AGREED, *(read(2, 250), read(2, 250)), *(row for at in (276, 273, 199) for row in (read(at, 0), read(at, 0)))
    )
    role.hold(25.0)
    assert port.done
    assert {frame[1] for frame in port.written} == {3}


def test_standby_waits_until_the_output_is_gone():
    """Output 13.5 % at first, then none."""
    _, role, port = thermal(*(read(199, 0), write(199, 1), read(199, 1)), read(4, 135), read(4, 0))
    role.standby()
    assert port.done


def test_an_output_that_stays_is_told():
    """Standby is read back, and the output is still there two seconds later."""
    _, role, _ = thermal(read(199, 1), read(199, 1), *[read(4, 1000)] * 40)
    with pytest.raises(Rejected, match="is in standby and its output is on"):
        role.standby()


@pytest.mark.parametrize(("status", "value"), [(0, -15.9), (1 << 5, math.nan), (1 << 10, math.nan), (1 << 4, -15.9)])
def test_temperature_is_signed_and_nan_where_it_cannot_be_read(status, value):
    """Bit 5 is a broken sensor, bit 10 one over its range; manual mode is no fault."""
    _, role, _ = thermal(*AGREED, read(1, -159), read(75, status))
    assert role.temperature().value == pytest.approx(value, nan_ok=True)


def test_output_is_in_tenths_of_a_percent():
    """Cooling is negative."""
    _, role, _ = thermal(read(4, -623))
    assert role.output().value == -62.3


@pytest.mark.parametrize(
    ("mode", "loop", "output", "on"),
    [(0, 0, 0, True), (1, 0, 0, False), (0, 1, 0, False), (0, 1, 5, True), (1, 0, -5, True), (2, 0, 0, False)],
)
def test_on_is_whatever_regulates_or_gives_power(mode, loop, output, on):
    """Standby and manual at 0 % are off; an output that is not 0 is on whatever the modes say."""
    driver, _, _ = thermal(read(199, mode), read(273, loop), read(4, output))
    assert driver.outlets() == (Outlet(0, on),)


@pytest.mark.parametrize("temperature", [4000.0, -4000.0, math.nan, math.inf])
def test_a_setpoint_without_room_in_a_register_is_refused(temperature):
    """Nothing is sent."""
    _, role, port = thermal()
    with pytest.raises(Refused, match="does not fit in a register"):
        role.hold(temperature)
    assert port.written == []


def test_a_driver_without_port_is_refused():
    """It hangs on no bus."""
    with pytest.raises(Refused, match="the driver eurotherm-3216 needs a port"):
        Eurotherm3216(Connection(device="tec1", clock=VirtualClock(), clamps=Clamps()))
