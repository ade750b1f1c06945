"""Reader of a microcontroller cycler's terminal log: `voltage;current;accumulated energy;temperature` and marks."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hil.logs.battery import BatteryLog, lines_of
from hil.model.errors import Refused

__all__ = ["read"]

_CELLS = 4
_SECONDS_PER_HOUR = 3600.0
_ROW = re.compile(r"\s*[-+]?\d[-+\d.,eE]*\s*;")
_ITERATION = re.compile(r"\b(?:iteration|cycle)\D*(\d+)", re.IGNORECASE)
_END = re.compile(r"\bend\b", re.IGNORECASE)
_RESOLVED = 4  # last digits of the energy that one interval must be worth before a missing row can be seen


@dataclass(slots=True)
class _Rows:
    """Rows as they are read; a slot is one interval of the cycler."""

    interval: float
    slot: int = -1
    cycle: float = 0.0
    numbered: bool = False
    torn: int = 0
    missing: int = 0
    energy: float = 0.0
    headers: int = 0
    ended: bool = False
    before: tuple[float, float] | None = None  # magnitude of accumulated energy, power
    rows: list[tuple[float, ...]] = field(default_factory=list)

    def row(self, numbers: list[float], digits: int) -> None:
        """Take a whole row; rows that are missing before it show as a jump of the energy."""
        voltage, current, energy, temperature = numbers
        power = voltage * current
        self.slot += 1
        if self.before is not None:
            self._follow(abs(energy) - self.before[0], power, self.before[1], digits)
        self.before = (abs(energy), power)
        self.rows.append((self.slot * self.interval, voltage, current, temperature, self.cycle))

    def _follow(self, jump: float, power: float, before: float, digits: int) -> None:
        if jump < 0:  # begun anew with the next step
            return
        self.energy += math.copysign(jump, power)
        usual = 0.5 * abs(power + before) * self.interval / _SECONDS_PER_HOUR
        if power * before > 0 and usual >= _RESOLVED * 10.0**-digits:
            lost = max(round(jump / usual) - 1, 0)
            self.slot += lost
            self.missing += lost

    def tear(self) -> None:
        """Take a torn row: its interval has passed, its numbers are lost."""
        self.slot += 1
        self.torn += 1
        self.before = None

    def mark(self, text: str) -> None:
        """Take a line that is no row."""
        self.headers += "PuTTY log" in text
        self.ended |= text.upper().startswith("TEST END")
        found = _ITERATION.search(text)
        if found and not _END.search(text):
            self.cycle, self.numbered = float(found[1]), True


def read(path: Path, *, interval: float = 5.0) -> BatteryLog:
    """Read a terminal log without timestamps: a row each interval, points or commas as decimal sign.

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
    if not _ROW.match(text):
        # A row that lost its beginning still holds a semicolon; a mark does not.
        rows.tear() if ";" in text else rows.mark(text)
        return
    cells = text.replace(",", ".").split(";")
    try:
        numbers = [float(cell) for cell in cells]
    except ValueError:
        numbers = []
    if len(numbers) != _CELLS or not all(map(math.isfinite, numbers)) or line[-1] != "\n":
        rows.tear()
        return
    rows.row(numbers, len(cells[2].strip().partition(".")[2]))


def _remarks(rows: _Rows) -> tuple[str, ...]:
    told = [f"the time is counted from rows, {rows.interval:g} s each"]
    if rows.torn:
        told.append(f"{rows.torn} torn rows are left out, their intervals are counted")
    if rows.missing:
        told.append(f"{rows.missing} missing rows are seen in the accumulated energy, their intervals are counted")
    if rows.headers > 1:
        told.append(f"the terminal began {rows.headers} times to log; how long it was off is not known")
    if not rows.ended:
        told.append("no TEST END: the test was broken off, or its log was")
    return tuple(told)
