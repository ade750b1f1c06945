"""Simulated I2C bus with smbus2's interface, for a world's devices."""

from __future__ import annotations

import ctypes
import errno
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from hil.clock.port import NANOSECONDS
from hil.clock.virtual import VirtualClock
from hil.wire.peer import BusPeer, Nack

if TYPE_CHECKING:
    from smbus2 import i2c_msg

__all__ = ["Message", "SimulatedBus"]

Message = tuple[int, bytes | int]
"""One I2C message: the 7-bit address, and the bytes to write or the number of bytes to read."""

_BITS_PER_BYTE = 9
_BLOCK = 32
_READ_FLAG = 0x0001


class SimulatedBus:
    """One bus. Every message takes the time of its bits; an unused address is errno EREMOTEIO.

    Args:
        clock: the bench's clock.
        frequency_hz: the bus clock.
        peers: the devices on it.
    """

    def __init__(self, clock: VirtualClock, frequency_hz: float, peers: Sequence[BusPeer]) -> None:
        self._clock = clock
        self._ns_per_byte = round(_BITS_PER_BYTE * NANOSECONDS / frequency_hz)
        self._peers = {address: peer for peer in peers for address in peer.addresses}

    def transfer(self, messages: Sequence[Message]) -> list[bytes]:
        """Run messages with repeated starts; return the bytes of each read.

        Raises:
            OSError: with errno EREMOTEIO where a device does not acknowledge.
        """
        replies: list[bytes] = []
        for address, content in messages:
            length = content if isinstance(content, int) else len(content)
            self._clock.wait_until(self._clock.now_ns() + (1 + length) * self._ns_per_byte)
            try:
                peer = self._peers[address]
                if isinstance(content, int):
                    replies.append(peer.read(address, content))
                else:
                    peer.write(address, content)
            except (KeyError, Nack):
                raise OSError(errno.EREMOTEIO, os.strerror(errno.EREMOTEIO)) from None
        return replies

    def read_byte(self, i2c_addr: int) -> int:
        """Read one byte without a register address."""
        return self.transfer([(i2c_addr, 1)])[0][0]

    def write_byte(self, i2c_addr: int, value: int) -> None:
        """Write one byte without a register address."""
        self.transfer([(i2c_addr, bytes([value]))])

    def read_byte_data(self, i2c_addr: int, register: int) -> int:
        """Read one byte from a register."""
        return self._registers(i2c_addr, register, 1)[0]

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Write one byte to a register."""
        self.transfer([(i2c_addr, bytes([register, value]))])

    def read_word_data(self, i2c_addr: int, register: int) -> int:
        """Read two bytes starting at a register, low byte first."""
        return int.from_bytes(self._registers(i2c_addr, register, 2), "little")

    def write_word_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Write two bytes starting at a register, low byte first."""
        self.transfer([(i2c_addr, bytes([register]) + value.to_bytes(2, "little"))])

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Read up to 32 bytes starting at a register."""
        if length > _BLOCK:
            raise ValueError(f"a block holds {_BLOCK} bytes, not {length}")
        return list(self._registers(i2c_addr, register, length))

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Write up to 32 bytes starting at a register."""
        if len(data) > _BLOCK:
            raise ValueError(f"a block holds {_BLOCK} bytes, not {len(data)}")
        self.transfer([(i2c_addr, bytes([register, *data]))])

    def i2c_rdwr(self, *i2c_msgs: i2c_msg) -> None:
        """Run combined messages of smbus2; reads fill their message."""
        reads = [message for message in i2c_msgs if message.flags & _READ_FLAG]
        replies = self.transfer(
            [(message.addr, message.len if message.flags & _READ_FLAG else bytes(message)) for message in i2c_msgs]
        )
        for message, reply in zip(reads, replies, strict=True):
            ctypes.memmove(message.buf, reply, len(reply))

    def _registers(self, address: int, register: int, count: int) -> bytes:
        return self.transfer([(address, bytes([register])), (address, count)])[0]
