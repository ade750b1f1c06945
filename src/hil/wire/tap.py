"""Taps: the only access to a port or bus, so that no byte passes unrecorded."""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol, TypeVar

from hil.clock.port import Clock
from hil.model.errors import NoReply
from hil.wire.exchange import FarEnd
from hil.wire.port import I2cBus
from hil.wire.transcript import Transcript

if TYPE_CHECKING:
    from smbus2 import i2c_msg

__all__ = ["LONGEST_TRANSACTION", "LONGEST_WAIT", "Opened", "TappedBus", "TappedPort", "message_bytes"]

LONGEST_TRANSACTION = 0.5
"""Longest duration of one operation in s, during which stop flags and monitors are not serviced."""

LONGEST_WAIT = 2.0
"""Longest wait for a reply in s, in several operations with guardian heartbeats in between."""

_DTR_LOW_S = 0.1  # the capacitor at DTR is charged in a few ms
_READ_FLAG = 0x0001
_Result = TypeVar("_Result")


class Opened(Protocol):
    """An open port of `hil.wire.protocols`: the far end of its stream, and its closing."""

    @property
    def end(self) -> FarEnd:
        """The far end."""
        ...

    def close(self) -> None:
        """Close the port."""
        ...


class _Tap:
    """Base of both taps: times an operation, records it with its bytes, and turns a lost port into a fault."""

    def __init__(self, device: str, clock: Clock, transcript: Transcript) -> None:
        self.device = device
        self._clock = clock
        self._now_ns = clock.now_ns
        self._look = clock.look
        self._transcript = transcript
        self._note = transcript.note

    def _operate(
        self,
        name: str,
        operation: Callable[[], _Result],
        *,
        sent: bytes = b"",
        received: Callable[[_Result], bytes] | None = None,
    ) -> _Result:
        start_ns = self._now_ns()
        try:
            result = operation()
        except OSError as error:
            self._failed(name, start_ns, error, sent)
            raise
        self._note(self.device, name, start_ns, self._look(), sent, received(result) if received else b"")
        return result

    def _failed(self, name: str, start_ns: int, error: Exception, sent: bytes = b"") -> None:
        number = getattr(error, "errno", None) or 0
        self._note(self.device, name, start_ns, self._look(), sent, error=f"{number}")


class TappedPort(_Tap):
    """A byte stream with its tap. See `hil.wire.port.Port`.

    Args:
        device: the instrument's name.
        port: the open port, whatever its URL.
        clock: the bench's clock.
        transcript: records the operations.
        timeout: read timeout [s], 2 at most; above 0.5 split into several operations of equal length.

    Attributes:
        silences: number of long reads, as for a reply, that ended without a byte.
    """

    def __init__(
        self,
        device: str,
        port: Opened,
        clock: Clock,
        transcript: Transcript,
        timeout: float = LONGEST_TRANSACTION,
    ) -> None:
        super().__init__(device, clock, transcript)
        self._port = port
        self._end = port.end
        self._ahead = bytearray()
        self._timeout = self._slice_s = -1.0
        self._slices = 1
        self._waits = False
        self.silences = 0
        self.timeout = timeout

    @property
    def timeout(self) -> float:
        """Read timeout in s."""
        return self._timeout

    @timeout.setter
    def timeout(self, seconds: float) -> None:
        if seconds == self._timeout:
            return
        if not 0 <= seconds <= LONGEST_WAIT:
            raise ValueError(f"{self.device}: a timeout is 0 to {LONGEST_WAIT:g} s, not {seconds}")
        self._timeout = seconds
        self._waits = seconds >= LONGEST_TRANSACTION / 2
        self._slices = max(1, math.ceil(seconds / LONGEST_TRANSACTION))
        self._slice_s = seconds / self._slices

    @property
    def in_waiting(self) -> int:
        """The number of bytes that can be read without waiting."""
        start_ns = self._now_ns()
        try:
            waiting = self._end.waiting()
        except OSError as error:
            self._failed("waiting", start_ns, error)
            raise self._gone(error) from error
        now_ns = self._look()
        self._note(self.device, "waiting", start_ns, now_ns, b"", waiting.to_bytes(4))
        return len(self._ahead) + waiting

    def write(self, data: bytes) -> int:
        """Write all bytes and return their number."""
        start_ns = self._now_ns()
        try:
            self._end.write(data)
        except OSError as error:
            self._failed("write", start_ns, error, data)
            raise self._gone(error) from error
        self._note(self.device, "write", start_ns, self._look(), data)
        return len(data)

    def exchange(self, data: bytes) -> bytes:
        """Write all bytes, and return the first byte received within the timeout and all that arrived with it."""
        start_ns = self._now_ns()
        try:
            received = self._end.exchange(data, self._slice_s)
        except OSError as error:
            self._failed("exchange", start_ns, error, data)
            raise self._gone(error) from error
        self._note(self.device, "exchange", start_ns, self._now_ns(), data, received)
        if not received and (first := self._read_on(1)):
            received = first + self.read(self.in_waiting)
        self.silences += self._waits and not received
        return received

    def read(self, size: int = 1) -> bytes:
        """Return `size` bytes, or fewer at the timeout."""
        if not self._ahead:
            return self._read(size) if size else b""
        ahead = bytes(self._ahead[:size])
        del self._ahead[:size]
        missing = size - len(ahead)
        return ahead + self._read(missing) if missing else ahead

    def read_line(self, terminator: bytes = b"\n", limit: int = 4096) -> bytes:
        """Return bytes up to and including `terminator`, or without it at the timeout."""
        while (end := self._ahead.find(terminator)) < 0 and len(self._ahead) < limit:
            first = self._read(1)
            if not first:
                return self.read(len(self._ahead)) if self._ahead else b""
            self._ahead += first
            if more := self.in_waiting - len(self._ahead):
                self._ahead += self._read(more)
        return self.read(end + len(terminator) if end >= 0 else limit)

    def reset_input_buffer(self) -> None:
        """Discard received bytes not read yet."""
        self._ahead.clear()
        self._guard(lambda: self._operate("discard", self._end.discard))

    def pulse_dtr(self) -> None:
        """Pulse the modem line DTR low for 0.1 s."""
        self._guard(lambda: self._operate("pulse_dtr", self._pulse))

    def close(self) -> None:
        """Close the stream."""
        self._port.close()

    def _pulse(self) -> None:
        self._clock.sleep(_DTR_LOW_S)
        self._end.dtr_rose()

    def _read(self, size: int) -> bytes:
        data = self._read_once(size)
        if self._slices > 1 and len(data) < size:
            data += self._read_on(size - len(data))
        self.silences += self._waits and not data
        return data

    def _read_on(self, size: int) -> bytes:
        """Read in the operations left of the timeout after the first, until complete."""
        data = b""
        for _ in range(self._slices - 1):
            data += self._read_once(size - len(data))
            if len(data) == size:
                break
        return data

    def _read_once(self, size: int) -> bytes:
        start_ns = self._now_ns()
        try:
            data = self._end.read(size, self._slice_s)
        except OSError as error:
            self._failed("read", start_ns, error)
            raise self._gone(error) from error
        self._note(self.device, "read", start_ns, self._look(), b"", data)
        return data

    def _guard(self, operation: Callable[[], None]) -> None:
        try:
            operation()
        except OSError as error:
            raise self._gone(error) from error

    def _gone(self, error: Exception) -> NoReply:
        """Return the fault of a lost port, from the transcript's content only, so that a replay reports the same."""
        number = getattr(error, "errno", None)
        if number == errno.EINTR:
            return NoReply(self.device, "not asked, because somebody asked to stop", "see who stopped it, and why")
        if number == errno.ECANCELED:
            return NoReply(self.device, "not asked, because nobody can look after the bench", "see what was lost")
        if number == errno.EAGAIN:
            return NoReply(self.device, "its port takes no more bytes", "check its power, cable and flow control")
        why = f" ({os.strerror(number)})" if number else ""
        return NoReply(self.device, f"its port is gone{why}", "check cable, power and hub", gone=True)


