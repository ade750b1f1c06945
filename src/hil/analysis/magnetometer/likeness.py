"""Correlation of neighbouring residuals: inflation of a fit's variance over that of independent readings."""

from __future__ import annotations

import math

import numpy as np

from hil.analysis.magnetometer.geometry import Array

__all__ = ["inflation"]

_BLOCKS = 16  # least number of blocks for the scatter of their sums
_DEVIATIONS = 4.0  # significance needed, in standard deviations for independent residuals


def inflation(shares: Array) -> float:
    """Return the factor by which the variance of a fit exceeds that for independent residuals, at least 1.

    The variance of sums over blocks of m neighbours is the sum of their variances for independent residuals, and up to
    m times that for correlated ones. The factor is the mean over all parameters, and the largest over blocks of 2, 4,
    8, ... readings that is significant, where all directions of a block may coincide. Changes over more than a
    sixteenth of the readings are only partly detected.

    Source: the variance of means over batches, as in C. J. Geyer, Practical Markov Chain Monte Carlo, Statistical
    Science 7 (1992) 473, section 3.

    Args:
        shares: contribution of each residual to each parameter, shape (p, n), in order of reading.
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
