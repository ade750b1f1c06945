"""Frames of the OBC link: version, type, sequence, payload and CRC, stuffed and delimited."""

from __future__ import annotations

import struct
from binascii import crc_hqx
from typing import NamedTuple

__all__ = [
    "DELIMITER",
    "LONGEST",
    "MAJOR",
    "OVERHEAD",
    "Frame",
    "FrameReader",
    "crc",
    "seal",
    "stuff",
    "unseal",
    "unstuff",
]

_FULL = 254
_FULL_CODE = 0xFF
MAJOR = 1
"""Major protocol version of this driver."""

DELIMITER = b"\0"
LONGEST = 2048
"""The largest frame of the protocol in bytes, before stuffing."""

OVERHEAD = 6
"""Overhead of a frame in bytes: everything but the payload."""

_LONGEST_STUFFED = LONGEST + LONGEST // 254 + 1
_HEAD = struct.Struct("<BBH")


def stuff(data: bytes) -> bytes:
    """Return `data` COBS-encoded, without zeros, so that a zero can delimit frames; no code follows a final full block.

    Source: Cheshire and Baker, Consistent Overhead Byte Stuffing, IEEE/ACM Transactions on Networking 7(2), 1999.
    """
    stuffed = bytearray()
    *others, last = data.split(b"\0")
    for part in others:
        rest = _full_blocks(part, stuffed)
        stuffed.append(len(rest) + 1)
        stuffed += rest
    rest = _full_blocks(last, stuffed)
    if rest or not last:
        stuffed.append(len(rest) + 1)
        stuffed += rest
    return bytes(stuffed)


def unstuff(block: bytes) -> bytes:
    """Return the COBS-decoded bytes between two delimiters; a final code of 01 after a full block is allowed.

    Only code bytes are visited one by one: each is replaced in place by the zero that it stands for.

    Raises:
        ValueError: the block is empty, has a zero, or a code points beyond its end.
    """
    data = bytearray(block)
    end = len(block)
    full: list[int] = []
    at = 0
    while at < end:
        code = block[at]
        if not code:
            raise ValueError("a zero within a block")
        data[at] = 0
        at += code
        if code == _FULL_CODE:
            full.append(at)
    if at != end or not end:
        raise ValueError("a block that is cut short")
    for place in reversed(full):
        del data[place : place + 1]  # this code byte followed a full block and stands for no zero
    return bytes(data[1:])


def _full_blocks(part: bytes, stuffed: bytearray) -> bytes:
    """Append the full blocks of `part`, and return the remainder."""
    while len(part) >= _FULL:
        stuffed.append(_FULL_CODE)
        stuffed += part[:_FULL]
        part = part[_FULL:]
    return part


class Frame(NamedTuple):
    """One frame: major version, type, sequence, payload."""

    version: int
    kind: int
    sequence: int
    payload: bytes


def crc(data: bytes) -> int:
    """Return CRC-16/CCITT-FALSE: polynomial 1021, initial value FFFF; 29B1 for `123456789`."""
    return crc_hqx(data, 0xFFFF)


def seal(kind: int, sequence: int, payload: bytes = b"") -> bytes:
    """Return a frame as sent on the line, with its delimiter."""
    data = _HEAD.pack(MAJOR, kind, sequence) + payload
    return stuff(data + crc(data).to_bytes(2, "little")) + DELIMITER


def unseal(block: bytes) -> Frame:
    """Return the frame between two delimiters.

    Raises:
        ValueError: it is not a valid frame.
    """
    data = unstuff(block)
    if not OVERHEAD <= len(data) <= LONGEST:
        raise ValueError(f"{len(data)} bytes are no frame")
    if crc(data[:-2]) != int.from_bytes(data[-2:], "little"):
        raise ValueError("a wrong CRC")
    version, kind, sequence = _HEAD.unpack_from(data)
    return Frame(version, kind, sequence, data[_HEAD.size : -2])


class FrameReader:
    """Splits a byte stream, in chunks of any size, into frames; blocks that are not frames count as `damaged`."""

    def __init__(self) -> None:
        self.damaged = 0
        self._rest = b""

    def feed(self, data: bytes) -> list[Frame]:
        """Take bytes, and return the frames that they complete, in order."""
        *blocks, rest = (self._rest + data).split(DELIMITER)
        # An overlong block stays overlong when truncated here, and is counted at its delimiter.
        self._rest = rest[: _LONGEST_STUFFED + 1]
        frames = []
        for block in filter(None, blocks):
            try:
                frames.append(unseal(block))
            except ValueError:
                self.damaged += 1
        return frames
