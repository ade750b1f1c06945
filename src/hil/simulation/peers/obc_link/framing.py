"""Frames of the OBC link as the simulated board makes and takes them: stuffing, checksum, delimiter."""

from __future__ import annotations

import binascii
from collections.abc import Iterator
from dataclasses import dataclass

from hil.wire.checkpoint import Kept, Stateful

__all__ = ["LARGEST", "OVERHEAD", "VERSION", "Frame", "FrameReader", "seal"]

VERSION = 1
OVERHEAD = 6
"""Bytes of a frame around its payload: version, type, sequence, CRC."""

LARGEST = 2048
"""The longest frame before stuffing."""

_LONGEST_ON_LINE = LARGEST + -(-LARGEST // 254)
_FULL = 254
_CODES = tuple(bytes([length + 1]) for length in range(_FULL))


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One frame that arrived whole."""

    version: int
    kind: int
    sequence: int
    payload: bytes


class FrameReader(Stateful):
    """Cuts what arrives at its delimiters; how the bytes are cut on their way does not matter."""

    _held: Kept[bytearray]

    def __init__(self) -> None:
        self._held = bytearray()

    def take(self, data: bytes) -> Iterator[tuple[int, Frame | None]]:
        """Yield what ends in `data`: how many bytes of it come later, and the frame, None where it is unusable."""
        start = 0
        while (end := data.find(0, start)) >= 0:
            self._hold(data[start:end])
            if self._held:
                yield len(data) - end - 1, _opened(bytes(self._held))
            self._held.clear()
            start = end + 1
        self._hold(data[start:])

    def clear(self) -> None:
        """Forget what has not ended."""
        self._held.clear()

    def _hold(self, data: bytes) -> None:
        # One byte more than a frame can have is enough to know that it is none.
        self._held += data[: _LONGEST_ON_LINE + 1 - len(self._held)]


def seal(kind: int, sequence: int, payload: bytes) -> bytes:
    """Return a frame as it stands on the line, delimiter included."""
    body = bytes([VERSION, kind]) + sequence.to_bytes(2, "little") + payload
    return _stuffed(body + _checksum(body)) + b"\0"


def _checksum(data: bytes) -> bytes:
    return binascii.crc_hqx(data, 0xFFFF).to_bytes(2, "little")


def _stuffed(data: bytes) -> bytes:
    """Return the bytes by COBS: each run up to a zero behind its length, full runs without a zero behind them."""
    *runs, last = data.split(b"\0")
    parts = [_CODES[len(run)] + run if len(run) < _FULL else _full_blocks(run) + _rest(run) for run in runs]
    # A full run at the very end needs nothing behind it; before a zero it does, for the zero's sake.
    end = b"" if last and len(last) % _FULL == 0 else _rest(last)
    return b"".join(parts) + _full_blocks(last) + end


def _rest(run: bytes) -> bytes:
    """Return what is behind the full blocks of a run, with its code."""
    rest = run[len(run) // _FULL * _FULL :]
    return _CODES[len(rest)] + rest


def _full_blocks(run: bytes) -> bytes:
    ends = range(_FULL, len(run) + 1, _FULL)
    return b"".join(b"\xff" + run[end - _FULL : end] for end in ends)


def _unstuffed(data: bytes) -> bytes | None:
    plain = bytearray()
    place = code = 0
    while place < len(data):
        code = data[place]
        if place + code > len(data):
            return None
        plain += data[place + 1 : place + code]
        place += code
        if code <= _FULL:
            plain.append(0)
    # The zero of the last block stands for the end; a full last block has none.
    return bytes(plain[:-1] if code <= _FULL else plain)


def _opened(data: bytes) -> Frame | None:
    frame = _unstuffed(data) if len(data) <= _LONGEST_ON_LINE else None
    if frame is None or not OVERHEAD <= len(frame) <= LARGEST or _checksum(frame[:-2]) != frame[-2:]:
        return None
    return Frame(version=frame[0], kind=frame[1], sequence=int.from_bytes(frame[2:4], "little"), payload=frame[4:-2])
