"""Rows of a cycler's terminal log: times, counted energy, and missing or stray rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Placed", "Row", "placed"]

_SECONDS_PER_HOUR = 3600.0
_RESOLVED = 4  # least energy per interval, in last digits, at which a missing row is detectable
_RESTS = 0.1  # share of the previous power below which a row is at rest
_STRAY = 3.0  # deviation of a stray row's energy from both neighbours, in intervals' worth


class Row(NamedTuple):
    """A complete row with its context.

    Attributes:
        voltage: voltage [V].
        current: current [A].
        energy: magnitude of the accumulated energy [Wh].
        temperature: temperature [degC].
        digits: decimals of the energy.
        cycle: cycle number of the last mark.
        test: test number, from 0.
        stretch: stretch number, from 0; the time between two stretches is unknown.
        passed: time since the previous row, by row count or device clock [s].
    """

    voltage: float
    current: float
    energy: float
    temperature: float
    digits: int
    cycle: float
    test: int
    stretch: int
    passed: float

    @property
    def power(self) -> float:
        """Power [W], positive for charging."""
        return self.voltage * self.current


class Placed(NamedTuple):
    """Rows with their times; arrays of the same length.

    Attributes:
        rows: the rows kept.
        time: time of each [s].
        energy: net energy counted by the cycler up to each [Wh].
        missing: number of missing rows.
        stray: number of rows dropped because the next one reverts their energy.
    """

    rows: list[Row]
    time: NDArray[np.float64]
    energy: NDArray[np.float64]
    missing: int
    stray: int


def placed(rows: Sequence[Row], interval: float, *, stamped: bool) -> Placed:
    """Return rows with their times and the net energy counted by the cycler.

    The energy of a half-cycle is the field at its end minus that at its beginning, so that torn rows lose none. It
    starts from zero where the field falls to at most two intervals' worth.

    Args:
        rows: at least one row, in the order of the log.
        interval: time between two rows [s].
        stamped: whether rows have device time, so that missing rows do not affect it.
    """
    kept, stray = _without_strays(rows, interval)
    time, energy, missing = np.zeros(len(kept)), np.zeros(len(kept)), 0
    for place in range(1, len(kept)):
        before, row = kept[place - 1], kept[place]
        lost = 0 if stamped else _lost(before, row, interval)
        missing += lost
        time[place] = time[place - 1] + row.passed + lost * interval
        energy[place] = energy[place - 1] + np.copysign(_counted(before, row), _way(before, row))
    return Placed(rows=kept, time=time, energy=energy, missing=missing, stray=stray)


def _without_strays(rows: Sequence[Row], interval: float) -> tuple[list[Row], int]:
    """Drop the rows whose energy deviates from both neighbours, adding their time to the next row."""
    kept, over, stray = list[Row](), 0.0, 0
    for place, row in enumerate(rows):
        if 0 < place < len(rows) - 1 and _is_stray(rows[place - 1], row, rows[place + 1], interval):
            over, stray = over + row.passed, stray + 1
            continue
        kept.append(row._replace(passed=row.passed + over))
        over = 0.0
    return kept, stray


def _is_stray(before: Row, row: Row, after: Row, interval: float) -> bool:
    if not before.stretch == row.stretch == after.stretch or after.energy < before.energy:
        return False
    worth = max(abs(each.power) for each in (before, row, after)) * interval / _SECONDS_PER_HOUR
    least = _STRAY * worth + 2.0 * 10.0**-row.digits
    return row.energy > after.energy + least or row.energy < before.energy - least


def _usual(before: Row, row: Row, seconds: float) -> float:
    return 0.5 * abs(before.power + row.power) * seconds / _SECONDS_PER_HOUR


def _lost(before: Row, row: Row, interval: float) -> int:
    """Return the number of rows missing between two, from the step of the energy."""
    usual = _usual(before, row, interval)
    if before.stretch != row.stretch or before.power * row.power <= 0 or usual < _RESOLVED * 10.0**-row.digits:
        return 0
    return max(round((row.energy - before.energy) / usual) - round(row.passed / interval), 0)


def _way(before: Row, row: Row) -> float:
    """Return a power with the sign of the energy counted between two rows."""
    return before.power if abs(row.power) < _RESTS * abs(before.power) else row.power


def _counted(before: Row, row: Row) -> float:
    """Return the energy counted by the cycler between two rows [Wh]; 0 if unknown."""
    if before.stretch != row.stretch:
        return 0.0
    if row.energy >= before.energy:
        return row.energy - before.energy
    return row.energy if row.energy <= 2.0 * abs(row.power) * row.passed / _SECONDS_PER_HOUR else 0.0
