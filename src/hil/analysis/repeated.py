"""Repeatability of a sensor's temperature drift over two runs with the same temperature profile.

Comparing two slopes is inefficient: what a line does not follow, such as a hysteresis loop, is uncertainty in both,
although it is the same in both. In the difference of the runs, sample by sample, it cancels.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.drift import Drift, drift_of
from hil.analysis.tracing import traced
from hil.model.errors import Refused

__all__ = ["drift_change"]

_Run: TypeAlias = tuple[ArrayLike, ArrayLike, ArrayLike]
_Arrays: TypeAlias = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


@traced
def drift_change(first: _Run, again: _Run, unit: str) -> Drift:
    """Return the change of an axis's drift from one run to a second with the same temperature profile.

    The slope is that of the second run minus that of the first, from their difference at equal times since their start.
    The first run's line is subtracted from each run beforehand, so that slightly different temperatures have no effect.
    The uncertainty includes the slow noise of both runs; time beyond the shorter run is left out.

    Args:
        first: time [s], temperature [degC] and values in `unit` of the first run, each of shape (n,).
        again: the same for the second run, each of shape (m,).
        unit: unit of the values.

    Raises:
        Refused: arrays of different shapes, or empty ones.
    """
    runs = [_arrays(run) for run in (first, again)]
    slope = drift_of(*runs[0], unit).slope.value
    (time, degrees, left), (other, _, right) = (_less(run, slope) for run in runs)
    both = time <= other[-1]
    return drift_of(time[both], degrees[both], np.interp(time[both], other, right) - left[both], unit)


def _arrays(run: _Run) -> _Arrays:
    time, degrees, values = (np.asarray(each, dtype=np.float64) for each in run)
    if not time.shape == degrees.shape == values.shape or time.ndim != 1 or not time.size:
        raise Refused("time, temperature and values have different shapes", "give one of each per sample")
    return time, degrees, values


def _less(run: _Arrays, slope: float) -> _Arrays:
    """Return a run's time since its start, its temperature, and its values minus a line over temperature."""
    time, degrees, values = run
    return time - time[0], degrees, values - slope * (degrees - degrees[0])
