"""I2C bus of the board: smbus2's interface over the link, and streams."""

from __future__ import annotations

import ctypes
import errno
import os
import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

from hil.clock.port import Clock
from hil.instruments.obc_link.frames import OVERHEAD
from hil.instruments.obc_link.messages import Command, MessageStatus, statuses
from hil.instruments.obc_link.session import ObcSession
from hil.instruments.obc_link.streams import ObcStream, begin_stream
from hil.model.errors import Refused
from hil.wire.streaming import StreamTransfer

if TYPE_CHECKING:
    from smbus2 import i2c_msg

__all__ = ["Message", "ObcBus"]

Message = tuple[int, bytes | int]
"""One I2C message: the 7-bit address, and the bytes to write or the number of bytes to read."""

_BLOCK = 32
_READ_FLAG = 0x0001
_WRITE, _READ = 0, 1
_RESET_HZ = 100_000
_ERRORS = {
    MessageStatus.NO_ADDRESS: errno.EREMOTEIO,
    MessageStatus.NO_DATA: errno.EREMOTEIO,
    MessageStatus.TIMEOUT: errno.ETIMEDOUT,
}


class ObcBus:
    """One I2C bus of the board, with smbus2's interface. See `hil.wire.streaming.StreamingBus`.

    A missing acknowledge raises OSError with errno EREMOTEIO, a blocked bus ETIMEDOUT, any other failure
    on it EIO; a failure of the link itself is a DeviceFault of the board.

    Args:
        session: the board's session.
        clock: the bench's clock.
        number: number of the bus on the board.
        frequency_hz: bus clock; set before the first transfer after each start of the board.
    """

    def __init__(self, session: ObcSession, clock: Clock, *, number: int = 0, frequency_hz: int = _RESET_HZ) -> None:
        self._session = session
        self._clock = clock
        self._number = number
        self._frequency_hz = frequency_hz
        self._ready_for = 0

    @property
    def device(self) -> str:
        """The board's name."""
        return self._session.device

    def start_stream(
        self, transfers: Sequence[StreamTransfer], *, period_s: float | None = None, line: int | None = None
    ) -> ObcStream:
        """Have the board run `transfers` every `period_s`, or at every rising edge of interrupt line `line`.

        Raises:
            Refused: not exactly one of `period_s` and `line` is given, or a number does not fit.
            Rejected: the board cannot run this program.
        """
        self._make_ready()
        return begin_stream(
            self._session, self._clock, bus=self._number, transfers=transfers, period_s=period_s, line=line
        )

    def transfer(self, messages: Sequence[Message]) -> list[bytes]:
        """Run messages with repeated starts; return the bytes of each read.

        Raises:
            OSError: a message failed on the bus.
            Refused: more than the board accepts at once.
            DeviceFault: the link failed.
        """
        self._make_ready()
        payload = struct.pack("<BB", self._number, len(messages)) + b"".join(map(_packed, messages))
        board = self._session.board()
        if len(messages) > board.messages or len(payload) + OVERHEAD > board.largest_frame:
            raise Refused(
                f"{self._session.device}: {len(messages)} messages of {len(payload)} bytes are too much for it",
                "divide the transfer",
            )
        fields = self._session.request(Command.I2C, payload).fields
        found = self._session.read("I2C", lambda data: _results(data, messages), fields)
        for (address, _), (status, _) in zip(messages, found, strict=True):
            if status:
                number = _ERRORS.get(MessageStatus(status), errno.EIO)
                raise OSError(number, f"{os.strerror(number)} at address {address:#04x} behind {self._session.device}")
        return [data for (_, content), (_, data) in zip(messages, found, strict=True) if isinstance(content, int)]

    def read_byte(self, i2c_addr: int) -> int:
        """Read one byte without a register address."""
        return self.transfer([(i2c_addr, 1)])[0][0]

    def write_byte(self, i2c_addr: int, value: int) -> None:
        """Write one byte without a register address."""
        self.transfer([(i2c_addr, bytes((value,)))])

    def read_byte_data(self, i2c_addr: int, register: int) -> int:
        """Read one byte from a register."""
        return self._registers(i2c_addr, register, 1)[0]

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Write one byte to a register."""
        self.transfer([(i2c_addr, bytes((register, value)))])

    def read_word_data(self, i2c_addr: int, register: int) -> int:
        """Read two bytes starting at a register, low byte first."""
        return int.from_bytes(self._registers(i2c_addr, register, 2), "little")

    def write_word_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Write two bytes starting at a register, low byte first."""
        self.transfer([(i2c_addr, bytes((register,)) + value.to_bytes(2, "little"))])

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Read up to 32 bytes starting at a register."""
        _must_fit_block(length)
        return list(self._registers(i2c_addr, register, length))

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Write up to 32 bytes starting at a register."""
        _must_fit_block(len(data))
        self.transfer([(i2c_addr, bytes((register, *data)))])

    def i2c_rdwr(self, *i2c_msgs: object) -> None:
        """Run smbus2 messages as one combined transfer; reads fill their message."""
        messages = cast("tuple[i2c_msg, ...]", i2c_msgs)
        reads = [message for message in messages if message.flags & _READ_FLAG]
        replies = self.transfer(
            [(message.addr, message.len if message.flags & _READ_FLAG else bytes(message)) for message in messages]
        )
        for message, reply in zip(reads, replies, strict=True):
            ctypes.memmove(message.buf, reply, len(reply))

    def _registers(self, address: int, register: int, count: int) -> bytes:
        return self.transfer([(address, bytes((register,))), (address, count)])[0]

    def _make_ready(self) -> None:
        """Set the bus clock if the board has restarted since it was last set."""
        self._session.board()
        if self._ready_for != self._session.starts:
            self._session.request(Command.I2C_SPEED, struct.pack("<BI", self._number, self._frequency_hz))
            self._ready_for = self._session.starts


def _packed(message: Message) -> bytes:
    address, content = message
    if isinstance(content, int):
        return struct.pack("<BBH", address, _READ, content)
    return struct.pack("<BBH", address, _WRITE, len(content)) + content


def _results(fields: bytes, messages: Sequence[Message]) -> tuple[tuple[int, bytes], ...]:
    """Return status and bytes of every message; ValueError where they do not match the request."""
    if fields[:1] != bytes((len(messages),)):
        raise ValueError(f"{len(messages)} messages expected")
    found = statuses(fields, 1, len(messages))
    for (_, content), (status, data) in zip(messages, found, strict=True):
        MessageStatus(status)
        expected = content if isinstance(content, int) and not status else 0
        if len(data) != expected:
            raise ValueError(f"{len(data)} bytes of a message, {expected} expected")
    return found


def _must_fit_block(length: int) -> None:
    if length > _BLOCK:
        raise ValueError(f"a block holds {_BLOCK} bytes, not {length}")
