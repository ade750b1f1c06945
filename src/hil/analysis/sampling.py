"""The sampling of a record: rate and its uncertainty, jitter, rounding, bursts, gaps, and the place of each sample."""

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

_MOST_MISSING = 10  # times the samples that are there
_GAP = 0.5  # of an interval: one longer than the usual by more has lost a sample
_SPREAD = 6.0  # robust standard deviations that an interval may be longer, where that is more
_BURST = 0.3  # share of timestamps that follow the one before at once, from which samples come in bursts
_AT_ONCE = 0.25  # of the interval between bursts
_COARSE = 0.2  # of an interval: a resolution from which rounding looks like jitter and loss
_LONGEST_STEP, _SHORTEST_STEP = 1e15, 1e-15  # s between timestamps; beyond them squares of rates leave the range
_BLOCK = 1 << 14  # intervals that are looked at at once, within the processor's cache
_SAMPLE = 1000  # values that tell about where the median is
_SHARED = 0.5  # share of timestamps that repeat the one before, beyond which they are bursts
_FEW, _MANY = 5, 50  # odd intervals: fewer are losses; of many, losses would wander further
_WANDER = (1.5, 3.0)  # resolutions that rounded times keep to, with few and with many odd intervals


@dataclass(frozen=True, slots=True, kw_only=True)
class SamplingReport:
    """The sampling of a record, according to its timestamps.

    Attributes:
        samples: number of timestamps.
        duration: from the first to the last, in s.
        rate: samples per second, from their count and the time that they took; gaps do not lower it.
        rate_uncertainty: its standard uncertainty from the scatter of the timestamps, in Hz; the error of the clock
            that wrote them is not in it.
        jitter_rms: root mean square deviation of a regular interval from their mean, in s.
        jitter_max: largest deviation of a regular interval from their mean, in s.
        gaps: how many intervals are too long for one sample: by half an interval, or by more than the jitter explains.
        longest_gap: the longest of them, in s, 0 without gaps.
        missing: about how many samples the gaps swallowed.
        duplicates: how many timestamps repeat the one before, without rounding or bursts that explain it.
        reversals: how many timestamps lie before the one before.
        resolution: decimal step of the timestamps in s, 0 if there is none.
        rounded: whether intervals differ because the timestamps are rounded, and not because samples are missing.
        burst: mean number of samples that were read at once, 1 if they came one by one.
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
        """Whether the samples may be taken as evenly spaced: no gap, no repeated and no reversed timestamp."""
        return not (self.gaps or self.duplicates or self.reversals)

    @property
    def jitter(self) -> float:
        """Jitter that rounding does not explain, rms, as a share of an interval."""
        explained = self.resolution**2 / 6.0 if self.rounded else 0.0
        return math.sqrt(max(0.0, self.jitter_rms**2 - explained)) * self.rate


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reads:
    """Samples by the moments at which they were read.

    Attributes:
        first: places of the first sample of each read but the first one.
        counts: samples in each of them.
        intervals: from the read before, in s.
        usual: interval of one sample, in s.
        long: which intervals have lost samples.
    """

    first: _Places
    counts: _Places
    intervals: _Array
    usual: float
    long: NDArray[np.bool_]


@traced
def assess(timestamps: ArrayLike) -> SamplingReport:
    """Judge the timestamps of a record.

    Args:
        timestamps: in s, shape (n,).

    Raises:
        Refused: fewer than three timestamps, not all finite, no two that follow each other, or such that cannot be.
    """
    return placed(timestamps)[0]


def placed(timestamps: ArrayLike) -> tuple[SamplingReport, _Places]:
    """Judge the timestamps of a record, and return the place of each sample on an even grid as well.

    A sample that follows a gap is moved by as many places as the gap has lost; all others follow each other, so that a
    rate that is a little off does not add up over a long record. Where timestamps repeat or go back without a reason,
    places count the samples only.

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
        del steps  # as large as the times
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
    """Return what `_report` does where no interval can be a gap, a burst or rounding, for a tenth of the time.

    Where the longest interval is below 1.5 times the shortest, every one is within half of the usual one.
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
    """Return the uncertainty of the rate in Hz: that of both ends over what lies between them.

    Jitter of the clock that stamps samples stays where it is. Jitter of the samples themselves adds up to a walk; it
    is known by its length.
    """
    wander = np.cumsum(deviation)
    wander -= np.linspace(0.0, wander[-1], wander.size)
    jitter = float(np.sqrt(np.mean(np.square(deviation))))
    ends = _ends(float(wander.std()), jitter, resolution, wander.size)
    return ends / (float(counts.sum()) * usual) / usual


def _ends(spread: float, jitter: float, resolution: float, count: int) -> float:
    """Return the uncertainty of the time between both ends, in s.

    Args:
        spread: standard deviation of the times from an even grid.
        jitter: of the intervals.
        resolution: of the times.
        count: of the intervals.
    """
    ends = math.sqrt(2.0) * max(spread, resolution / math.sqrt(12.0), jitter / math.sqrt(2.0))
    return max(ends, jitter * math.sqrt(count)) if spread > 2.0 * jitter else ends


def _resolution(times: _Array, usual: float) -> float:
    """Return the largest power of ten in s that timestamps are multiples of; 0 if there is none above 1 ns.

    Args:
        times: timestamps in s; a thousand of them are looked at.
        usual: longest interval.
    """
    looked = np.concatenate([times[:500], times[-500:]]) - times[0]
    error = 8.0 * np.spacing(max(abs(float(times.max())), abs(float(times.min()))))
    for power in range(min(3, math.floor(math.log10(usual)) + 1) if usual > 0.0 else 0, -10, -1):
        step = 10.0**power
        if (np.abs(looked - np.rint(looked / step) * step) <= error + 1e-6 * step).all():
            return step
    return 0.0


def _grouped(times: _Array, steps: _Array) -> _Reads:
    """Group samples that were read at once, and find the intervals that are too long for what was read."""
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
    """Return the interval up to which half of the time is spent, gaps aside: that between bursts, if there are any."""
    forward = np.sort(steps[steps > 0.0])
    share = 0.99 if steps.size >= 200 else 0.95
    usual = forward[forward <= 3.0 * forward[int(share * (forward.size - 1))]]
    total = np.cumsum(usual)
    return float(usual[np.searchsorted(total, total[-1] / 2.0)])


def _rounded(times: _Array, steps: _Array, resolution: float) -> _Reads | None:
    """Return the intervals of evenly spaced samples whose timestamps are rounded coarsely, None if they are not such.

    Rounded times keep within one resolution of an even grid, all along. If samples were missing instead, they would
    move away from every even grid.
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
    """Return the median, exactly: of many values only those are ordered that lie between two quantiles of a sample."""
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
    """Return data on an even grid, NaN where samples are missing.

    Args:
        places: of each sample on the grid, from `placed`, rising, shape (n,).
        data: shape (n,).

    Raises:
        Refused: ten times more samples are missing than are there.
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
