"""Modbus requests for registers as a slave answers them (Modbus Application Protocol V1.1b3, sections 6 and 7)."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping

__all__ = ["NoSuchParameter", "Requests"]

_MOST_REGISTERS = 125
_UNKNOWN_FUNCTION, _UNKNOWN_ADDRESS, _BAD_VALUE = 1, 2, 3
_EXCEPTION = 0x80


class NoSuchParameter(Exception):
    """The address is not listed, or cannot be written."""


class _Bad(ValueError):
    """The request's data is not what its function needs."""


class Requests:
    """Answers frames without address and checksum.

    Args:
        read: returns the signed value of an address.
        write: takes address and signed value.
    """

    def __init__(self, read: Callable[[int], int], write: Callable[[int, int], None]) -> None:
        self._read = read
        self._write = write
        self._known: Mapping[int, Callable[[bytes], bytes]] = {
            0x03: self._read_many,
            0x04: self._read_many,
            0x06: self._write_one,
            0x08: self._loop_back,
            0x10: self._write_many,
        }

    def answer(self, function: int, data: bytes) -> bytes:
        """Return function and data of the reply, an exception included."""
        action = self._known.get(function)
        if action is None:
            return bytes((function | _EXCEPTION, _UNKNOWN_FUNCTION))
        try:
            return bytes((function,)) + action(data)
        except NoSuchParameter:
            return bytes((function | _EXCEPTION, _UNKNOWN_ADDRESS))
        except ValueError:
            return bytes((function | _EXCEPTION, _BAD_VALUE))

    def _read_many(self, data: bytes) -> bytes:
        start, count = _words(data, 2)
        if not 1 <= count <= _MOST_REGISTERS:
            raise _Bad(count)
        words = [self._read(address) & 0xFFFF for address in range(start, start + count)]
        return struct.pack(f">B{count}H", 2 * count, *words)

    def _write_one(self, data: bytes) -> bytes:
        address, value = _words(data, 2)
        self._write(address, _signed(value))
        return data

    def _write_many(self, data: bytes) -> bytes:
        start, count = _words(data[:4], 2)
        if not 1 <= count < _MOST_REGISTERS or data[4:5] != bytes((2 * count,)):
            raise _Bad(count)
        for place, value in enumerate(_words(data[5:], count)):
            self._write(start + place, _signed(value))
        return data[:4]

    def _loop_back(self, data: bytes) -> bytes:
        if _words(data, 2)[0] != 0:
            raise _Bad(data)
        return data


def _words(data: bytes, count: int) -> tuple[int, ...]:
    if len(data) != 2 * count:
        raise _Bad(data)
    return struct.unpack(f">{count}H", data)


def _signed(word: int) -> int:
    return int.from_bytes(word.to_bytes(2, "big"), "big", signed=True)
