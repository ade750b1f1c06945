"""Selection of a sensor's own rows in a log that interleaves sensors of different rates.

A log has one row per reading of the fastest sensor, or per reading of any. In a row without a new reading of a sensor,
its cells are empty or hold the last reading.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["own_rows"]

_SLOWER = 1.2  # least rows per reading: below this single readings are missing, or repeat by chance
_FEWEST = 50  # readings needed to determine the pace
_REGULAR = 0.8  # of the scatter by chance: held readings are more regular
_STUCK = 10.0  # multiple of the typical hold time: beyond it the sensor is stuck, below it a reading was lost


def own_rows(values: NDArray[np.float64], *, apart: bool = False) -> NDArray[np.intp] | None:
    """Return the indices of the rows with a new reading, shape (k,); None if all rows have one.

    A row without any number has none. Where readings are held, the first row of each counts; a reading held far longer
    than usual counts once per typical hold time, so that a stuck sensor stays visible.

    Args:
        values: readings of one sensor, shape (n, axes).
        apart: whether rows without a number are known to belong to another sensor, however few.
    """
    there = np.flatnonzero(~np.isnan(values).all(axis=1))
    apart = there.size >= _FEWEST and len(values) > (1.0 if apart else _SLOWER) * there.size
    rows = there if apart else np.arange(len(values))
    fresh = _fresh(values[rows] if apart else values)
    if fresh is not None:
        return rows[fresh]
    return rows if apart else None


def _fresh(values: NDArray[np.float64]) -> NDArray[np.intp] | None:
    """Return the indices at which a held reading is new, None if readings are not held."""
    new = np.flatnonzero(np.concatenate(([True], (values[1:] != values[:-1]).any(axis=1))))
    lasts = np.diff(np.append(new, len(values)))
    usual = lasts[lasts <= _STUCK * np.median(lasts)]
    every = float(usual.mean())
    chance = math.sqrt(1.0 - 1.0 / every)  # relative scatter where each row repeats the one before by chance
    if usual.size < _FEWEST or every < _SLOWER or float(usual.std()) > _REGULAR * chance * every:
        return None
    times = np.where(lasts > _STUCK * every, np.rint(lasts / every), 1).astype(np.intp)
    within = np.arange(times.sum()) - np.repeat(np.cumsum(times) - times, times)
    places: NDArray[np.intp] = np.repeat(new, times) + np.rint(within * np.repeat(lasts / times, times)).astype(np.intp)
    return places
