"""Use of an instrument's own charge and energy counters in intervals where the current was switched."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hil.analysis.battery.series import SECONDS_PER_HOUR, Series
from hil.analysis.battery.steps import Step, StepKind

__all__ = ["Counted", "Net", "counted", "net"]

_SLACK = 0.01  # of the largest possible amount: counter and rows are rounded
_RESOLUTION = 1e-7  # Ah and Wh


@dataclass(frozen=True, slots=True, kw_only=True)
class Counted:
    """The intervals in which the instrument's counter replaces samples; arrays of shape (n - 1,).

    Attributes:
        used: whether the counter is used in this interval.
        charge: net charge of the interval as counted [Ah], zero where unused.
        energy: likewise net energy [Wh].
    """

    used: NDArray[np.bool_]
    charge: NDArray[np.float64]
    energy: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Net:
    """Net charge or energy of a whole series.

    Attributes:
        value: trapezoidal integral of the samples, with the instrument's counter where the current was switched.
        samples: trapezoidal integral of the samples alone.
        counted: the part of `value` from the counter.
        edges: number of those intervals.
        open: standard uncertainty of the samples alone in those intervals.
    """

    value: float
    samples: float
    counted: float
    edges: int
    open: float


def counted(data: Series, steps: Sequence[Step]) -> Counted:
    """Return the instrument's count between the last sample of a rest and the first with current, or vice versa.

    Samples alone do not show when the current was switched within such an interval: anything from nothing to the larger
    current throughout may have flowed. A count within these bounds is used; one outside (a counter that restarts with
    each step, or has the opposite sign) is not.

    Args:
        data: the samples, with the instrument's own `charge` and `energy`.
        steps: from `segment`.
    """
    size = data.time.size - 1
    used, charge, energy = np.zeros(size, dtype=bool), np.zeros(size), np.zeros(size)
    if data.charge is None or data.energy is None:
        return Counted(used=used, charge=charge, energy=energy)
    current, power = _most(data, data.current), _most(data, data.current * data.voltage)
    broken = data.broken
    for before, after in pairwise(steps):
        place = before.last
        if StepKind.REST not in {before.kind, after.kind} or broken[place]:
            continue
        found = data.charge[place + 1] - data.charge[place], data.energy[place + 1] - data.energy[place]
        if _possible(found[0], current[place]) and _possible(found[1], power[place]):
            used[place], charge[place], energy[place] = True, *found
    return Counted(used=used, charge=charge, energy=energy)


def net(data: Series, steps: Sequence[Step], *, energy: bool) -> Net:
    """Return the net charge in Ah of a series, or its net energy in Wh.

    The uncertainty of the samples alone is that of a switching instant uniform over the interval: half of the largest
    possible amount, over the square root of three (JCGM 100:2008, 4.3.7), edges added in quadrature.

    Args:
        data: the samples.
        steps: from `segment`.
        energy: whether to return energy instead of charge.
    """
    rate = data.current * data.voltage if energy else data.current
    parts = np.diff(data.time) * (rate[:-1] + rate[1:]) / (2.0 * SECONDS_PER_HOUR) * ~data.broken
    edges = counted(data, steps)
    own = edges.energy if energy else edges.charge
    half = np.abs(_most(data, rate)[edges.used]) / 2.0
    return Net(
        value=float(np.where(edges.used, own, parts).sum()),
        samples=float(parts.sum()),
        counted=float(own.sum()),
        edges=int(edges.used.sum()),
        open=float(np.sqrt(np.sum(half**2))) / math.sqrt(3.0),
    )


def _most(data: Series, rate: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the amount per interval if the larger of its two rates flowed throughout."""
    larger = np.where(np.abs(rate[1:]) > np.abs(rate[:-1]), rate[1:], rate[:-1])
    return np.asarray(larger * np.diff(data.time) / SECONDS_PER_HOUR)


def _possible(found: float, most: float) -> bool:
    """Return whether a count lies between zero and the largest possible amount."""
    forwards = math.copysign(1.0, most) * found
    return -_RESOLUTION <= forwards <= abs(most) * (1.0 + _SLACK) + _RESOLUTION
