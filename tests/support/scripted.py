"""A port and a bus that play one written-down dialogue, byte by byte, on the virtual clock."""

from __future__ import annotations

import errno
from collections.abc import Iterable

from hil.clock.virtual import VirtualClock

__all__ = ["ScriptedBus", "ScriptedPort", "late"]

_NANO = 1_000_000_000


def late(seconds: float, data: bytes) -> tuple[tuple[float, bytes], ...]:
    """Return a reply that comes `seconds` after its request."""
    return ((seconds, data),)


class ScriptedPort:
    """Expects each request in order and answers it; anything else is an AssertionError.

    Args:
        clock: whose time passes while a read waits.
        script: pairs of request and reply; a reply is bytes, `late(...)`, or several (delay, bytes).
    """

    def __init__(self, clock: VirtualClock, script: Iterable[tuple[bytes, object]] = ()) -> None:
        self.timeout = 0.5
        self.clock = clock
        self.script = list(script)
        self.written: list[bytes] = []
        self.longest_wait = 0.0
        self._coming: list[tuple[int, bytes]] = []
        self._here = b""

    @property
    def done(self) -> bool:
        """Whether the whole script was played."""
        return not self.script

    def come(self, data: bytes, after: float = 0.0) -> None:
        """Let bytes come that nobody asked for."""
        self._coming.append((self.clock.now_ns() + round(after * _NANO), data))
        self._coming.sort()

    @property
    def in_waiting(self) -> int:
        """How much is here."""
        self._arrive()
        return len(self._here)

    def write(self, data: bytes) -> int:
        """Compare with the script and schedule its reply."""
        assert self.script, f"{data!r} was written after the end of the script"
        request, reply = self.script.pop(0)
        assert data == request
        self.written.append(data)
        if isinstance(reply, Exception):
            raise reply
        for delay, part in ((0.0, reply),) if isinstance(reply, bytes) else reply:
            if part:
                self.come(part, delay)
        return len(data)

    def exchange(self, data: bytes) -> bytes:
        """Compare with the script, and wait for what comes."""
        self.write(data)
        return self.read(1) + self.read(self.in_waiting)

    def read(self, size: int = 1) -> bytes:
        """Wait for `size` bytes or the timeout."""
        self._wait(lambda: len(self._here) >= size)
        data, self._here = self._here[:size], self._here[size:]
        return data

    def read_line(self, terminator: bytes = b"\n", limit: int = 4096) -> bytes:
        """Wait for a line or the timeout."""
        self._wait(lambda: terminator in self._here)
        end = self._here.find(terminator)
        size = len(self._here) if end < 0 else min(end + len(terminator), limit)
        data, self._here = self._here[:size], self._here[size:]
        return data

    def reset_input_buffer(self) -> None:
        """Forget what is here."""
        self._arrive()
        self._here = b""

    def close(self) -> None:
        """Do nothing."""

    def _wait(self, satisfied) -> None:
        self.longest_wait = max(self.longest_wait, self.timeout)
        deadline = self.clock.now_ns() + round(self.timeout * _NANO)
        self._arrive()
        while not satisfied():
            if not self._coming or self._coming[0][0] > deadline:
                self.clock.wait_until(deadline)
                return
            self.clock.wait_until(self._coming[0][0])
            self._arrive()

    def _arrive(self) -> None:
        while self._coming and self._coming[0][0] <= self.clock.now_ns():
            self._here += self._coming.pop(0)[1]


class ScriptedBus:
    """Expects each message in order; a read names its register and gives what the script says.

    Args:
        address: the only address that acknowledges.
        script: pairs of written bytes and read bytes; None where nothing is read.
    """

    def __init__(self, address: int, script: Iterable[tuple[bytes, bytes | None]] = ()) -> None:
        self.address = address
        self.script = list(script)
        self.last: tuple[bytes, bytes | None] | None = None

    @property
    def done(self) -> bool:
        """Whether the whole script was played."""
        return not self.script

    def repeat_last(self, message: bytes, reply: bytes) -> None:
        """Answer this message with this reply for ever, once the script is over."""
        self.last = (message, reply)

    def read_byte_data(self, i2c_addr: int, register: int) -> int:
        """Play one byte read."""
        return self._play(i2c_addr, bytes((register,)), 1)[0]

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Play one byte write."""
        self._play(i2c_addr, bytes((register, value)), 0)

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: list[int]) -> None:
        """Play one block write."""
        self._play(i2c_addr, bytes((register, *data)), 0)

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Play one block read."""
        return list(self._play(i2c_addr, bytes((register,)), length))

    def _play(self, address: int, message: bytes, count: int) -> bytes:
        if address != self.address:
            raise OSError(errno.EREMOTEIO, "Remote I/O error")
        expected, reply = self.script.pop(0) if self.script else (self.last or (b"", None))
        assert message == expected, f"{message.hex(' ')} was sent, {expected.hex(' ')} expected"
        data = reply or b""
        assert len(data) == count
        return data
