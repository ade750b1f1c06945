"""The simulated bus under the real smbus2 code: its own packing, limits and errors, with only ioctl replaced."""

from __future__ import annotations

import ctypes
import errno

import pytest
import smbus2
from echo import MemoryPeer
from smbus2 import i2c_msg
from smbus2.smbus2 import I2C_FUNCS, I2C_RDWR, I2C_SLAVE, I2C_SMBUS, I2cFunc

from hil.clock.virtual import VirtualClock
from hil.wire.simulated_bus import SimulatedBus

READ, BYTE, BYTE_DATA, WORD_DATA, I2C_BLOCK = 1, 1, 2, 3, 8


class Kernel:
    """The Linux I2C character device's ioctl, in front of a simulated bus (linux/i2c-dev.h)."""

    def __init__(self, bus: SimulatedBus) -> None:
        self.bus, self.address = bus, 0

    def ioctl(self, _fd, request, argument):
        """Serve the four requests that smbus2 makes."""
        if request == I2C_FUNCS:
            argument.value = int(I2cFunc.I2C) | int(I2cFunc.SMBUS_READ_BYTE)
        elif request == I2C_SLAVE:
            self.address = argument
        elif request == I2C_RDWR:
            self.bus.i2c_rdwr(*(argument.msgs[i] for i in range(argument.nmsgs)))
        elif request == I2C_SMBUS:
            self._smbus(argument)
        return 0

    def _smbus(self, message):
        reading = message.read_write == READ
        data = message.data.contents if message.data else None
        if message.size == BYTE and reading:
            data.byte = self.bus.transfer([(self.address, 1)])[0][0]
        elif message.size == BYTE:
            self.bus.transfer([(self.address, bytes([message.command]))])
        elif reading:
            count = {BYTE_DATA: 1, WORD_DATA: 2, I2C_BLOCK: data.block[0]}[message.size]
            reply = self.bus.transfer([(self.address, bytes([message.command])), (self.address, count)])[0]
            block = bytes([count]) + reply if message.size == I2C_BLOCK else reply
            ctypes.memmove(ctypes.addressof(data), block, len(block))
        else:
            raw = {BYTE_DATA: bytes([data.byte]), WORD_DATA: data.word.to_bytes(2, "little")}.get(message.size)
            raw = bytes(data.block[1 : 1 + data.block[0]]) if raw is None else raw
            self.bus.transfer([(self.address, bytes([message.command]) + raw)])


@pytest.fixture
def both(monkeypatch):
    """The same bus twice: under the real smbus2, and by our own face."""
    simulated = SimulatedBus(VirtualClock(), 400_000, [MemoryPeer()])
    monkeypatch.setattr(smbus2.smbus2, "ioctl", Kernel(simulated).ioctl)
    with smbus2.SMBus("/dev/null") as real:
        yield real, simulated


def test_every_operation_agrees_with_real_smbus2(both):
    """What smbus2 packs and unpacks equals what the simulated bus does itself."""
    real, simulated = both
    real.write_byte_data(0x50, 1, 0xAB)
    real.write_word_data(0x50, 2, 0xBEEF)
    real.write_i2c_block_data(0x50, 4, [9, 8, 7])
    for bus in (real, simulated):
        assert bus.read_byte_data(0x50, 1) == 0xAB
        assert bus.read_word_data(0x50, 2) == 0xBEEF
        assert bus.read_i2c_block_data(0x50, 4, 3) == [9, 8, 7]
        bus.write_byte(0x50, 1)
        assert bus.read_byte(0x50) == 0xAB
        reply = i2c_msg.read(0x50, 2)
        bus.i2c_rdwr(i2c_msg.write(0x50, [2]), reply)
        assert bytes(reply) == b"\xef\xbe"


def test_a_missing_device_is_remote_io_error_on_both(both):
    """Nobody at an address is errno EREMOTEIO, as the kernel reports it."""
    for bus in both:
        with pytest.raises(OSError, match="Remote I/O error") as caught:
            bus.read_byte_data(0x1E, 0)
        assert caught.value.errno == errno.EREMOTEIO


def test_blocks_end_at_32_bytes_on_both(both):
    """A block longer than SMBus allows is refused by both."""
    for bus in both:
        with pytest.raises(ValueError, match="32"):
            bus.read_i2c_block_data(0x50, 0, 33)
