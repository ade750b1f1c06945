"""Paced port, for instruments that drop commands sent too early: every write waits for a pause after the last byte."""

from __future__ import annotations

from hil.clock.port import NANOSECONDS, Clock
from hil.wire.port import Port

__all__ = ["PacedPort"]


class PacedPort:
    """A port that enforces a pause before every write. See `hil.wire.port.Port`.

    Args:
        port: the open byte stream.
        clock: the bench's clock.
        pause: seconds between the last byte, in either direction, and the next write.
    """

    def __init__(self, port: Port, clock: Clock, pause: float) -> None:
        self._port = port
        self._clock = clock
        self._pause_ns = round(pause * NANOSECONDS)
        self._ready_ns = 0

    @property
    def timeout(self) -> float:
        """Read timeout in s."""
        return self._port.timeout

    @timeout.setter
    def timeout(self, seconds: float) -> None:
        self._port.timeout = seconds

    @property
    def in_waiting(self) -> int:
        """The number of bytes that can be read without waiting."""
        return self._port.in_waiting

    def write(self, data: bytes) -> int:
        """Wait for the end of the pause, write all bytes and return their number."""
        self._clock.wait_until(self._ready_ns)
        try:
            return self._port.write(data)
        finally:
            self._hold()

    def exchange(self, data: bytes) -> bytes:
        """Wait for the end of the pause, write all bytes, and return the reply. See `hil.wire.port.Port`."""
        self._clock.wait_until(self._ready_ns)
        try:
            return self._port.exchange(data)
        finally:
            self._hold()

    def read(self, size: int = 1) -> bytes:
        """Return `size` bytes, or fewer at the timeout."""
        data = self._port.read(size)
        if data:
            self._hold()
        return data

    def read_line(self, terminator: bytes = b"\n", limit: int = 4096) -> bytes:
        """Return bytes up to and including `terminator`, or without it at the timeout."""
        data = self._port.read_line(terminator, limit)
        if data:
            self._hold()
        return data

    def reset_input_buffer(self) -> None:
        """Discard received bytes not read yet."""
        self._port.reset_input_buffer()

    def pulse_dtr(self) -> None:
        """Pulse DTR low, and start a pause."""
        self._port.pulse_dtr()
        self._hold()

    def close(self) -> None:
        """Close the stream."""
        self._port.close()

    def _hold(self) -> None:
        self._ready_ns = self._clock.now_ns() + self._pause_ns
