"""Voltage and current of a cell over time, as the analyses of batteries take them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.tracing import traced
from hil.model.errors import Refused

__all__ = ["SECONDS_PER_HOUR", "Series", "can_be_warm", "series", "usual_interval"]

SECONDS_PER_HOUR = 3600.0

_WARMTH = (-60.0, 120.0)  # degC: no cell is tested beyond these, but an open or shorted sensor reads so

_LEAST = 3  # samples
_LARGEST = {"time": 1e15, "voltage": 1e7, "current": 1e9, "cycle": 1e15}
"""In s, V and A: beyond any test in any unit, and far below where a square is no number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """Samples of one cell, in the order in which they were taken.

    Attributes:
        time: in s, not falling; shape (n,).
        voltage: at the cell, in V.
        current: in A, positive where it charges the cell.
        temperature: in degC, or None if it was not recorded.
        cycle: number of the cycle that each sample belongs to, or None if the source does not count them.
        charge: net charge in Ah counted by the instrument itself at each sample, None if it reports none.
        energy: likewise net energy, in Wh.
        test: number of the test that each sample belongs to, None if there is one; tests follow on each other.
        stretch: number of the stretch of each sample, None if the series is one; between two stretches the time is
            not known, and no step goes across.
    """

    time: NDArray[np.float64]
    voltage: NDArray[np.float64]
    current: NDArray[np.float64]
    temperature: NDArray[np.float64] | None = None
    cycle: NDArray[np.int64] | None = None
    charge: NDArray[np.float64] | None = None
    energy: NDArray[np.float64] | None = None
    test: NDArray[np.int64] | None = None
    stretch: NDArray[np.int64] | None = None

    @property
    def broken(self) -> NDArray[np.bool_]:
        """Whether the interval after each sample lies between two stretches, shape (n - 1,)."""
        if self.stretch is None:
            return np.zeros(self.time.size - 1, dtype=bool)
        return np.asarray(np.diff(self.stretch) != 0)

    def test_of(self, place: int) -> int:
        """Return the number of the test that a sample belongs to, 0 where there is one."""
        return 0 if self.test is None else int(self.test[place])


def can_be_warm(temperature: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which temperatures in degC are plausible for a cell; one that is not a number is not."""
    return np.asarray((temperature >= _WARMTH[0]) & (temperature <= _WARMTH[1]))


@traced
def series(  # noqa: PLR0913 - one argument per column
    time: ArrayLike,
    voltage: ArrayLike,
    current: ArrayLike,
    *,
    temperature: ArrayLike | None = None,
    cycle: ArrayLike | None = None,
    charge: ArrayLike | None = None,
    energy: ArrayLike | None = None,
    test: ArrayLike | None = None,
    stretch: ArrayLike | None = None,
) -> Series:
    """Return samples as a series; those with a time, voltage, current or cycle that is not a number are left out.

    A temperature or a charge or energy as counted that is not a number stays: only reports about it leave it out.

    Args:
        time: in s, shape (n,).
        voltage: in V, as long as the time.
        current: in A, positive where it charges.
        temperature: in degC.
        cycle: numbers of cycles.
        charge: the instrument's own count, in Ah.
        energy: likewise, in Wh.
        test: numbers of tests.
        stretch: numbers of stretches.

    Raises:
        Refused: arrays of different lengths, fewer than three samples, times that go back, numbers that cannot be.
    """
    rows = [np.asarray(each, dtype=float) for each in (time, voltage, current)]
    given = (temperature, cycle, charge, energy, test, stretch)
    others = [None if each is None else np.asarray(each, dtype=float) for each in given]
    if any(each.shape != (rows[0].size,) for each in (*rows, *others) if each is not None):
        raise Refused("time, voltage and current differ in length", "give one value of each for every sample")
    whole = np.isfinite(rows).all(axis=0)
    if others[1] is not None:
        whole &= np.isfinite(others[1])
    times, voltages, currents = (each[whole] for each in rows)
    numbers = times if others[1] is None else others[1][whole]
    for (name, most), values in zip(_LARGEST.items(), (times, voltages, currents, numbers), strict=True):
        if values.size and (largest := float(np.abs(values).max())) > most:
            place = int(np.flatnonzero(whole)[np.abs(values).argmax()])
            raise Refused(f"a {name} of {largest:.3g}, in row {place + 1}, cannot be", "mend the row, or leave it out")
    if times.size < _LEAST:
        found = "1 whole sample is" if times.size == 1 else f"{times.size} whole samples are"
        raise Refused(f"{found} too few", f"record at least {_LEAST}")
    back = np.flatnonzero(np.diff(times) < 0)
    if back.size:
        often = "once" if back.size == 1 else f"{back.size} times"
        raise Refused(
            f"the time goes back {often}, first after {times[back[0]]:g} s",
            "take a time that runs through the whole test, not that of a step",
        )
    warmth, number, charged, spent, tested, stretched = (None if each is None else each[whole] for each in others)
    return Series(
        time=times,
        voltage=voltages,
        current=currents,
        temperature=warmth,
        cycle=None if number is None else number.astype(np.int64),
        charge=charged,
        energy=spent,
        test=None if tested is None else tested.astype(np.int64),
        stretch=None if stretched is None else stretched.astype(np.int64),
    )


def usual_interval(time: NDArray[np.float64]) -> float:
    """Return the median of the intervals above zero between samples, in s; zero if there are none."""
    steps = np.diff(time)
    steps = steps[steps > 0]
    return float(np.median(steps)) if steps.size else 0.0
