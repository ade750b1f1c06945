"""The mean of a record at rest, with an uncertainty that respects slow noise."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from hil.analysis.allan.deviation import deviation
from hil.analysis.statistics import not_observable
from hil.model.figure import Figure

__all__ = ["rest_mean"]

_FEWEST = 16  # samples: two averages in the eighth of the record
_PART = 8  # averaging times up to this part of the record have ten degrees of freedom and more
_POWERS = {-1: 0, -2: 1}  # of tau, in the Allan variance; white noise and bluer ones: -1


def rest_mean(samples: ArrayLike, rate: float, unit: str, *, systematic: float = 0.0) -> Figure:
    """Return the mean of a record at rest as a measure of the bias.

    u^2 is the Allan variance at the record's own length T, plus systematic^2. It is that at tau, the longest octave
    within an eighth of the record, carried on to T as the noise type found there tells: tau / T for white noise, 1 for
    flicker and T / tau for random walk. For white noise this is s^2 / n; under flicker or random walk, s / sqrt(n)
    would promise far too much. Degrees of freedom are those of the Allan variance at tau.

    Args:
        samples: shape (n,), in `unit`; NaN stands for a sample that is missing. Fewer than 16 samples, and samples that
            are all the same, make the mean NOT_OBSERVABLE.
        rate: samples per second.
        unit: unit of samples and result.
        systematic: standard uncertainty that all samples share, in `unit`; taken as exactly known.
    """
    values = np.asarray(samples, dtype=np.float64)
    present = values[np.isfinite(values)]
    if present.size < _FEWEST or present.min() == present.max():
        return not_observable(unit, float(present.mean()) if present.size else math.nan)
    curve = deviation(values, rate, unit=unit, holes=True)
    place = max(0, int((curve.m <= values.size // _PART).sum()) - 1)
    growth = (values.size / int(curve.m[place])) ** _POWERS.get(int(curve.alpha[place]), -1)
    variance = float(curve.deviation[place]) ** 2 * growth
    dof = float(curve.edf[place])
    total = variance + systematic**2
    return Figure(
        value=float(present.mean()),
        unit=unit,
        uncertainty=math.sqrt(total),
        dof=dof * (total / variance) ** 2 if variance > 0.0 else math.inf,
    )
