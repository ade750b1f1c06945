"""Reader of a microcontroller cycler's terminal log: `voltage;current;accumulated energy;temperature` and marks."""

from __future__ import annotations

import math
import re
from binascii import crc_hqx
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hil.logs.battery import BatteryLog, lines_of
from hil.model.errors import Refused

__all__ = ["read"]

_CELLS, _SEALED_CELLS = 4, 7
_SECONDS_PER_HOUR = 3600.0
_ROW = re.compile(r"\s*[-+]?\d[-+\d.,eE]*\s*;")
_ITERATION = re.compile(r"\b(?:iteration|cycle)\D*(\d+)", re.IGNORECASE)
_SEALED = re.compile(r"(.*)\*([0-9A-F]{4})")
_WRAP_MS = 2**32
_END = re.compile(r"\bend\b", re.IGNORECASE)
_RESOLVED = 4  # last digits of the energy that one interval must be worth before a missing row can be seen


@dataclass(slots=True)
class _Rows:
    """Rows as they are read; a slot is one interval of the cycler."""

    interval: float
    now: float = 0.0
    device_ms: int | None = None
    cycle: float = 0.0
    numbered: bool = False
    torn: int = 0
    missing: int = 0
    energy: float = 0.0
    headers: int = 0
    starts: int = 0
    stamped: bool = False
    ended: bool = False
    before: tuple[float, float] | None = None  # magnitude of accumulated energy, power
    rows: list[tuple[float, ...]] = field(default_factory=list)

    def row(self, numbers: list[float], digits: int, device_ms: int | None = None) -> None:
        """Take a whole row; rows that are missing before it show in its time, or else as a jump of the energy."""
        voltage, current, energy, temperature = numbers
        power = voltage * current
        self._pass(device_ms)
        if self.before is not None:
            self._follow(abs(energy) - self.before[0], power, self.before[1], digits)
        self.before = (abs(energy), power)
        self.rows.append((self.now, voltage, current, temperature, self.cycle))

    def _pass(self, device_ms: int | None) -> None:
        """Let the time pass that lies before a row: by the device's clock where it tells it, else one interval."""
        since = None
        if device_ms is not None:
            self.stamped = True
            since = None if self.device_ms is None else (device_ms - self.device_ms) % _WRAP_MS
            self.device_ms = device_ms
        if since is not None and since < _WRAP_MS // 2:
            self.now += since / 1000.0
        elif self.rows or self.torn:
            self.now += self.interval

    def _follow(self, jump: float, power: float, before: float, digits: int) -> None:
        if jump < 0:  # begun anew with the next step
            return
        self.energy += math.copysign(jump, power)
        usual = 0.5 * abs(power + before) * self.interval / _SECONDS_PER_HOUR
        if not self.stamped and power * before > 0 and usual >= _RESOLVED * 10.0**-digits:
            lost = max(round(jump / usual) - 1, 0)
            self.now += lost * self.interval
            self.missing += lost

    def tear(self) -> None:
        """Take a torn row: its interval has passed, its numbers are lost."""
        if not self.stamped and (self.rows or self.torn):
            self.now += self.interval
        self.torn += 1
        self.before = None

    def mark(self, text: str) -> None:
        """Take a line that is no row."""
        self.headers += "PuTTY log" in text
        if text.startswith("START ARDUINO"):
            self.starts += 1
            self.device_ms = None
        self.ended |= text.upper().startswith("TEST END")
        found = _ITERATION.search(text)
        if found and not _END.search(text):
            self.cycle, self.numbered = float(found[1]), True


def read(path: Path, *, interval: float = 5.0) -> BatteryLog:
    """Read a terminal log: a row each interval, points or commas as decimal sign.

    Rows with number, device time in ms, state, and CRC-16/IBM-3740 behind a `*` are checked by it and take their time
    from the device. What follows is of rows without.

    Rows are counted to tell the time. A torn row counts as an interval. A row that is missing as a whole is seen in the
    accumulated energy, where its digits resolve one interval; else it makes the test seem shorter. A line that names an
    iteration or a cycle with its number, and not its end, begins that cycle.

    Args:
        path: the file.
        interval: s between two rows.

    Raises:
        Refused: no such file, or not one whole row.
    """
    rows = _Rows(interval=interval)
    for line in lines_of(path):
        _take(rows, line)
    if not rows.rows:
        raise Refused(f"{path}: no row of voltage;current;energy;temperature", "is this the cycler's log?")
    time, voltage, current, temperature, cycle = np.array(rows.rows).T
    return BatteryLog(
        maker="cycler",
        time=time,
        voltage=voltage,
        current=current,
        temperature=temperature,
        cycle=cycle if rows.numbered else None,
        own_energy=rows.energy,
        remarks=_remarks(rows),
    )


def _take(rows: _Rows, line: str) -> None:
    text = line.strip()
    if not text or text[0].isalpha() or ";" not in text:
        rows.mark(text)
        return
    sealed = _SEALED.fullmatch(text)
    cells = (sealed[1] if sealed else text.replace(",", ".")).split(";")
    whole = line[-1] == "\n" and len(cells) == (_SEALED_CELLS if sealed else _CELLS) and _ROW.match(text)
    if sealed and int(sealed[2], 16) != crc_hqx(sealed[1].encode("utf-8"), 0xFFFF):
        whole = None
    try:
        numbers = [float(cell) for cell in cells[:_CELLS]] if whole else []
        device_ms = int(cells[5]) if numbers and sealed else None
    except ValueError:
        numbers, device_ms = [], None
    if not numbers or not all(map(math.isfinite, numbers)):
        rows.tear()
        return
    rows.row(numbers, len(cells[2].strip().partition(".")[2]), device_ms)


def _remarks(rows: _Rows) -> tuple[str, ...]:
    told = [] if rows.stamped else [f"the time is counted from rows, {rows.interval:g} s each"]
    if rows.torn:
        told.append(f"{rows.torn} torn rows are left out, their intervals are counted")
    if rows.missing:
        told.append(f"{rows.missing} missing rows are seen in the accumulated energy, their intervals are counted")
    if rows.headers > 1:
        told.append(f"the terminal began {rows.headers} times to log; how long it was off is not known")
    if rows.starts > 1:
        told.append(f"the cycler started {rows.starts} times; how long it was off is not known")
    if not rows.ended:
        told.append("no TEST END: the test was broken off, or its log was")
    return tuple(told)
