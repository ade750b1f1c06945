"""Voltage and current of a cell over time, as the analyses of batteries take them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.model.errors import Refused

__all__ = ["SECONDS_PER_HOUR", "Series", "series", "usual_interval"]

SECONDS_PER_HOUR = 3600.0

_LEAST = 3  # samples


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """Samples of one cell, in the order in which they were taken.

    Attributes:
        time: in s, not falling; shape (n,).
        voltage: at the cell, in V.
        current: in A, positive where it charges the cell.
        temperature: in degC, or None where it was not recorded.
        cycle: number of the cycle that each sample belongs to, or None where the source does not count them.
        charge: net charge in Ah that the instrument itself had counted at each sample, None where it does not tell.
        energy: likewise net energy, in Wh.
    """

    time: NDArray[np.float64]
    voltage: NDArray[np.float64]
    current: NDArray[np.float64]
    temperature: NDArray[np.float64] | None = None
    cycle: NDArray[np.int64] | None = None
    charge: NDArray[np.float64] | None = None
    energy: NDArray[np.float64] | None = None


def series(
    time: ArrayLike,
    voltage: ArrayLike,
    current: ArrayLike,
    *,
    temperature: ArrayLike | None = None,
    cycle: ArrayLike | None = None,
    charge: ArrayLike | None = None,
    energy: ArrayLike | None = None,
) -> Series:
    """Return samples as a series; those with a time, voltage or current that is no number are left out.

    A temperature or a count that is no number stays: only what is told of it leaves it out.

    Args:
        time: in s, shape (n,).
        voltage: in V, as long as the time.
        current: in A, positive where it charges.
        temperature: in degC.
        cycle: numbers of cycles.
        charge: the instrument's own count, in Ah.
        energy: likewise, in Wh.

    Raises:
        Refused: arrays of different lengths, fewer than three samples, times that go back.
    """
    rows = [np.asarray(each, dtype=float) for each in (time, voltage, current)]
    others = [None if each is None else np.asarray(each, dtype=float) for each in (temperature, cycle, charge, energy)]
    if any(each.shape != (rows[0].size,) for each in (*rows, *others) if each is not None):
        raise Refused("time, voltage and current differ in length", "give one value of each for every sample")
    whole = np.isfinite(rows).all(axis=0)
    if others[1] is not None:
        whole &= np.isfinite(others[1])
    times, voltages, currents = (each[whole] for each in rows)
    if times.size < _LEAST:
        raise Refused(f"{times.size} whole samples are too few", f"record at least {_LEAST}")
    back = np.flatnonzero(np.diff(times) < 0)
    if back.size:
        raise Refused(
            f"the time goes back {back.size} times, first after {times[back[0]]:g} s",
            "take a time that runs through the whole test, not that of a step",
        )
    warmth, number, charged, spent = (None if each is None else each[whole] for each in others)
    return Series(
        time=times,
        voltage=voltages,
        current=currents,
        temperature=warmth,
        cycle=None if number is None else number.astype(np.int64),
        charge=charged,
        energy=spent,
    )


def usual_interval(time: NDArray[np.float64]) -> float:
    """Return the median of the intervals above zero between samples, in s; zero where there are none."""
    steps = np.diff(time)
    steps = steps[steps > 0]
    return float(np.median(steps)) if steps.size else 0.0
