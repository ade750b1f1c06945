"""Charge and energy by the trapezoid on the true times of the samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hil.analysis.battery.series import SECONDS_PER_HOUR

__all__ = ["cumulative", "one_way"]


def one_way(time: NDArray[np.float64], rate: NDArray[np.float64], sign: int) -> NDArray[np.float64]:
    """Return what flows in one direction during each interval between samples.

    The rate is taken as a straight line between two samples. Where it changes its sign within an interval only the
    part on the asked side of zero counts, so that no charge cancels against discharge:
    int max(s r, 0) dt = dt/2 r1^2 / |r1 - r0| for the side that r1 is on.

    Args:
        time: in s, not falling, shape (n,).
        rate: current in A, or power in W, at these times.
        sign: 1 for what is above zero, -1 for what is below, as a positive number.

    Returns:
        Shape (n - 1,), in Ah for A and Wh for W, not below zero.
    """
    signed = sign * rate
    first, second = signed[:-1], signed[1:]
    above, below = np.maximum(first, 0.0) + np.maximum(second, 0.0), np.abs(second - first)
    crossing = first * second < 0
    # Of a line that crosses zero only the share above / below of the interval lies on the asked side.
    share = np.where(crossing, above / np.where(crossing, below, 1.0), 1.0)
    return np.asarray(np.diff(time) * above * share / (2.0 * SECONDS_PER_HOUR))


def cumulative(parts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sum of the parts up to each sample, beginning with zero.

    Args:
        parts: one for each interval between samples, shape (n - 1,).

    Returns:
        Shape (n,).
    """
    return np.concatenate(([0.0], np.cumsum(parts)))
