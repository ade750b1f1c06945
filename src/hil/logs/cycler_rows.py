"""Rows of a cycler's terminal log in the order of the log: which lie in one stretch, and what their energy tells."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Placed", "Row", "placed"]

_SECONDS_PER_HOUR = 3600.0
_RESOLVED = 4  # last digits of the energy that one interval must be worth before a missing row can be seen
_RESTS = 0.1  # part of the power before below which a row rests
_STRAY = 3.0  # intervals' worth by which an energy must leave that of both neighbours to be a bad row


class Row(NamedTuple):
    """A whole row and what stands before it.

    Attributes:
        voltage: V.
        current: A.
        energy: as accumulated, its magnitude in Wh.
        temperature: degC.
        digits: of the energy after the decimal sign.
        cycle: of the last mark.
        test: number of the test, from 0.
        stretch: number of the stretch, from 0; between two stretches the time is not known.
        passed: s since the row before, as rows or the device's clock tell.
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
        """W, above zero where it charges."""
        return self.voltage * self.current


class Placed(NamedTuple):
    """Rows in their time; arrays of one length.

    Attributes:
        rows: those that are kept.
        time: s of each.
        energy: net Wh that the cycler counted up to each.
        missing: how many rows never came.
        stray: how many rows had an energy that the next took back, and are left out.
    """

    rows: list[Row]
    time: NDArray[np.float64]
    energy: NDArray[np.float64]
    missing: int
    stray: int


def placed(rows: Sequence[Row], interval: float, *, stamped: bool) -> Placed:
    """Return rows with their time and the net energy that the cycler counted.

    The energy of each half-cycle is the field at its end less that at its beginning, so that no torn row takes any of
    it. It starts from zero where it falls to what at most two intervals can be worth.

    Args:
        rows: at least one, in the order of the log.
        interval: s between two rows.
        stamped: whether the device told the time, so that no row can be missing from it.
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
    """Leave out the rows whose energy leaves that of both neighbours, and give their time to the next."""
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
    """Return how many rows never came between two, as the jump of the energy tells."""
    usual = _usual(before, row, interval)
    if before.stretch != row.stretch or before.power * row.power <= 0 or usual < _RESOLVED * 10.0**-row.digits:
        return 0
    return max(round((row.energy - before.energy) / usual) - round(row.passed / interval), 0)


def _way(before: Row, row: Row) -> float:
    """Return a power with the sign of what was counted between two rows: after a half-cycle nothing new flows."""
    return before.power if abs(row.power) < _RESTS * abs(before.power) else row.power


def _counted(before: Row, row: Row) -> float:
    """Return what the cycler counted between two rows, in Wh; nothing where that is not known."""
    if before.stretch != row.stretch:
        return 0.0
    if row.energy >= before.energy:
        return row.energy - before.energy
    return row.energy if row.energy <= 2.0 * abs(row.power) * row.passed / _SECONDS_PER_HOUR else 0.0
