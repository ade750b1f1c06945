"""Sampling of a record: rate with uncertainty, jitter, rounding, bursts, gaps, and the grid index of each sample."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.tracing import traced
from hil.model.errors import Refused

__all__ = ["SamplingReport", "assess", "placed", "with_holes"]

_Array: TypeAlias = NDArray[np.float64]
_Places: TypeAlias = NDArray[np.int64]

_MOST_MISSING = 10  # multiple of the present samples
_GAP = 0.5  # of an interval: excess length at which a sample was lost
_SPREAD = 6.0  # the same in robust standard deviations, where that is more
_BURST = 0.3  # share of timestamps that immediately follow the previous one, from which samples come in bursts
_AT_ONCE = 0.25  # of the interval between bursts
_COARSE = 0.2  # of an interval: resolution at which rounding looks like jitter and loss
_LONGEST_STEP, _SHORTEST_STEP = 1e15, 1e-15  # s between timestamps; beyond them squares of rates overflow
_BLOCK = 1 << 14  # intervals processed at once, within the processor's cache
_SAMPLE = 1000  # values for a first estimate of the median
_SHARED = 0.5  # share of repeated timestamps beyond which they are bursts
_FEW, _MANY = 5, 50  # odd intervals: fewer are losses; many losses would drift further
_WANDER = (1.5, 3.0)  # resolutions within which rounded times stay, with few and with many odd intervals


@dataclass(frozen=True, slots=True, kw_only=True)
class SamplingReport:
    """Sampling properties of a record, from its timestamps.

    Attributes:
        samples: number of timestamps.
        duration: time from the first to the last [s].
        rate: sampling rate from count and duration, unaffected by gaps [Hz].
        rate_uncertainty: its standard uncertainty from the scatter of the timestamps [Hz], without the error of the
            clock that wrote them.
        jitter_rms: rms deviation of regular intervals from their mean [s].
        jitter_max: largest deviation of a regular interval from their mean [s].
        gaps: number of intervals too long for one sample: by half an interval, or by more than jitter explains.
        longest_gap: the longest gap [s], 0 without gaps.
        missing: approximate number of samples lost in the gaps.
        duplicates: number of repeated timestamps not explained by rounding or bursts.
        reversals: number of timestamps earlier than the previous one.
        resolution: decimal resolution of the timestamps [s], 0 if there is none.
        rounded: whether uneven intervals are due to rounded timestamps rather than missing samples.
        burst: mean number of samples per read, 1 if they came one by one.
    """

    samples: int
    duration: float
    rate: float
    rate_uncertainty: float
    jitter_rms: float
    jitter_max: float
    gaps: int
    longest_gap: float
    missing: int
    duplicates: int
    reversals: int
    resolution: float
    rounded: bool
    burst: float

    @property
    def even(self) -> bool:
        """Whether the samples can be taken as evenly spaced: no gap, duplicate or reversal."""
        return not (self.gaps or self.duplicates or self.reversals)

    @property
    def jitter(self) -> float:
        """Rms jitter beyond rounding, as a share of an interval."""
        explained = self.resolution**2 / 6.0 if self.rounded else 0.0
        return math.sqrt(max(0.0, self.jitter_rms**2 - explained)) * self.rate


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reads:
    """Samples grouped by the times at which they were read.

    Attributes:
        first: indices of the first sample of each read after the first.
        counts: number of samples in each.
        intervals: time since the previous read [s].
        usual: typical interval per sample [s].
        long: mask of intervals with lost samples.
    """

    first: _Places
    counts: _Places
    intervals: _Array
    usual: float
    long: NDArray[np.bool_]


@traced
def assess(timestamps: ArrayLike) -> SamplingReport:
    """Return the sampling report of a record's timestamps.

    Args:
        timestamps: in s, shape (n,).

    Raises:
        Refused: fewer than three timestamps, not all finite, no two that follow each other, or such that cannot be.
    """
    return placed(timestamps)[0]


def placed(timestamps: ArrayLike) -> tuple[SamplingReport, _Places]:
    """Return the sampling report of a record's timestamps, and each sample's index on an even grid, shape (n,).

    After a gap the index advances by the number of samples lost; all other samples are consecutive, so that a small
    error of the rate does not accumulate over a long record. Where timestamps repeat or go back without explanation,
    indices simply count the samples.

    Args:
        timestamps: in s, shape (n,).

    Raises:
        Refused: fewer than three timestamps, not all finite, no two that follow each other, or such that cannot be.
    """
    times = np.asarray(timestamps, dtype=np.float64)
    if times.ndim != 1 or times.size < 3:
        raise Refused(f"{times.size} timestamps do not tell a sampling rate", "give a record of three samples or more")
    if not np.isfinite(times).all():
        bad = np.flatnonzero(~np.isfinite(times))
        raise Refused(f"timestamp {bad[0] + 1} is not a finite number", "look for a hole in the time column")
    steps = np.diff(times)
    apart = max(float(steps.max()), -float(steps.min()))
    if apart > _LONGEST_STEP or 0.0 < apart < _SHORTEST_STEP:
        raise Refused(f"timestamps are up to {apart:.3g} s apart, which cannot be", "is this the time column?")
    if report := _regular(times, steps):
        del steps  # frees an array as large as the times
        return report, np.arange(times.size, dtype=np.int64)
    if not (steps > 0.0).any():
        raise Refused("no timestamp is later than the one before", "is this the time column?")
    resolution = _resolution(times, float(np.abs(steps).max()))
    reads = _rounded(times, steps, resolution)
    rounded = reads is not None
    reads = reads or _grouped(times, steps)
    lost = np.zeros(reads.intervals.size)
    lost[reads.long] = np.maximum(np.rint(reads.intervals[reads.long] / reads.usual - reads.counts[reads.long]), 1.0)
    places = np.arange(times.size, dtype=np.int64)
    report = _report(times, steps, reads, lost, resolution, rounded=rounded)
    if lost.any() and not (report.duplicates or report.reversals):
        moved = np.zeros(times.size)
        moved[reads.first] = lost
        places += np.cumsum(moved).astype(np.int64)
    return report, places


def _regular(times: _Array, steps: _Array) -> SamplingReport | None:
    """Fast path of `_report`, ten times quicker, if no interval can be a gap, a burst or rounding; None otherwise.

    If the longest interval is below 1.5 times the shortest, each is within half of the typical one.
    """
    shortest, longest = float(steps.min()), float(steps.max())
    if not shortest > 0.0:
        return None
    if longest >= (1.0 + _GAP) * shortest:
        middle = _median(steps)
        if longest > (1.0 + _GAP) * middle or shortest < _GAP * middle:
            return None
    resolution = _resolution(times, longest)
    if resolution >= _COARSE * shortest and longest - shortest > 0.5 * resolution:
        return None
    duration = float(times[-1] - times[0])
    usual = duration / steps.size
    power, wandered, squared = 0.0, 0.0, 0.0
    for begin in range(0, steps.size, _BLOCK):
        part = steps[begin : begin + _BLOCK] - usual
        power += float(np.einsum("i,i->", part, part))
        wander = np.arange(begin + 1.0, begin + 1.0 + part.size)
        wander *= -usual
        wander += times[begin + 1 : begin + 1 + part.size]
        wander -= times[0]
        wandered += float(wander.sum())
        squared += float(np.einsum("i,i->", wander, wander))
    jitter = math.sqrt(power / steps.size)
    spread = math.sqrt(max(0.0, squared / steps.size - (wandered / steps.size) ** 2))
    return SamplingReport(
        samples=int(times.size),
        duration=duration,
        rate=1.0 / usual,
        rate_uncertainty=_ends(spread, jitter, resolution, steps.size) / duration / usual,
        jitter_rms=jitter,
        jitter_max=max(longest - usual, usual - shortest),
        gaps=0,
        longest_gap=0.0,
        missing=0,
        duplicates=0,
        reversals=0,
        resolution=resolution,
        rounded=False,
        burst=1.0,
    )


def _report(
    times: _Array, steps: _Array, reads: _Reads, lost: _Array, resolution: float, *, rounded: bool
) -> SamplingReport:
    regular = ~reads.long & (reads.intervals > 0.0)
    intervals, counts = reads.intervals[regular], reads.counts[regular]
    single = bool((counts == 1).all()) and not rounded
    usual = float(intervals.mean()) if single else reads.usual
    deviation = intervals - counts * usual
    long = reads.intervals[reads.long]
    burst = times.size / (reads.first.size + 1)
    explained = rounded or burst > 1.0
    jitter = float(np.sqrt(np.mean(np.square(deviation))))
    return SamplingReport(
        samples=int(times.size),
        duration=float(times[-1] - times[0]),
        rate=1.0 / usual,
        rate_uncertainty=_uncertainty(deviation, counts, usual, resolution),
        jitter_rms=jitter,
        jitter_max=float(np.abs(deviation).max()),
        gaps=int(long.size),
        longest_gap=float(long.max()) if long.size else 0.0,
        missing=int(lost.sum()),
        duplicates=0 if explained else int((steps == 0.0).sum()),
        reversals=int((steps < 0.0).sum()),
        resolution=resolution,
        rounded=rounded,
        burst=burst,
    )


def _uncertainty(deviation: _Array, counts: _Places, usual: float, resolution: float) -> float:
    """Return the uncertainty of the rate in Hz: that of both end times over the duration.

    Jitter of the timestamps does not accumulate. Jitter of the sampling itself accumulates to a random walk, which is
    recognised by its extent.
    """
    wander = np.cumsum(deviation)
    wander -= np.linspace(0.0, wander[-1], wander.size)
    jitter = float(np.sqrt(np.mean(np.square(deviation))))
    ends = _ends(float(wander.std()), jitter, resolution, wander.size)
    return ends / (float(counts.sum()) * usual) / usual


def _ends(spread: float, jitter: float, resolution: float, count: int) -> float:
    """Return the uncertainty of the duration in s.

    Args:
        spread: standard deviation of the times from an even grid.
        jitter: jitter of the intervals.
        resolution: resolution of the times.
        count: number of intervals.
    """
    ends = math.sqrt(2.0) * max(spread, resolution / math.sqrt(12.0), jitter / math.sqrt(2.0))
    return max(ends, jitter * math.sqrt(count)) if spread > 2.0 * jitter else ends


def _resolution(times: _Array, usual: float) -> float:
    """Return the decimal resolution of timestamps: the largest power of ten in s that divides them; 0 if below 1 ns.

    Args:
        times: timestamps in s; a thousand of them are examined.
        usual: upper bound of the resolution, the typical interval [s].
    """
    looked = np.concatenate([times[:500], times[-500:]]) - times[0]
    error = 8.0 * np.spacing(max(abs(float(times.max())), abs(float(times.min()))))
    for power in range(min(3, math.floor(math.log10(usual)) + 1) if usual > 0.0 else 0, -10, -1):
        step = 10.0**power
        if (np.abs(looked - np.rint(looked / step) * step) <= error + 1e-6 * step).all():
            return step
    return 0.0


def _grouped(times: _Array, steps: _Array) -> _Reads:
    """Group samples that were read together, and find the intervals too long for their number of samples."""
    first = np.arange(1, times.size, dtype=np.int64)
    middle = _median(steps)
    if not middle > 0.0 or float(steps.mean()) > (1.0 + _GAP) * middle or (steps < _GAP * middle).any():
        carrying = _carrying(steps)
        if ((steps >= 0.0) & (steps < _AT_ONCE * carrying)).mean() >= _BURST:
            first = np.flatnonzero(steps >= _AT_ONCE * carrying).astype(np.int64) + 1
    counts = np.diff(np.append(first, times.size))
    intervals = np.diff(times[np.concatenate([[0], first])])
    if first.size == times.size - 1:
        usual = middle = _median(steps[steps > 0.0])
    else:
        usual, middle = _median(intervals / counts), _median(intervals)
    late = intervals - counts * usual
    long = late > _GAP * middle
    if long.any():
        spread = 1.4826 * _median(np.abs(late[intervals > 0.0]))
        long = late > max(_GAP * middle, _SPREAD * spread)
    if (counts > 1).any():
        usual = float(intervals[~long].sum() / counts[~long].sum())
    return _Reads(first=first, counts=counts, intervals=intervals, usual=usual, long=long)


def _carrying(steps: _Array) -> float:
    """Return the time-weighted median interval without gaps: the one between bursts, if there are any."""
    forward = np.sort(steps[steps > 0.0])
    share = 0.99 if steps.size >= 200 else 0.95
    usual = forward[forward <= 3.0 * forward[int(share * (forward.size - 1))]]
    total = np.cumsum(usual)
    return float(usual[np.searchsorted(total, total[-1] / 2.0)])


def _rounded(times: _Array, steps: _Array, resolution: float) -> _Reads | None:
    """Return the reads of evenly spaced samples with coarsely rounded timestamps, None if they are not.

    Rounded times stay within one resolution of an even grid throughout. With missing samples they would drift away from
    any even grid.
    """
    usual = _median(steps[steps > 0.0])
    if not resolution >= _COARSE * usual or (steps < 0.0).any() or (steps == 0.0).mean() > _SHARED:
        return None
    long = steps > 3.0 * (usual + resolution)
    odd = int((np.abs(steps[~long] - usual) > resolution / 2.0).sum())
    if odd < _FEW:
        return None
    mean = float(steps[~long].mean())
    wander = np.cumsum(np.where(long, 0.0, steps - mean))
    edges = [0, *(np.flatnonzero(long) + 1).tolist(), steps.size]
    most = _WANDER[odd >= _MANY] * resolution
    if any(np.ptp(wander[begin:end]) > most for begin, end in itertools.pairwise(edges) if end > begin):
        return None
    first = np.arange(1, times.size, dtype=np.int64)
    return _Reads(first=first, counts=np.ones_like(first), intervals=steps, usual=mean, long=long)


def _median(values: _Array) -> float:
    """Return the exact median, sorting only the values between two quantiles of a sample of them."""
    if values.size < _BLOCK:
        return float(np.median(values))
    low, high = np.quantile(values[:: values.size // _SAMPLE], (0.45, 0.55))
    below = int(np.count_nonzero(values < low))
    between = values[(values >= low) & (values <= high)]
    first, second = (values.size - 1) // 2 - below, values.size // 2 - below
    if not 0 <= first <= second < between.size:
        return float(np.median(values))
    between.partition([first, second])
    return 0.5 * float(between[first] + between[second])


def with_holes(places: NDArray[np.int64], data: ArrayLike) -> NDArray[np.float64]:
    """Place data on an even grid, with NaN for missing samples; shape (max(places) + 1,).

    Args:
        places: grid index of each sample, from `placed`, ascending, shape (n,).
        data: samples, shape (n,).

    Raises:
        Refused: more than ten times as many samples are missing as are present.
    """
    values = np.asarray(data, dtype=np.float64)
    if places[-1] > (1 + _MOST_MISSING) * places.size:
        raise Refused(
            f"{places[-1] + 1 - places.size} samples are missing and {places.size} are there",
            "choose a part of the record with fewer gaps, or correct the rate",
        )
    if places[-1] + 1 == places.size:
        return values
    grid = np.full(places[-1] + 1, np.nan)
    grid[places] = values
    return grid
