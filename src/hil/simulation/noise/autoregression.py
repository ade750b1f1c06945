"""First-order autoregression over whole arrays."""

from __future__ import annotations

from functools import lru_cache
from itertools import accumulate
from math import log10
from operator import mul

import numpy as np
from numpy.typing import NDArray

__all__ = ["autoregressive"]

_DECADES = 150
_LONGEST = 512


def autoregressive(driver: NDArray[np.float64], coefficient: float, before: float) -> NDArray[np.float64]:
    """Return y with y[k] = coefficient * y[k-1] + driver[k], where y[-1] is `before`.

    Within a row of samples, y[k]/coefficient^k is a plain sum; what a row begins with fades over it. All of it is
    done by sums and products of whole arrays, whose result is the same on every machine.

    Args:
        driver: what comes in, shape (n,).
        coefficient: above 0 and below 1.
        before: the last value before the first one.
    """
    growing, fading = _weights(coefficient, driver.size)
    rows = -(-driver.size // growing.size)
    line = np.zeros(rows * growing.size)
    line[: driver.size] = driver
    values = line.reshape(rows, growing.size)
    values *= growing
    np.cumsum(values, axis=1, out=values)
    values *= fading
    starts = []
    for last in values[:, -1].tolist():
        starts.append(coefficient * before)
        before = last + fading[-1] * starts[-1]
    values += np.array(starts)[:, np.newaxis] * fading
    return line[: driver.size]


@lru_cache(maxsize=64)
def _weights(coefficient: float, size: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return coefficient^-k and coefficient^k for a row as long as numbers can stand it."""
    longest = int(min(size, _LONGEST, max(1, _DECADES / -log10(coefficient))))
    fading = np.array(list(accumulate([1.0, *[coefficient] * (longest - 1)], mul)))
    return 1 / fading, fading
