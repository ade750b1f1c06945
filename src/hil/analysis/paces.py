"""Which rows of a log are a sensor's own, if it holds sensors of different rates.

A log has one row for each reading of the fastest sensor, or one for each reading of any. In a row without a new
reading, a sensor's cells are empty, or repeat its last reading.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["own_rows"]

_SLOWER = 1.2  # rows to a reading: with fewer single readings are missing, or repeat by chance
_FEWEST = 50  # readings from which their pace is known
_REGULAR = 0.8  # of the scatter that chance makes: what is held comes more regularly
_STUCK = 10.0  # times the usual: what stands for longer hangs, and less is a reading that was lost


def own_rows(values: NDArray[np.float64], *, apart: bool = False) -> NDArray[np.intp] | None:
    """Return the places of the rows with a reading of their own, None if they are all.

    A row without any number is none. Where readings are held, the first row of each counts; a reading that stands for
    far longer than usual counts once in as many rows as usual, so that a sensor that hangs still shows as one.

    Args:
        values: of one sensor, shape (n, axes).
        apart: whether rows without a number are known to be another sensor's, however few they are.
    """
    there = np.flatnonzero(~np.isnan(values).all(axis=1))
    apart = there.size >= _FEWEST and len(values) > (1.0 if apart else _SLOWER) * there.size
    rows = there if apart else np.arange(len(values))
    fresh = _fresh(values[rows] if apart else values)
    if fresh is not None:
        return rows[fresh]
    return rows if apart else None


def _fresh(values: NDArray[np.float64]) -> NDArray[np.intp] | None:
    """Return the places where a held reading is new, None if readings are not held."""
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
