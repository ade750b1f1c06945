"""Gates on extremes and resolution: clipping, spikes, and steps too coarse for the noise."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hil.analysis.gates import Facts, Gate, numbers, present

__all__ = ["averaged", "resolved", "robust", "rounding", "saturated", "spikes", "step_of"]

_Array: TypeAlias = NDArray[np.float64]

_FEWEST = 5  # samples beyond the tail that never count as too many
_ROUNDING = 1e-9  # of the value: smaller steps are rounding
_NEAR_FULL = 0.999  # of full scale
_ENOUGH = 20  # samples needed to judge extremes and neighbours
_PILED, _VISITS = 5, 3  # equal extreme samples, and visits to the extreme, from which clipping is possible
_PILE = 2.0  # ratio of their number to that beside them
_ALIKE = 5.0  # ratio to the number at any one level beside them: a slow sine dwells 1.4 times longer at its end
_SPREADS, _BEYOND = 2.0, 10.0  # tolerance of the last two levels in standard deviations, and samples beyond them
_NEAR_END = 0.08  # of the distance between quartiles: a tenth of a standard deviation
_WIDTHS = (1, 4, 16, 64)  # samples averaged: a knock is most visible in averages as long as it lasts
_FINE = 0.6  # of a standard deviation: with a larger step the robust scatter is itself one step
_TAIL, _BEYOND_TAIL = 3.0, 0.0293  # standard deviations, and the share of white noise's power beyond them
_MORE = 0.015  # of the power: white noise then reads half of this too large
_BY_CHANCE_MORE = 3.4  # over the root of the number of samples: 6,000 records of white noise reached at most 3.2
_BY_CHANCE = 1e-6  # false-alarm probability per record of white noise
_BLOCK = 1 << 14  # samples processed at once, within the processor's cache
_ENOUGH_FOR_QUARTERS = 100_000  # samples that give quartiles to half a percent of the scatter
_LOOKED_AT = 10_000  # samples examined individually
_AROUND, _WIDEST = 8, 3  # samples on either side of a spike, and the most that it may span
_SAME, _MOST_LEVELS = 1e-2, 20_000
_RESOLVED = 0.5  # counts: with less noise quantisation is no longer white noise of variance q^2 / 12
_BLUE, _RESOLVED_BLUE = 0.8, 0.6  # of the variance of neighbours; counts needed under quantisation of the angle


def saturated(channel: str, values: _Array, facts: Facts) -> Gate:
    """Trip where a value is at full scale, or if that is unknown, where many share the highest or lowest value.

    Unclipped noise thins out towards its extremes: fewer samples have the last value than the one beside it.
    """
    if facts.full_scale is None:
        return _clipped(channel, values)
    limit = _NEAR_FULL * facts.full_scale
    full = np.flatnonzero(((values >= limit) | (values <= -limit)) & np.isfinite(values))
    reason = f"{full.size} of {values.size} samples are at full scale, {facts.full_scale:g}"
    return Gate(name="saturated", channel=channel, ok=not full.size, reason=reason, samples=numbers(full))


def _clipped(channel: str, values: _Array) -> Gate:
    here = present(values)
    unknown = Gate(name="saturated", channel=channel, ok=None, reason="the full scale is not known")
    if here.size < _ENOUGH:
        return unknown
    quarters = np.quantile(here[:: max(1, here.size // _ENOUGH_FOR_QUARTERS)], (0.25, 0.75))
    width = float(quarters[1] - quarters[0]) * _NEAR_END
    step = step_of(here) or 0.0
    for end in (float(here.max()), float(here.min())):
        reason = ""
        if step > width and _cut_off(here, end, step):
            reason = f"more samples are at {end:.6g} than noise that goes beyond it leaves there: clipped"
        elif width > 0.0:
            at = here == end
            count = int(np.count_nonzero(at))
            if not _PILED <= count < 0.9 * here.size or np.count_nonzero(at[1:] > at[:-1]) < _VISITS:
                continue
            beside = here[(np.abs(here - end) <= max(width, 1.5 * step)) & ~at]
            told = f"{count} of {values.size} samples are at {end:.6g}"
            if count > _PILE * (beside.size + math.sqrt(beside.size)):
                reason = f"{told} and only {beside.size} near it: clipped"
            elif count > _ALIKE * np.unique(beside, return_counts=True)[1].max():
                reason = f"{told}, far more than at any other number near it: clipped"
        if reason:
            samples = numbers(np.flatnonzero(values == end))
            return Gate(name="saturated", channel=channel, ok=False, reason=reason, samples=samples)
    return unknown


def _cut_off(here: _Array, end: float, step: float) -> bool:
    """Return whether the levels end where Gaussian noise would continue, whatever the drift beneath it.

    The level counts n of such noise with a standard deviation of s counts, around any moving mean, never fall faster
    than n[k + 1] n[k - 1] = n[k]^2 exp(-1 / s^2): the log of a mixture of Gaussian densities has a second derivative of
    at least -1 / s^2. So the last two levels bound the number of samples at the next one from below.
    """
    last, both = (int(np.count_nonzero(np.abs(here - end) < part * step)) for part in (0.5, 1.5))
    second = both - last
    power, count = _moves(here)
    variance = min(power / max(count, 1) / 2.0, float(here.var())) / step**2 - 1.0 / 12.0
    if min(last, second) < _ENOUGH or variance <= 0.0:
        return False
    chance = math.sqrt(4.0 / last + 1.0 / second)
    return math.log(last**2 / second) - 1.0 / variance - _SPREADS * chance > math.log(_BEYOND)


def spikes(channel: str, values: _Array) -> Gate:
    """Trip on outliers far beyond chance: single samples, and longer knocks.

    Averages over 1, 4, 16 and 64 samples are compared with the mean of their two neighbours; s is the robust scatter of
    these differences. White noise exceeds the limit of about 7 s once in a million records. An outlier in an equally
    restless neighbourhood is motion, not a spike. Samples beyond 3 s that carry more power than the tail of white noise
    trip too: the noise is then not homogeneous.
    """
    name = "spikes"
    step = step_of(values) or 0.0
    reason, heavy = "", None
    means = values
    for width, finer in zip(_WIDTHS, (1, *_WIDTHS), strict=False):
        means = averaged(means, width // finer)
        if means.size < (_ENOUGH if width == 1 else 4 * _ENOUGH):
            break
        count = means.size - 2
        scatter = max(robust(means, step if width == 1 else 0.0), 0.5 * step / width)
        if not scatter > 0.0:
            continue
        limit = math.sqrt(2.0 * math.log(means.size / _BY_CHANCE))
        tail, off = _standing_out(means, min(limit, _TAIL) * scatter)
        off /= scatter
        far = tail[off > limit]
        alone = [place for place in far[:_LOOKED_AT].tolist() if _alone(means, place, limit * scatter)]
        if alone:
            found = np.array(alone, dtype=np.intp)
            height = float(off[np.isin(tail, found)].max())
            one, more = ("sample", "samples") if width == 1 else (f"average over {width}", f"averages over {width}")
            stand = f"1 {one} stands" if found.size == 1 else f"{found.size} {more} stand"
            told = f"{stand} out of the noise by up to {height:.3g} standard deviations"
            reason = f"{told}, the first is number {found[0] * width + 1}"
            return Gate(name=name, channel=channel, ok=False, reason=reason, samples=numbers(found * width))
        if width == 1 and step < _FINE * scatter:
            power = float(np.einsum("i,i->", off, off)) / count
            allowed = _BEYOND_TAIL + max(_MORE, _BY_CHANCE_MORE / math.sqrt(count))
            if tail.size > _FEWEST and power > allowed:
                told = f"{tail.size} samples stand out by more than {_TAIL:g} standard deviations"
                more = f"{told} and hold {power:.1%} of the power, where chance makes {_BEYOND_TAIL:.1%}"
                heavy = Gate(
                    name=name, channel=channel, ok=False, reason=f"{more}, the first is number {tail[0] + 1}",
                    samples=numbers(tail),
                )  # fmt: skip
        reason = reason or f"no sample stands out by {limit:.1f} standard deviations"
    if heavy is not None:
        return heavy
    if not reason:
        return Gate(name=name, channel=channel, ok=None, reason="there is too little noise to hold spikes against")
    return Gate(name=name, channel=channel, ok=True, reason=reason)


def averaged(values: _Array, width: int) -> _Array:
    """Return the means over `width` samples each, a power of two; shape (n,) becomes (n // width,)."""
    if width == 1:
        return values
    means = np.empty(values.size // width)
    for begin in range(0, means.size * width, _BLOCK):
        sums = values[begin : min(begin + _BLOCK, means.size * width)]
        for _ in range(width.bit_length() - 1):
            sums = sums[::2] + sums[1::2]
        np.divide(sums, width, out=means[begin // width : begin // width + sums.size])
    return means


def robust(values: _Array, step: float = 0.0) -> float:
    """Return the robust scatter of samples about the mean of their neighbours, from a subset of a long record.

    Differences of quantised readings, and so their median, are multiples of half a step: the median is then taken with
    the differences spread uniformly over each half step.
    """
    every = max(1, (values.size - 2) // 100_000)
    looked = values[1:-1:every] - 0.5 * (values[:-2:every] + values[2::every])
    looked = np.abs(looked[np.isfinite(looked)])
    if not looked.size:
        return 0.0
    middle, half = float(np.median(looked)), 0.25 * step
    at = float(np.mean(np.abs(looked - middle) <= half)) if half and middle > half else 0.0
    if at:
        middle += half * (1.0 - 2.0 * float(np.mean(looked < middle - half))) / at - half
    return 1.4826 * middle


def _standing_out(values: _Array, limit: float) -> tuple[NDArray[np.intp], _Array]:
    """Return the indices of samples that deviate from the mean of their neighbours beyond a limit, and how much."""
    places, heights = [], []
    for begin in range(0, values.size - 2, _BLOCK):
        part = values[begin : begin + _BLOCK + 2]
        off = part[2:] + part[:-2]
        off *= -0.5
        off += part[1:-1]
        np.abs(off, out=off)
        with np.errstate(invalid="ignore"):
            far = np.flatnonzero(off > limit)
        places.append(far + (begin + 1))
        heights.append(off[far])
    return np.concatenate(places), np.concatenate(heights)


def _alone(values: _Array, place: int, limit: float) -> bool:
    """Return whether a sample, with at most two others, stands out of a quiet neighbourhood."""
    around = values[max(0, place - _AROUND) : place + _AROUND + 1]
    around = around[np.isfinite(around)]
    away = np.abs(around - np.median(around))
    high = abs(float(values[place] - np.median(around)))
    return high > 0.7 * limit and int((away > high / 3.0).sum()) <= _WIDEST


def rounding(values: _Array, facts: Facts) -> float:
    """Return the relative excess of white noise due to rounding to counts; 0 if there is no step.

    Rounding adds a variance of q^2 / 12 to that of the noise.
    """
    lsb = facts.lsb or step_of(values)
    if lsb is None:
        return 0.0
    power, count = _moves(values)
    if not count:
        return 0.0
    variance = power / count / 2.0 / lsb**2
    return 1.0 / math.sqrt(1.0 - 1.0 / (12.0 * variance)) - 1.0 if variance > 1.0 / 6.0 else 0.0


def _moves(values: _Array) -> tuple[float, int]:
    """Return the sum of squared differences of finite neighbours, and their number."""
    power, count = 0.0, 0
    for begin in range(0, values.size - 1, _BLOCK):
        steps = np.diff(values[begin : begin + _BLOCK + 1])
        part = float(np.einsum("i,i->", steps, steps))
        if not math.isfinite(part):
            steps = steps[np.isfinite(steps)]
            part = float(np.einsum("i,i->", steps, steps))
        power, count = power + part, count + steps.size
    return power, count


def _stretches(values: NDArray[np.float64]) -> float:
    """Return the mean variance within stretches of 32 samples, of up to 4096 stretches; infinity if there are none."""
    if values.size < _STRETCH:
        return math.inf
    starts = np.linspace(0, values.size - _STRETCH, min(_STRETCHES, values.size // _STRETCH)).astype(np.int64)
    rows = np.lib.stride_tricks.sliding_window_view(values, _STRETCH)[starts]
    rows = rows[np.isfinite(rows).all(axis=1)]
    return float(rows.var(axis=1, ddof=1).mean()) if rows.size else math.inf


_STRETCH, _STRETCHES = 32, 4096


def step_of(values: _Array) -> float | None:
    """Return the step of readings that are multiples of one, None if the first readings show none."""
    looked = present(values[:_MOST_LEVELS])
    if looked.size < min(_MOST_LEVELS, values.size):
        looked = present(values)[:_MOST_LEVELS]
    levels = np.unique(looked)
    if levels.size < 2 or levels.size > looked.size / 2:
        return None
    steps = np.diff(levels)
    steps = steps[steps > _ROUNDING * max(float(np.abs(levels).max()), float(np.ptp(levels)))]
    if not steps.size:
        return None
    least = float(steps.min())
    counts = np.rint(steps / least)
    least = float(steps.sum() / counts.sum())
    return least if float(np.median(np.abs(steps / least - np.rint(steps / least)))) <= _SAME else None


def resolved(channel: str, values: NDArray[np.float64], facts: Facts) -> Gate:
    """Trip where the noise before the quantiser is below half a count.

    The noise of the readings then no longer follows sqrt(s^2 + q^2 / 12), may vanish, and averaging does not help. s is
    taken from differences of neighbours, so that drift does not count as noise; quantisation of the angle separates
    neighbours by more than its scatter, so short stretches of the record must scatter as well.
    """
    lsb = facts.lsb or step_of(values)
    if lsb is None:
        return Gate(name="resolved", channel=channel, ok=None, reason="what one count is worth is not known")
    power, count = _moves(values)
    if not count:
        return Gate(name="resolved", channel=channel, ok=None, reason="no two samples follow each other")
    moves, stretches = power / count / 2.0, _stretches(values)
    scatter = math.sqrt(min(moves, stretches)) / lsb
    least = math.hypot(_RESOLVED_BLUE if stretches < _BLUE * moves else _RESOLVED, 1.0 / math.sqrt(12.0))
    reason = f"samples scatter by {scatter:.2g} counts, and {least:.2g} are needed"
    if facts.lsb is None:
        reason += f"; one count is {lsb:.4g}, as the readings show"
    return Gate(name="resolved", channel=channel, ok=scatter >= least, reason=reason)
