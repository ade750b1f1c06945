"""How evenly a record was sampled: rate, jitter, gaps, repeated and reversed timestamps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.tracing import traced
from hil.model.errors import Refused

__all__ = ["SamplingReport", "assess", "with_holes"]

_MOST_MISSING = 10  # times the samples that are there
_GAP = 1.5  # an interval this many times the usual one has lost a sample


@dataclass(frozen=True, slots=True, kw_only=True)
class SamplingReport:
    """What the timestamps of a record say.

    Attributes:
        samples: number of timestamps.
        duration: from the first to the last, in s.
        rate: regular intervals per second of their own sum, in Hz; gaps do not lower it.
        jitter_rms: root mean square deviation of a regular interval from their mean, in s.
        jitter_max: largest deviation of a regular interval from their mean, in s.
        gaps: how many intervals are longer than 1.5 times the median.
        longest_gap: the longest of them, in s, 0 without gaps.
        missing: about how many samples the gaps swallowed.
        duplicates: how many timestamps repeat the one before.
        reversals: how many timestamps lie before the one before.
    """

    samples: int
    duration: float
    rate: float
    jitter_rms: float
    jitter_max: float
    gaps: int
    longest_gap: float
    missing: int
    duplicates: int
    reversals: int

    @property
    def even(self) -> bool:
        """Whether the samples may be taken as evenly spaced: no gap, no repeated and no reversed timestamp."""
        return not (self.gaps or self.duplicates or self.reversals)


@traced
def assess(timestamps: ArrayLike) -> SamplingReport:
    """Judge the timestamps of a record.

    Args:
        timestamps: in s, shape (n,).

    Raises:
        Refused: fewer than three timestamps, not all finite, or no two that follow each other.
    """
    times = np.asarray(timestamps, dtype=np.float64)
    if times.ndim != 1 or times.size < 3:
        raise Refused(f"{times.size} timestamps do not tell a sampling rate", "give a record of three samples or more")
    bad = np.flatnonzero(~np.isfinite(times))
    if bad.size:
        raise Refused(f"timestamp {bad[0] + 1} is not a finite number", "look for a hole in the time column")
    steps = np.diff(times)
    forward = steps[steps > 0.0]
    if not forward.size:
        raise Refused("no timestamp is later than the one before", "is this the time column?")
    usual = float(np.median(forward))
    regular = forward[forward <= _GAP * usual]
    long = forward[forward > _GAP * usual]
    deviation = regular - regular.mean()
    return SamplingReport(
        samples=int(times.size),
        duration=float(times[-1] - times[0]),
        rate=float(1.0 / regular.mean()),
        jitter_rms=float(np.sqrt(np.mean(np.square(deviation)))),
        jitter_max=float(np.abs(deviation).max()),
        gaps=int(long.size),
        longest_gap=float(long.max()) if long.size else 0.0,
        missing=int((np.rint(long / usual) - 1.0).sum()),
        duplicates=int((steps == 0.0).sum()),
        reversals=int((steps < 0.0).sum()),
    )


def with_holes(timestamps: ArrayLike, data: ArrayLike, rate: float) -> NDArray[np.float64]:
    """Return data on an even grid, NaN where the timestamps say that samples are missing.

    Each step between timestamps counts as its nearest whole number of intervals, at least one, so that a rate that is a
    little off does not add up over a long record.

    Args:
        timestamps: in s, rising, shape (n,).
        data: shape (n,).
        rate: samples per second.

    Raises:
        Refused: timestamps that do not rise, or that would leave ten times more missing than there is.
    """
    steps = np.diff(np.asarray(timestamps, dtype=np.float64))
    if not (steps > 0.0).all():
        raise Refused(
            "timestamps that repeat or go back cannot be put on a grid",
            "choose a part of the record in which they rise",
        )
    places = np.concatenate([[0], np.cumsum(np.maximum(np.rint(steps * rate), 1.0))]).astype(np.int64)
    if places[-1] > (1 + _MOST_MISSING) * places.size:
        raise Refused(
            f"{places[-1] + 1 - places.size} samples are missing and {places.size} are there",
            "choose a part of the record with fewer gaps, or correct the rate",
        )
    grid = np.full(places[-1] + 1, np.nan)
    grid[places] = np.asarray(data, dtype=np.float64)
    return grid