class TappedBus(_Tap):
    """One device's view of an I2C bus, with its tap. See `hil.wire.port.I2cBus`."""

    def __init__(self, device: str, bus: I2cBus, clock: Clock, transcript: Transcript) -> None:
        super().__init__(device, clock, transcript)
        self._bus = bus

    def read_byte(self, i2c_addr: int) -> int:
        """Read one byte without a register address."""
        return self._number("read_byte", lambda: self._bus.read_byte(i2c_addr), 1, bytes([i2c_addr]))

    def write_byte(self, i2c_addr: int, value: int) -> None:
        """Write one byte without a register address."""
        self._operate("write_byte", lambda: self._bus.write_byte(i2c_addr, value), sent=bytes([i2c_addr, value]))

    def read_byte_data(self, i2c_addr: int, register: int) -> int:
        """Read one byte from a register."""
        sent = bytes([i2c_addr, register])
        return self._number("read_byte_data", lambda: self._bus.read_byte_data(i2c_addr, register), 1, sent)

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Write one byte to a register."""
        self._operate(
            "write_byte_data",
            lambda: self._bus.write_byte_data(i2c_addr, register, value),
            sent=bytes([i2c_addr, register, value]),
        )

    def read_word_data(self, i2c_addr: int, register: int) -> int:
        """Read two bytes starting at a register, low byte first."""
        sent = bytes([i2c_addr, register])
        return self._number("read_word_data", lambda: self._bus.read_word_data(i2c_addr, register), 2, sent)

    def write_word_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Write two bytes starting at a register, low byte first."""
        self._operate(
            "write_word_data",
            lambda: self._bus.write_word_data(i2c_addr, register, value),
            sent=bytes([i2c_addr, register]) + value.to_bytes(2, "little"),
        )

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Read up to 32 bytes starting at a register."""
        return self._operate(
            "read_i2c_block_data",
            lambda: self._bus.read_i2c_block_data(i2c_addr, register, length),
            sent=bytes([i2c_addr, register, length]),
            received=bytes,
        )

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Write up to 32 bytes starting at a register."""
        self._operate(
            "write_i2c_block_data",
            lambda: self._bus.write_i2c_block_data(i2c_addr, register, data),
            sent=bytes([i2c_addr, register, *data]),
        )

    def i2c_rdwr(self, *i2c_msgs: i2c_msg) -> None:
        """Run combined messages of smbus2 with repeated starts; reads fill their message."""
        self._operate(
            "i2c_rdwr",
            lambda: self._bus.i2c_rdwr(*i2c_msgs),
            sent=message_bytes(i2c_msgs),
            received=lambda _: b"".join(bytes(message) for message in i2c_msgs if message.flags & _READ_FLAG),
        )

    def _number(self, name: str, operation: Callable[[], int], size: int, sent: bytes) -> int:
        return self._operate(name, operation, sent=sent, received=lambda number: number.to_bytes(size, "little"))


def message_bytes(messages: Sequence[i2c_msg]) -> bytes:
    """Return the identifying bytes of combined messages: address, direction, length, and data written."""
    parts = []
    for message in messages:
        reading = message.flags & _READ_FLAG
        parts.append(bytes([message.addr, reading]) + message.len.to_bytes(2, "little"))
        parts.append(b"" if reading else bytes(message))
    return b"".join(parts)
