"""Lines of a cycler: checksum, banner, fields and numbers."""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["BANNER", "LINE_S", "RUNNING", "Banner", "Reading", "Told", "fields_of", "opened", "plain_numbers", "seal"]

BANNER = b"START ARDUINO"
"""Start of the line that a device sends after a reset; level 2 appends fields."""

LINE_S = 5.0
"""Seconds of device time from one data line to the next."""

_INITIAL = 0xFFFF
_BANNER_FIELDS = 9
_PLAIN = frozenset(b"0123456789")
RUNNING = frozenset({"charge", "rest", "discharge"})
"""States in which a test runs."""

Reading = tuple[float, float, float, float]
"""Voltage in V, current in A, energy in W.h, temperature in degC."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Banner:
    """Identification of a level 2 device.

    Attributes:
        level: protocol level.
        name: device name.
        firmware: firmware version.
        serial: serial number.
        boots: boot counter.
        reset: reason of its last reset.
    """

    level: str
    name: str
    firmware: str
    serial: str
    boots: int
    reset: str

    @classmethod
    def of_mark(cls, body: bytes) -> Banner:
        """Parse the banner line; ValueError where it is not one."""
        told = body.decode("ascii").split(";")
        if len(told) != _BANNER_FIELDS:
            raise ValueError(f"{len(told)} fields of a banner, {_BANNER_FIELDS} expected")
        level, name, firmware, serial, boots, reset = told[3:]
        return cls(level=level, name=name, firmware=firmware, serial=serial, boots=int(boots), reset=reset)

    @classmethod
    def of_reply(cls, told: Mapping[str, str]) -> Banner:
        """Parse the reply to ID; ValueError or KeyError where it is not one."""
        return cls(
            level=told["level"],
            name=told["name"],
            firmware=told["firmware"],
            serial=told["serial"],
            boots=int(told["boots"]),
            reset=told["reset"],
        )


def seal(text: str) -> bytes:
    """Return a host line with its CRC-16/IBM-3740 (CRC-CCITT in the standard library) and line end."""
    data = text.encode("ascii")
    return b"%b*%04X\n" % (data, crc_hqx(data, _INITIAL))


def opened(line: bytes) -> bytes | None:
    """Return a level 2 line without its checksum, None where that is missing or wrong."""
    body = line[:-5]
    if body and line[-5:-4] == b"*" and b"%04X" % crc_hqx(body, _INITIAL) == line[-4:]:
        return body
    return None


def fields_of(words: str) -> dict[str, str]:
    """Return the `name=value` fields of a reply; ValueError where a word is not a field."""
    fields = {}
    for word in words.split():
        name, separator, value = word.partition("=")
        if not separator:
            raise ValueError(f"'{word}' is no field")
        fields[name] = value
    return fields


def plain_numbers(line: bytes) -> tuple[float, float, float, float] | None:
    """Return the four numbers of a level 1 data line, None if it is not one.

    Every field is digits with one decimal point, and may begin with `-`; the number of decimals is left open. A line
    that lost bytes can still look like one.
    """
    fields = line.split(b";")
    if len(fields) != 4:
        return None
    for field in fields:
        whole, _, part = field.removeprefix(b"-").partition(b".")
        if not whole or not part or not _PLAIN.issuperset(whole + part):
            return None
    first, second, third, fourth = map(float, fields)
    return first, second, third, fourth


class Told:
    """What a device has reported: its present state, the newest reading, and the rows not yet fetched.

    Attributes:
        state: in the role's words.
        phase: 1 in a charge, -1 in a discharge, 0 in neither.
        cycle: counted from 1, 0 before the first.
        reading: the newest numbers, None once they are out of date.
        read_s: bench time at which they were read.
        heard_s: bench time of the newest intact line.
        recording: whether rows are kept.
        rows: the rows in one flat list: time, reading, phase, cycle.
        frames: lines received while rows are kept.
        lost: lines missing or damaged while rows are kept.
        damaged: total number of damaged lines.
        started: banners not handled yet; None for a level 1 banner.
    """

    def __init__(self, now: float) -> None:
        self.state = "idle"
        self.phase = 0.0
        self.cycle = 0.0
        self.reading: Reading | None = None
        self.read_s = now
        self.heard_s = now
        self.recording = False
        self.rows: list[float] = []
        self.frames = 0
        self.lost = 0
        self.damaged = 0
        self.started: list[Banner | None] = []

    @property
    def running(self) -> bool:
        """Whether a test is running."""
        return self.state in RUNNING

    def charging(self, cycle: float) -> None:
        """Note the start of a cycle."""
        self.state, self.phase, self.cycle = "charge", 1.0, cycle

    def over(self, state: str) -> None:
        """Note that no test is running, which makes the last reading out of date."""
        self.state, self.phase, self.reading = state, 0.0, None

    def restart(self, banner: Banner | None) -> None:
        """Note that the device has started, so that no test is running."""
        self.over("idle")
        self.cycle = 0.0
        self.started.append(banner)

    def take_rows(self) -> list[float]:
        """Return the rows received since the last call."""
        rows, self.rows = self.rows, []
        return rows

    def record(self) -> None:
        """Keep rows from now on, with the counters reset."""
        self.rows = []
        self.frames = self.lost = 0
        self.recording = True
