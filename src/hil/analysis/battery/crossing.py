"""The moment at which a value first crosses a level."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["first_fall", "first_rise"]


def first_rise(time: NDArray[np.float64], value: NDArray[np.float64], level: float) -> float:
    """Return when a value first reaches a level from below.

    The first crossing counts, also where noise takes the value back below the level. Between the two samples about it
    the value is taken as a straight line. A value that begins at the level or above it has reached it at once.

    Args:
        time: in s, not falling, shape (n,).
        value: at these times.
        level: in the unit of the value.

    Returns:
        The time in s, NaN where the level is never reached.
    """
    above = np.flatnonzero(value >= level)
    if not above.size:
        return math.nan
    place = int(above[0])
    if place == 0:
        return float(time[0])
    share = (level - value[place - 1]) / (value[place] - value[place - 1])
    return float(time[place - 1] + share * (time[place] - time[place - 1]))


def first_fall(time: NDArray[np.float64], value: NDArray[np.float64], level: float) -> float:
    """Return when a value, having been above a level, first reaches it from above; else as `first_rise`.

    What lies before the first sample above the level is the way there and does not count. NaN where the value never was
    above the level.

    Args:
        time: in s, not falling, shape (n,).
        value: at these times.
        level: in the unit of the value.
    """
    above = np.flatnonzero(value > level)
    if not above.size:
        return math.nan
    start = int(above[0])
    return first_rise(time[start:], -value[start:], -level)
