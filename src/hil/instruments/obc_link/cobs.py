"""COBS: bytes without a zero, so that a zero can part frames.

Source: Cheshire and Baker, Consistent Overhead Byte Stuffing, IEEE/ACM Transactions on Networking 7(2), 1999.
"""

from __future__ import annotations

__all__ = ["decode", "encode"]

_FULL = 254
_FULL_CODE = 0xFF


def encode(data: bytes) -> bytes:
    """Return `data` stuffed, without a delimiter; nothing follows a full block that ends the data."""
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


def decode(block: bytes) -> bytes:
    """Return what stands between two delimiters, unstuffed; a final code of 01 behind a full block is allowed.

    Only code bytes are looked at one by one: they become the zeros that they stand for, in place.

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
    for behind in reversed(full):
        del data[behind : behind + 1]  # this code byte followed a full block and stands for no zero
    return bytes(data[1:])


def _full_blocks(part: bytes, stuffed: bytearray) -> bytes:
    """Append the full blocks of `part`, and return what is left of it."""
    while len(part) >= _FULL:
        stuffed.append(_FULL_CODE)
        stuffed += part[:_FULL]
        part = part[_FULL:]
    return part
