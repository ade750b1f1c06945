"""Lines of level 2 as the simulated cycler reads and seals them."""

from __future__ import annotations

import re
from binascii import crc_hqx
from dataclasses import dataclass

from hil.wire.checkpoint import Kept, Stateful

__all__ = ["Command", "LineReader", "crc", "parse", "seal"]

_LONGEST = 64
_HIGHEST_TAG = 65_535
_LINE = re.compile(rb"(:(0|[1-9][0-9]{0,4}) ([!-~]+(?: [!-~]+)*))\*([0-9A-F]{4})")


def crc(data: bytes) -> str:
    """Return the CRC-16/IBM-3740 of some bytes as four hexadecimal digits."""
    return f"{crc_hqx(data, 0xFFFF):04X}"


def seal(data: bytes) -> bytes:
    """Return a line of the device with its CRC and its end."""
    return b"%b*%04X\r\n" % (data, crc_hqx(data, 0xFFFF))


@dataclass(frozen=True, slots=True)
class Command:
    """One line of the host: its tag, the command, and its fields."""

    tag: str
    name: str
    fields: tuple[str, ...]


def parse(line: bytes) -> Command | None:
    """Return what a line says, or None if it is no line of a host; its end is not part of it."""
    match = _LINE.fullmatch(line)
    if match is None or int(match[2]) > _HIGHEST_TAG or crc(match[1]) != match[4].decode("ascii"):
        return None
    name, *fields = match[3].decode("ascii").split(" ")
    return Command(match[2].decode("ascii"), name, tuple(fields))


class LineReader(Stateful):
    """Cuts what comes into lines; of a line that is too long only so much is kept that it is seen to be."""

    _rest: Kept[bytes]

    def __init__(self) -> None:
        self._rest = b""

    def clear(self) -> None:
        """Forget an unfinished line."""
        self._rest = b""

    def take(self, data: bytes) -> list[Command | None]:
        """Return the lines that are complete with these bytes, None for what is no line of a host."""
        *lines, rest = (self._rest + data).split(b"\n")
        self._rest = rest[:_LONGEST]
        return [None if len(line) >= _LONGEST else parse(line.removesuffix(b"\r")) for line in lines if _holds(line)]


def _holds(line: bytes) -> bool:
    return line not in {b"", b"\r"}
