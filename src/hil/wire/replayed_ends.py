"""The recorded far ends of byte streams and buses: they answer as they did, strictly in order."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from serial import SerialException

from hil.wire.replay import Playback
from hil.wire.tap import message_bytes
from hil.wire.transcript import Operation

if TYPE_CHECKING:
    from smbus2 import i2c_msg

__all__ = ["ReplayedBus", "ReplayedStream"]

_READ_FLAG = 0x0001


class ReplayedStream:
    """The recorded far end of one byte stream."""

    def __init__(self, device: str, playback: Playback) -> None:
        self._device = device
        self._playback = playback

    def opened(self) -> None:
        """Do nothing: opening is not recorded."""

    def closed(self) -> None:
        """Do nothing: closing is not recorded."""

    def dtr_rose(self) -> None:
        """Take the recorded pulse."""
        self._take("pulse_dtr")

    def write(self, data: bytes) -> None:
        """Compare the bytes with the record."""
        self._take("write", data)

    def exchange(self, data: bytes, timeout: float) -> bytes:
        """Give what was received then; a record in parts holds a second look at the buffer before the question."""
        if not self._playback.in_parts:
            return self._take("exchange", data).received
        while self._playback.next_is(self._device, "waiting", "discard"):
            self._take("discard" if self._playback.next_is(self._device, "discard") else "waiting")
        self.write(data)
        first = self.read(1, timeout)
        return first + self.read(more, timeout) if first and (more := self.waiting()) else first

    def read(self, size: int, timeout: float) -> bytes:  # noqa: ARG002 - the record knows what came in time
        """Give what was received then."""
        return self._take("read").received

    def waiting(self) -> int:
        """Give the number that was waiting then."""
        return int.from_bytes(self._take("waiting").received)

    def discard(self) -> None:
        """Take the recorded discard."""
        self._take("discard")

    def _take(self, name: str, sent: bytes = b"") -> Operation:
        operation = self._playback.take(self._device, name, sent)
        if operation.error:
            raise SerialException(int(operation.error), "the port was gone in the record, too")
        return operation


class ReplayedBus:
    """The recorded far end of one device's view of an I2C bus."""

    def __init__(self, device: str, playback: Playback) -> None:
        self._device = device
        self._playback = playback

    def read_byte(self, i2c_addr: int) -> int:
        """Give the recorded byte."""
        return self._take("read_byte", bytes([i2c_addr]))[0]

    def write_byte(self, i2c_addr: int, value: int) -> None:
        """Compare with the record."""
        self._take("write_byte", bytes([i2c_addr, value]))

    def read_byte_data(self, i2c_addr: int, register: int) -> int:
        """Give the recorded byte."""
        return self._take("read_byte_data", bytes([i2c_addr, register]))[0]

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Compare with the record."""
        self._take("write_byte_data", bytes([i2c_addr, register, value]))

    def read_word_data(self, i2c_addr: int, register: int) -> int:
        """Give the recorded word."""
        return int.from_bytes(self._take("read_word_data", bytes([i2c_addr, register])), "little")

    def write_word_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Compare with the record."""
        self._take("write_word_data", bytes([i2c_addr, register]) + value.to_bytes(2, "little"))

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Give the recorded bytes."""
        return list(self._take("read_i2c_block_data", bytes([i2c_addr, register, length])))

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Compare with the record."""
        self._take("write_i2c_block_data", bytes([i2c_addr, register, *data]))

    def i2c_rdwr(self, *i2c_msgs: i2c_msg) -> None:
        """Compare what is written with the record, and fill the reads from it."""
        received = self._take("i2c_rdwr", message_bytes(i2c_msgs))
        for message in (message for message in i2c_msgs if message.flags & _READ_FLAG):
            for index in range(message.len):
                message.buf[index] = received[index : index + 1]
            received = received[message.len :]

    def _take(self, name: str, sent: bytes) -> bytes:
        operation = self._playback.take(self._device, name, sent)
        if operation.error:
            raise OSError(int(operation.error), "no acknowledge in the record, too")
        return operation.received
