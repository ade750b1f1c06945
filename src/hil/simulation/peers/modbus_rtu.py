"""Modbus RTU as a slave on the line sees it: frames between silences, and their checksum.

Modbus over Serial Line V1.02, sections 2.5.1.1 (silence of 3.5 characters ends a frame) and 6.2.2 (CRC).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

from hil.clock.port import NANOSECONDS
from hil.simulation.peers.timing import Alarm
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import PeerClock

__all__ = ["FrameReader", "checked", "seal"]

_BITS_PER_CHARACTER = 11
_FAST_BAUD = 19_200
_FAST_SILENCE_NS = 1_750_000
_SHORTEST, _LONGEST = 4, 256


def _table_entry(byte: int) -> int:
    for _ in range(8):
        byte = (byte >> 1) ^ (0xA001 if byte & 1 else 0)
    return byte


_TABLE = tuple(map(_table_entry, range(256)))


@lru_cache(maxsize=1024)
def _crc(data: bytes) -> int:
    """Return the CRC-16 of Modbus: polynomial 0xA001 reflected, start 0xFFFF."""
    register = 0xFFFF
    for byte in data:
        register = register >> 8 ^ _TABLE[(register ^ byte) & 0xFF]
    return register


def seal(body: bytes) -> bytes:
    """Return a frame: address, function and data with the checksum, low byte first."""
    return body + _crc(body).to_bytes(2, "little")


def checked(frame: bytes) -> bytes | None:
    """Return a frame without its checksum, or None for what is not a frame or was spoiled."""
    if not _SHORTEST <= len(frame) <= _LONGEST or seal(frame[:-2]) != frame:
        return None
    return frame[:-2]


class FrameReader(Stateful):
    """Collects bytes until the line has been silent for 3.5 characters.

    Args:
        baud: bits per second; above 19,200 the silence is 1.75 ms.
        take: gets every frame, whatever it is worth.
    """

    _bytes: Kept[bytes]
    _end: Kept[Alarm]

    def __init__(self, baud: int, take: Callable[[bytes], None]) -> None:
        slow_ns = round(3.5 * _BITS_PER_CHARACTER * NANOSECONDS / baud)
        self._silence_ns = _FAST_SILENCE_NS if baud > _FAST_BAUD else slow_ns
        self._take = take
        self._bytes = b""
        self._clock: PeerClock

    def attach(self, clock: PeerClock) -> None:
        """Connect the clock."""
        self._clock = clock
        self._end = Alarm(clock, self._finish)

    def receive(self, data: bytes) -> None:
        """Take bytes; the frame ends when nothing follows."""
        # One byte beyond the longest frame is enough to know that it is none.
        self._bytes = (self._bytes + data)[: _LONGEST + 1]
        self._end.set(self._clock.now_ns() + self._silence_ns)

    def _finish(self) -> None:
        frame, self._bytes = self._bytes, b""
        self._take(frame)
