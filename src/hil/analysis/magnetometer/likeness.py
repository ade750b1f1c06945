"""Correlated residuals of neighbouring readings: a fit is less certain than one of as many independent readings."""

from __future__ import annotations

import math

import numpy as np

from hil.analysis.magnetometer.geometry import Array

__all__ = ["inflation"]

_BLOCKS = 16  # the fewest that tell how much sums over them scatter
_DEVIATIONS = 4.0  # of what chance makes of independent residuals: less is none


def inflation(shares: Array) -> float:
    """Return by which factor the variance of a fit exceeds that of independent residuals, at least 1.

    Sums over blocks of m neighbours scatter as much as their members do where residuals are independent, and up to m
    times more where they are alike. The mean over all parameters is taken, and the largest of blocks of 2, 4, 8, ...
    readings that chance does not explain, where the directions of a block may all be one. Changes over more than a
    sixteenth of the readings show in part only.

    Source: the variance of means over batches, as in C. J. Geyer, Practical Markov Chain Monte Carlo, Statistical
    Science 7 (1992) 473, section 3.

    Args:
        shares: what each residual adds to each parameter, shape (p, n), in the order in which they were read.
    """
    parameters, count = shares.shape
    alone = shares @ shares.T
    scale = np.sqrt(np.diag(alone))
    if count < 2 * _BLOCKS or not (scale > 0.0).all():
        return 1.0
    try:
        lower = np.linalg.cholesky(alone / np.outer(scale, scale))
    except np.linalg.LinAlgError:
        return 1.0
    sums = np.cumsum(np.linalg.solve(lower, shares / scale[:, None]), axis=1)
    most, width = 1.0, 2
    while count // width >= _BLOCKS:
        blocks = count // width
        ends = sums[:, width - 1 : blocks * width : width]
        parts = np.diff(ends, axis=1, prepend=0.0)
        share = blocks * width / count
        factor = float(np.square(parts).sum()) / (parameters * share) * blocks / (blocks - 1.0)
        if factor > 1.0 + _DEVIATIONS * math.sqrt(2.0 / blocks):
            most = max(most, factor)
        width *= 2
    return most
