"""First-order autoregression over whole arrays."""

from __future__ import annotations

from functools import lru_cache
from itertools import accumulate
from math import log10
from operator import mul
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["autoregressive"]

_Array: TypeAlias = NDArray[np.float64]

_DECADES = 150
_LONGEST = 512
_UNFELT = 1e-20


def autoregressive(driver: _Array, coefficient: float, before: float) -> _Array:
    """Return y with y[k] = coefficient * y[k-1] + driver[k], where y[-1] is `before`.

    Within a row of samples, y[k]/coefficient^k is a plain sum; what a row begins with fades over it. All of it is
    done by sums and products of whole arrays, whose result is the same on every machine.

    Args:
        driver: what comes in, shape (n,).
        coefficient: above 0 and below 1.
        before: the last value before the first one.
    """
    growing, fading, felt = _weights(coefficient, driver.size)
    rows = -(-driver.size // growing.size)
    line = driver if rows * growing.size == driver.size else np.append(driver, np.zeros(-driver.size % growing.size))
    values = line.reshape(rows, growing.size) * growing
    np.cumsum(values, axis=1, out=values)
    values *= fading
    starts = []
    for last in values[:, -1].tolist():
        starts.append(coefficient * before)
        before = last + fading[-1] * starts[-1]
    values[:, : felt.size] += np.array(starts)[:, np.newaxis] * felt
    return values.reshape(-1)[: driver.size]


@lru_cache(maxsize=64)
def _weights(coefficient: float, size: int) -> tuple[_Array, _Array, _Array]:
    """Return coefficient^-k and coefficient^k for a row as long as numbers stand it, and where a row feels the last."""
    longest = int(min(size, _LONGEST, max(1, _DECADES / -log10(coefficient))))
    fading = np.array(list(accumulate([1.0, *[coefficient] * (longest - 1)], mul)))
    return 1 / fading, fading, fading[fading > _UNFELT]
