"""Segmentation of a series into charge, discharge and rest by its current."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.analysis.battery.series import Series, usual_interval

__all__ = ["Segmentation", "Step", "StepKind", "gaps", "segment"]


class StepKind(StrEnum):
    """Kind of a step, by its current."""

    CHARGE = "charge"
    DISCHARGE = "discharge"
    REST = "rest"


_KINDS = {1: StepKind.CHARGE, -1: StepKind.DISCHARGE, 0: StepKind.REST}


@dataclass(frozen=True, slots=True, kw_only=True)
class Segmentation:
    """Segmentation settings.

    Attributes:
        rest_current: magnitude of the current [A] below which the cell rests; None for 1 % of the largest typical one.
        hysteresis: multiple of it above which a rest ends, so that ripple about the threshold makes no steps.
        shortest: shortest step in samples; a shorter run between two runs of one kind is a glitch and joins them.
        gap: an interval of more than this many typical intervals is a gap.
        taper: relative drop of the current below its constant value at which constant voltage begins.
        plateau: largest change of voltage during constant voltage [V]; lead resistance makes it rise.
    """

    rest_current: float | None = None
    hysteresis: float = 2.0
    shortest: int = 2
    gap: float = 10.0
    taper: float = 0.03
    plateau: float = 0.15


class Step(NamedTuple):
    """A run of samples in one state, both ends included.

    Attributes:
        kind: charge, discharge or rest.
        first: index of the first sample.
        last: index of the last sample.
        cv: index of the first sample at constant voltage, None if there is none.
    """

    kind: StepKind
    first: int
    last: int
    cv: int | None


def segment(data: Series, how: Segmentation | None = None) -> tuple[Step, ...]:
    """Return the steps of a series in order; every sample belongs to exactly one, and none spans stretches.

    Args:
        data: the samples, not necessarily evenly spaced.
        how: segmentation settings, by default those of `Segmentation`.
    """
    how = how or Segmentation()
    threshold = _threshold(data.current, how)
    parts = np.split(data.current, np.flatnonzero(data.broken) + 1)
    states = np.concatenate(
        [_without_glitches(_states(part, threshold, how.hysteresis), how.shortest) for part in parts]
    )
    edges = np.flatnonzero((np.diff(states) != 0) | data.broken) + 1
    starts = [0, *edges.tolist()]
    ends = [*(edges - 1).tolist(), states.size - 1]
    return tuple(_step(data, int(states[first]), first, last, how) for first, last in zip(starts, ends, strict=True))


def gaps(time: NDArray[np.float64], how: Segmentation | None = None) -> NDArray[np.bool_]:
    """Return the mask of intervals between samples that are gaps.

    Args:
        time: times in s, shape (n,).
        how: segmentation settings; `gap` is the number of typical intervals that make a gap.

    Returns:
        Shape (n - 1,).
    """
    how = how or Segmentation()
    usual = usual_interval(time)
    return np.asarray(np.diff(time) > how.gap * usual) if usual else np.zeros(time.size - 1, dtype=bool)


def _threshold(current: NDArray[np.float64], how: Segmentation) -> float:
    if how.rest_current is not None:
        return how.rest_current
    return 0.01 * float(np.percentile(np.abs(current), 95.0))


def _states(current: NDArray[np.float64], threshold: float, hysteresis: float) -> NDArray[np.int64]:
    """Return 1, -1 or 0 for each sample; between the thresholds the previous state is kept."""
    magnitude = np.abs(current)
    sure = (magnitude > hysteresis * threshold) | (magnitude <= threshold)
    sure[0] = True
    signs = np.where(magnitude > threshold, np.sign(current), 0.0).astype(np.int64)
    places = np.maximum.accumulate(np.where(sure, np.arange(current.size), 0))
    held = signs[places]
    # A current that crosses zero between the thresholds changes sign, and is not kept.
    return np.where((held != 0) & (held * current < 0), signs, held)


def _without_glitches(states: NDArray[np.int64], shortest: int) -> NDArray[np.int64]:
    edges = np.concatenate(([0], np.flatnonzero(np.diff(states)) + 1, [states.size]))
    mended = states.copy()
    for before, first, last in zip(edges[:-3], edges[1:-2], edges[2:-1], strict=True):
        if last - first < shortest and mended[before] == states[last]:
            mended[first:last] = mended[before]
    return mended


def _step(data: Series, state: int, first: int, last: int, how: Segmentation) -> Step:
    cv = _constant_voltage(data, first, last, how) if state else None
    return Step(kind=_KINDS[state], first=first, last=last, cv=cv)


def _constant_voltage(data: Series, first: int, last: int, how: Segmentation) -> int | None:
    """Return the index at which the current leaves its constant value for good while the voltage stays constant."""
    magnitude = _running_median(np.abs(data.current[first : last + 1]))
    high = float(np.percentile(magnitude, 80.0))
    constant = float(np.median(magnitude[magnitude >= 0.9 * high]))
    held = np.flatnonzero(magnitude >= (1.0 - how.taper) * constant)
    begin = int(held[-1]) + 1
    tail = data.voltage[first + begin : last + 1]
    if tail.size <= how.shortest or np.ptp(tail) > how.plateau:
        return None
    falls = float(np.median(magnitude[begin:])) < (1.0 - 2.0 * how.taper) * constant
    return first + begin if falls else None


def _running_median(values: NDArray[np.float64], width: int = 5) -> NDArray[np.float64]:
    if values.size < width:
        return values
    padded = np.pad(values, width // 2, mode="edge")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1))
