"""Charge and energy by trapezoidal integration over the true sample times."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hil.analysis.battery.series import SECONDS_PER_HOUR

__all__ = ["cumulative", "one_way"]


def one_way(time: NDArray[np.float64], rate: NDArray[np.float64], sign: int) -> NDArray[np.float64]:
    """Return the amount that flows in one direction during each interval between samples.

    The rate is linear between two samples. Where it changes sign within an interval, only the part on the requested
    side of zero counts, so that charge does not cancel discharge:
    int max(s r, 0) dt = dt/2 r1^2 / |r1 - r0| for the side that r1 is on.

    Args:
        time: times in s, non-decreasing, shape (n,).
        rate: current in A, or power in W, at these times, shape (n,).
        sign: 1 for the positive part, -1 for the magnitude of the negative part.

    Returns:
        Shape (n - 1,), in Ah for A and Wh for W, non-negative.
    """
    signed = sign * rate
    first, second = signed[:-1], signed[1:]
    above, below = np.maximum(first, 0.0) + np.maximum(second, 0.0), np.abs(second - first)
    crossing = first * second < 0
    # For a line that crosses zero, only this share of the interval lies on the requested side.
    share = np.where(crossing, above / np.where(crossing, below, 1.0), 1.0)
    return np.asarray(np.diff(time) * above * share / (2.0 * SECONDS_PER_HOUR))


def cumulative(parts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the cumulative sum of the parts at each sample, starting at zero.

    Args:
        parts: amount in each interval between samples, shape (n - 1,).

    Returns:
        Shape (n,).
    """
    return np.concatenate(([0.0], np.cumsum(parts)))
