"""A FIFO as data sheets differ: counted in bytes or packets, lost packets with either byte first."""

from __future__ import annotations

from dataclasses import replace

import pytest
from scripted import ScriptedBus

from hil.instruments.iim42652 import FIFO
from hil.instruments.sensors.registers import Registers


def registers(script):
    """Return the registers of a sensor on a bus that plays this script."""
    return Registers("sensor", ScriptedBus(0x68, script), 0x68)


@pytest.mark.parametrize(("unit", "count"), [(1, b"\x01\x90"), (8, b"\x00\x32")])
def test_packets_at_hand(unit, count):
    """Fifty packets of eight bytes are 400 bytes."""
    assert replace(FIFO, unit=unit).at_hand(registers([(b"\x2e", count)])) == 50


@pytest.mark.parametrize(("order", "data"), [("little", b"\x05\x01"), ("big", b"\x01\x05")])
def test_packets_that_were_lost(order, data):
    """Two bytes in the chip's own order."""
    assert replace(FIFO, lost_order=order).lost_by(registers([(b"\x6c", data)])) == 261


@pytest.mark.parametrize(("rate", "packets"), [(0.5, 1), (12.5, 12), (100, 100), (1000, 128)])
def test_a_block_is_a_second_or_half_of_it(rate, packets):
    """The other half is time for a bus that is busy."""
    assert FIFO.watermark(rate) == packets
