"""Modbus RTU as a slave on the line sees it: frames between silences, and their checksum.

Modbus over Serial Line V1.02, sections 2.5.1.1 (silence of 3.5 characters ends a frame) and 6.2.2 (CRC).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import cast

from hil.clock.port import NANOSECONDS
from hil.simulation.peers.alarm import Alarm
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
    """Return a frame without its checksum, or None for what is no frame or was spoiled."""
    if not _SHORTEST <= len(frame) <= _LONGEST or seal(frame[:-2]) != frame:
        return None
    return frame[:-2]


class FrameReader:
    """Collects bytes until the line has been silent for 3.5 characters.

    Args:
        baud: bits per second; above 19,200 the silence is 1.75 ms.
        take: gets every frame, whatever it is worth.
    """

    def __init__(self, baud: int, take: Callable[[bytes], None]) -> None:
        slow_ns = round(3.5 * _BITS_PER_CHARACTER * NANOSECONDS / baud)
        self._silence_ns = _FAST_SILENCE_NS if baud > _FAST_BAUD else slow_ns
        self._take = take
        self._bytes = b""
        self._end: Alarm | None = None

    def receive(self, data: bytes, clock: PeerClock) -> None:
        """Take bytes; the frame ends when nothing follows."""
        # One byte beyond the longest frame is enough to know that it is none.
        self._bytes = (self._bytes + data)[: _LONGEST + 1]
        self._silence(clock).set(clock.now_ns() + self._silence_ns)

    def state(self) -> Mapping[str, object]:
        """Return the unfinished frame."""
        return {"bytes": self._bytes.hex(), "end": None if self._end is None else self._end.state()}

    def restore(self, state: Mapping[str, object], clock: PeerClock) -> None:
        """Go on from what `state` returned."""
        self._bytes = bytes.fromhex(cast("str", state["bytes"]))
        self._silence(clock).restore(state["end"])

    def _silence(self, clock: PeerClock) -> Alarm:
        if self._end is None:
            self._end = Alarm(clock, self._finish)
        return self._end

    def _finish(self) -> None:
        frame, self._bytes = self._bytes, b""
        self._take(frame)
