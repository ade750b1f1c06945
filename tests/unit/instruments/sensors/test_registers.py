"""A sensor's registers: one byte or two, in banks, read back, and a bus that fails."""

from __future__ import annotations

import pytest
from scripted import ScriptedBus

from hil.instruments.sensors.registers import Banks, Registers
from hil.model.errors import Garbled, NoReply, Rejected

BANKS = Banks(register=0x7F, shift=4, most=3)


def registers(script, **choices):
    """Return the registers of a sensor on a bus that plays this script, and the bus."""
    bus = ScriptedBus(0x48, script)
    return Registers("sensor", bus, 0x48, **choices), bus


def test_one_byte():
    """Read, write, and a block."""
    sensor, bus = registers([(b"\x0f", b"\x3d"), (b"\x20\x07", None), (b"\x28", b"\x01\x02\x03")])
    assert sensor.read(0x0F) == 0x3D
    sensor.write(0x20, 0x07)
    assert sensor.block(0x28, 3) == b"\x01\x02\x03"
    assert bus.done


@pytest.mark.parametrize(("order", "data"), [("big", b"\x01\x17"), ("little", b"\x17\x01")])
def test_two_bytes(order, data):
    """Wide registers are numbers in the chip's own order, both ways."""
    sensor, bus = registers([(b"\x0f", data), (b"\x01" + data, None)], width=2, order=order)
    assert sensor.read(0x0F) == 0x0117
    sensor.write(0x01, 0x0117)
    assert bus.done


def test_auto_increment_is_asked_for_in_blocks_only():
    """A chip with such a bit repeats one register without it."""
    sensor, bus = registers([(b"\x28", b"\x01"), (b"\xa8", b"\x01\x02")], increment=0x80)
    assert sensor.read(0x28) == 0x01
    assert sensor.block(0x28, 2) == b"\x01\x02"
    assert bus.done


def test_a_bank_is_selected_when_it_differs_from_the_last():
    """The first one is selected after power-on; the register that selects is in every bank."""
    sensor, bus = registers(
        [
            (b"\x00", b"\xea"),
            (b"\x7f\x20", None),
            (b"\x01", b"\x06"),
            (b"\x02\x07", None),
            (b"\x7f", b"\x20"),
            (b"\x7f\x00", None),
            (b"\x00", b"\xea"),
        ],
        banks=BANKS,
    )
    assert sensor.read(0x00) == 0xEA
    assert sensor.read(0x201) == 0x06
    sensor.write(0x202, 0x07)
    assert sensor.read(0x7F) == 0x20
    assert sensor.read(0x00) == 0xEA
    assert bus.done


@pytest.mark.parametrize(("found", "lost"), [(b"\x20", True), (b"\x00", False), (b"\xff", False)])
def test_a_bank_that_somebody_left_is_found(found, lost):
    """A number that is no bank's belongs to another chip: nothing is written to that."""
    sensor, bus = registers([(b"\x7f", found), *([(b"\x7f\x00", None)] if lost else [])], banks=BANKS)
    assert sensor.bank_lost() is lost
    assert bus.done
    assert registers([])[0].bank_lost() is False


def test_settings_are_read_back():
    """The first that differs is named, by its number where it has no name."""
    sensor, bus = registers([(b"\x20\x01", None), (b"\x21\x02", None), (b"\x20", b"\x01"), (b"\x21", b"\x00")])
    sensor.set({0x20: 1, 0x21: 2})
    with pytest.raises(Rejected, match="register 0x21 was set to 0x02 and reads back 0x00"):
        sensor.expect({0x20: 1, 0x21: 2})
    assert bus.done


def test_settings_in_a_row_are_read_back_in_one_transfer():
    """Both rows are in the message."""
    sensor, _ = registers([(b"\x20", b"\x01\x02"), (b"\x20", b"\x01\x00")])
    sensor.expect_block(0x20, b"\x01\x02")
    with pytest.raises(Rejected, match="from 0x20 on were set to 01 02 and read back 01 00"):
        sensor.expect_block(0x20, b"\x01\x02")


def test_no_acknowledge_and_too_few_bytes():
    """The one is silence of the sensor, the other nonsense of the bus."""
    with pytest.raises(NoReply, match="sensor: no acknowledge at address 0x49"):
        Registers("sensor", ScriptedBus(0x48), 0x49).read(0)
    bus = ScriptedBus(0x48)
    bus.read_i2c_block_data = lambda *_: [0x01]
    with pytest.raises(Garbled, match="2 bytes were asked for and 1 came"):
        Registers("sensor", bus, 0x48).block(0x28, 2)
