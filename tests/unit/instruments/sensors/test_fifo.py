"""A FIFO as data sheets differ: counted in bytes or packets, lost packets with either byte first."""

from __future__ import annotations

from dataclasses import replace

import pytest
from scripted import ScriptedBus

from hil.instruments.iim42652 import FIFO
from hil.instruments.sensors.fifo import source_of
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


@pytest.mark.parametrize(("data", "lost"), [(b"\x00", 0), (b"\x60", 0), (b"\x10", 1), (b"\xff", 1)])
def test_a_flag_says_only_that_packets_were_lost(data, lost):
    """Other bits of its register do not matter; how many they were is not in it."""
    assert replace(FIFO, lost_flag=0x1F).lost_by(registers([(b"\x6c", data)])) == lost


class Ticking:
    """A clock that the test moves, and a FIFO of eight packets behind it that flags a loss once."""

    def __init__(self):
        self.seconds, self.put, self.taken, self.lost = 0.0, 0, 0, 0

    def now(self):
        """Return the time."""
        return self.seconds

    def wait(self, seconds):
        """Fill the FIFO at 10 Hz."""
        self.seconds += seconds
        self.put = round(self.seconds * 10)
        gone = max(0, self.put - self.taken - 8)
        self.taken, self.lost = self.taken + gone, self.lost or int(bool(gone))

    def read_byte_data(self, _, register):
        """Give the flag, once."""
        flag, self.lost = self.lost, 0
        return flag if register == 0x6C else 0

    def write_byte_data(self, _, register, value):
        """Take settings."""

    def read_i2c_block_data(self, _, register, count):
        """Give the bytes at hand."""
        return list((8 * (self.put - self.taken)).to_bytes(count, "big")) if register == 0x2E else [0] * count

    def i2c_rdwr(self, _, take):
        """Give packets."""
        self.taken += take.len // 8


def test_how_many_a_flag_stands_for_follows_from_time():
    """Three seconds at 10 Hz, eight packets at hand: 22 were lost; what comes next is whole."""
    bench = Ticking()
    fifo = replace(FIFO, size=64, lost_flag=1, fill=lambda _: {})
    source = source_of(Registers("sensor", bench, 0x68), fifo, bench, rate=10.0, line=0)
    source.begin()
    seen = []
    for pause in (0.5, 3.0, 0.5):
        bench.wait(pause)
        seen += [(block.watermark, len(block.packets) // 8, block.lost_counter) for block in source.blocks()]
    assert seen == [(5, 5, 0), (30, 8, 22), (5, 5, 22)]


@pytest.mark.parametrize(("rate", "packets"), [(0.5, 1), (12.5, 12), (100, 100), (1000, 128)])
def test_a_block_is_a_second_or_half_of_it(rate, packets):
    """The other half is time for a bus that is busy."""
    assert FIFO.watermark(rate) == packets
