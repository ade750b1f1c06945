"""Reader of a microcontroller cycler's terminal log: `voltage;current;accumulated energy;temperature` and marks."""

from __future__ import annotations

import math
import re
from binascii import crc_hqx
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hil.logs.battery import BatteryLog, lines_of
from hil.logs.cycler_rows import Placed, Row, placed
from hil.model.errors import Refused

__all__ = ["read"]

_CELLS, _SEALED_CELLS = 4, 7
_ROW = re.compile(r"\s*[-+]?\d[-+\d.,eE]*\s*;")
_ITERATION = re.compile(r"\b(?:iteration|cycle)(?![a-z])\D*(\d+)", re.IGNORECASE)
_SEALED = re.compile(r"(.*)\*([0-9A-F]{4})")
_WRAP_MS = 2**32
_END = re.compile(r"\bend\b", re.IGNORECASE)


@dataclass(slots=True)
class _Rows:
    """Parser state: rows read so far, and the state set by the marks between them."""

    interval: float
    device_ms: int | None = None
    cycle: float = 0.0
    test: int = 0
    stretch: int = 0
    passed: float = 0.0
    marked: dict[int, bool] = field(default_factory=dict)  # whether a mark numbered its cycles, by test
    blind: int | None = None  # first row of a stretch whose cycle is not marked yet
    torn: int = 0
    headers: int = 0
    starts: int = 0
    stamped: bool = False
    ended: bool = False
    rows: list[Row] = field(default_factory=list)

    def row(self, numbers: list[float], digits: int, device_ms: int | None = None) -> None:
        """Take a complete row."""
        voltage, current, energy, temperature = numbers
        self._pass(device_ms)
        self.rows.append(
            Row(voltage, current, abs(energy), temperature, digits, self.cycle, self.test, self.stretch, self.passed)
        )
        self.passed = 0.0
        self.marked.setdefault(self.test, False)

    def _pass(self, device_ms: int | None) -> None:
        """Advance time to a row: by the device's clock if present, otherwise by one interval."""
        since = None
        if device_ms is not None:
            self.stamped = True
            since = None if self.device_ms is None else (device_ms - self.device_ms) % _WRAP_MS
            self.device_ms = device_ms
        if since is not None and since < _WRAP_MS // 2:
            self.passed = since / 1000.0
        elif self.rows or self.torn:
            self.passed += self.interval

    def tear(self) -> None:
        """Take a torn row: its interval counts, its numbers are lost."""
        if not self.stamped and (self.rows or self.torn):
            self.passed += self.interval
        self.torn += 1

    def mark(self, text: str, *, again: bool) -> None:
        """Take a line that is not a row; `again` if it may be a duplicate."""
        if "PuTTY log" in text:
            self.headers += 1
            self._break(new_test=False)
            return
        if text.startswith("START ARDUINO"):
            self.starts += 1
            self.device_ms = None
            self._break(new_test=True)
            return
        self.ended |= text.upper().startswith("TEST END")
        found = _ITERATION.search(text)
        if found and not _END.search(text):
            self._iterate(float(found[1]), repeats=text.upper().startswith("TEST ITERATION") and not again)

    def _break(self, *, new_test: bool) -> None:
        """End the stretch: a new test follows, or the same one after an unknown time."""
        if not self.rows:
            return
        if self.rows[-1].stretch == self.stretch:
            self.stretch += 1
        if new_test:
            self.test, self.cycle, self.blind = self.rows[-1].test + 1, 0.0, None
        elif self.test == self.rows[-1].test:
            self.blind = len(self.rows)

    def _iterate(self, number: float, *, repeats: bool) -> None:
        """Begin a cycle; a number out of sequence begins a new test."""
        here = self.rows and self.rows[-1].test == self.test and self.marked.get(self.test)
        if here and self.blind is not None and number > self.cycle:
            # No mark was missed since: the rows before this one belong to the previous cycle.
            self.rows[self.blind :] = [row._replace(cycle=number - 1.0) for row in self.rows[self.blind :]]
        elif here and (number not in {self.cycle, self.cycle + 1.0} or (number == self.cycle and repeats)):
            self._break(new_test=True)
        self.cycle, self.blind = number, None
        self.marked[self.test] = True


def read(path: Path, *, interval: float = 5.0) -> BatteryLog:
    """Read a terminal log with one row per interval, and decimal points or commas.

    Rows with number, device time in ms, state, and CRC-16/IBM-3740 after a `*` are verified by the CRC and use device
    time. The following applies to rows without these.

    Time is derived by counting rows. A torn row counts as one interval. A missing row is detected by the accumulated
    energy if its digits resolve one interval; otherwise the test appears shorter. A line with the number of an
    iteration or cycle, and not its end, begins that cycle. A start, or a number out of sequence, begins a new test;
    after a header of the terminal the same test continues after an unknown time.

    Args:
        path: the file.
        interval: time between two rows [s].

    Raises:
        Refused: no such file, or no complete row.
    """
    rows = _Rows(interval=interval)
    for line in lines_of(path):
        _take(rows, line)
    if not rows.rows:
        raise Refused(f"{path}: no row of voltage;current;energy;temperature", "is this the cycler's log?")
    found = placed(rows.rows, interval, stamped=rows.stamped)
    columns = dict(zip(Row._fields, np.array(found.rows).T, strict=True))
    return BatteryLog(
        maker="cycler",
        time=found.time,
        voltage=columns["voltage"],
        current=columns["current"],
        temperature=columns["temperature"],
        cycle=columns["cycle"] if all(rows.marked[row.test] for row in found.rows) else None,
        own_energy=float(found.energy[-1]),
        energy=found.energy,
        test=columns["test"].astype(np.int64),
        stretch=columns["stretch"].astype(np.int64),
        remarks=_remarks(rows, found),
    )


def _take(rows: _Rows, line: str) -> None:
    text = line.strip()
    sealed = _SEALED.fullmatch(text)
    if not text or text[0].isalpha() or ";" not in text or "PuTTY log" in text:
        rows.mark(text, again=sealed is not None)
        return
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


def _remarks(rows: _Rows, found: Placed) -> tuple[str, ...]:
    told = [] if rows.stamped else [f"the time is counted from rows, {rows.interval:g} s each"]
    for number, one, many in (
        (rows.torn, "torn row is left out, its interval is", "torn rows are left out, their intervals are"),
        (
            found.stray,
            "row with an accumulated energy that the next takes back is left out, its interval is",
            "rows with an accumulated energy that the next takes back are left out, their intervals are",
        ),
        (
            found.missing,
            "missing row is seen in the accumulated energy, its interval is",
            "missing rows are seen in the accumulated energy, their intervals are",
        ),
    ):
        if number:
            told.append(f"{number} {one if number == 1 else many} counted")
    if rows.headers > 1:
        told.append(f"the terminal began {rows.headers} times to log; how long it was off is not known")
    if rows.starts > 1:
        told.append(f"the cycler started {rows.starts} times; how long it was off is not known")
    if not rows.ended:
        told.append("no TEST END: the test was broken off, or its log was")
    return tuple(told)
