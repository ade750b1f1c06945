"""Time series of a cell's voltage and current, the input of the battery analyses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.tracing import traced
from hil.model.errors import Refused

__all__ = ["SECONDS_PER_HOUR", "Series", "can_be_warm", "series", "usual_interval"]

SECONDS_PER_HOUR = 3600.0

_WARMTH = (-60.0, 120.0)  # degC: no cell is tested beyond these; an open or shorted sensor reads so

_LEAST = 3  # samples
_LARGEST = {"time": 1e15, "voltage": 1e7, "current": 1e9, "cycle": 1e15}
"""Largest accepted values in s, V and A: beyond any test in any unit, and far below overflow of a square."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """Samples of one cell in order of time; arrays of shape (n,).

    Attributes:
        time: time [s], non-decreasing.
        voltage: voltage at the cell [V].
        current: current [A], positive for charging.
        temperature: temperature [degC], None if not recorded.
        cycle: cycle number, None if the source does not count cycles.
        charge: the instrument's own net charge counter [Ah], None if it has none.
        energy: likewise net energy [Wh].
        test: test number, None for a single test; tests are consecutive.
        stretch: stretch number, None for a single stretch; the time between two stretches is unknown, and no step
            spans them.
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
        """Return the test number of a sample, 0 for a single test."""
        return 0 if self.test is None else int(self.test[place])


def can_be_warm(temperature: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the mask of temperatures in degC that are plausible for a cell, of their shape; False for NaN."""
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
    """Return samples as a series, without those whose time, voltage, current or cycle is not finite.

    A sample whose temperature or counted charge or energy is not finite is kept: only results based on those skip it.

    Args:
        time: times in s, shape (n,), as all others.
        voltage: voltages in V.
        current: currents in A, positive for charging.
        temperature: temperatures in degC.
        cycle: cycle numbers.
        charge: the instrument's own charge counter [Ah].
        energy: likewise energy [Wh].
        test: test numbers.
        stretch: stretch numbers.

    Raises:
        Refused: arrays of different lengths, fewer than three samples, times that go back, or impossible values.
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
    """Return the median of the positive intervals between samples in s; zero if there are none. `time` is (n,) in s."""
    steps = np.diff(time)
    steps = steps[steps > 0]
    return float(np.median(steps)) if steps.size else 0.0
