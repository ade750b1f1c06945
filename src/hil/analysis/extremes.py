"""Gates on extremes and on resolution: readings that are clipped, spiked, or too coarse for their noise."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hil.analysis.gates import Facts, Gate, numbers

__all__ = ["resolved", "rounding", "saturated", "spikes"]

_Array: TypeAlias = NDArray[np.float64]

_FEWEST = 5  # samples beyond the tail that are never called too many
_ROUNDING = 1e-9  # of the value: steps below this are none
_NEAR_FULL = 0.999  # of full scale
_ENOUGH = 20  # samples from which extremes and neighbours are judged
_PILED, _VISITS = 5, 3  # equal extreme samples, and times that the signal came there, from which it may be clipped
_PILE = 2.0  # times what lies beside them
_SURE = 4.0  # standard deviations of the counts
_NEAR_END = 0.08  # of the distance between quartiles: a tenth of a standard deviation
_WIDTHS = (1, 4, 16, 64)  # samples that are averaged: a knock shows where they are as many as it took
_FINE = 0.6  # of a standard deviation: with a larger step the robust scatter is a step as well
_TAIL, _BEYOND_TAIL = 4.0, 6.3e-5  # standard deviations, and the share of white noise beyond them
_BY_CHANCE = 1e-6  # records of white noise in which a spike is found
_LOOKED_AT = 10_000  # samples that are looked at one by one
_AROUND, _WIDEST = 8, 3  # samples on either side of a spike, and how many of them it may take
_SAME, _MOST_LEVELS = 1e-2, 20_000
_RESOLVED = 0.5  # counts: with less noise than this the step is no longer white noise of q^2 / 12


def saturated(channel: str, values: _Array, facts: Facts) -> Gate:
    """Trip where a value is at full scale; where that is not known, where many share the highest or lowest value.

    Noise that is not clipped thins out towards its extremes: it leaves fewer samples at the last value than beside it.
    """
    if facts.full_scale is None:
        return _clipped(channel, values)
    full = np.flatnonzero(np.isfinite(values) & (np.abs(values) >= _NEAR_FULL * facts.full_scale))
    reason = f"{full.size} of {values.size} samples are at full scale, {facts.full_scale:g}"
    return Gate(name="saturated", channel=channel, ok=not full.size, reason=reason, samples=numbers(full))


def _clipped(channel: str, values: _Array) -> Gate:
    present = values[np.isfinite(values)]
    unknown = Gate(name="saturated", channel=channel, ok=None, reason="the full scale is not known")
    if present.size < _ENOUGH:
        return unknown
    quarters = np.quantile(present, (0.25, 0.75))
    width = float(quarters[1] - quarters[0]) * _NEAR_END
    step = _step(present) or 0.0
    for end in (float(present.max()), float(present.min())):
        if step > width and _piled(present, end, step):
            reason = f"more samples are at {end:.6g} than the levels below it let expect: clipped"
            return Gate(
                name="saturated",
                channel=channel,
                ok=False,
                reason=reason,
                samples=numbers(np.flatnonzero(values == end)),
            )
        away = np.abs(present - end)
        at = int((away == 0.0).sum())
        beside = int((away <= max(width, 1.5 * step)).sum()) - at
        visits = int(np.count_nonzero(np.diff((away == 0.0).astype(np.int8)) == 1))
        if (
            width > 0.0
            and at >= _PILED
            and visits >= _VISITS
            and at > _PILE * (beside + math.sqrt(beside))
            and at < 0.9 * present.size
        ):
            reason = f"{at} of {values.size} samples are at {end:.6g} and only {beside} near it: clipped"
            return Gate(
                name="saturated",
                channel=channel,
                ok=False,
                reason=reason,
                samples=numbers(np.flatnonzero(values == end)),
            )
    return unknown


def _piled(present: _Array, end: float, step: float) -> bool:
    """Tell whether the last level holds more than a tail of noise, which has n0 n2 <= n1^2 as Gauss' has."""
    level = np.rint(np.abs(present - end) / step)
    last, second, third = (int((level == place).sum()) for place in range(3))
    if min(last, second, third) < _ENOUGH:
        return False
    spread = math.sqrt(1.0 / last + 4.0 / second + 1.0 / third)
    return math.log(last * third / second**2) > _SURE * spread


def spikes(channel: str, values: _Array) -> Gate:
    """Trip where samples stand out of noise by far more than chance explains: single ones, and knocks that last.

    Averages over 1, 4, 16 and 64 samples are held against the mean of their two neighbours; s is the robust scatter of
    these differences. White noise passes the limit of about 7 s once in a million records. What stands in a
    neighbourhood that is as restless is motion, and no spike. Many samples beyond 4 s trip as well: then the noise is
    not one noise.
    """
    name = "spikes"
    step = _step(values[np.isfinite(values)]) or 0.0
    reason = ""
    for width in _WIDTHS:
        means = values[: values.size // width * width].reshape(-1, width).mean(axis=1) if width > 1 else values
        if means.size < (_ENOUGH if width == 1 else 4 * _ENOUGH):
            break
        off = means[1:-1] - 0.5 * (means[:-2] + means[2:])
        scatter = max(_robust(off), 0.5 * step / width)
        if not scatter > 0.0:
            continue
        limit = math.sqrt(2.0 * math.log(means.size / _BY_CHANCE))
        with np.errstate(invalid="ignore"):
            far = np.flatnonzero(np.abs(off) > limit * scatter) + 1
        alone = [place for place in far[:_LOOKED_AT].tolist() if _alone(means, place, limit * scatter)]
        if alone:
            found = np.array(alone, dtype=np.intp)
            height = float(np.abs(off[found - 1]).max()) / scatter
            one, more = ("sample", "samples") if width == 1 else (f"average over {width}", f"averages over {width}")
            stand = f"1 {one} stands" if found.size == 1 else f"{found.size} {more} stand"
            told = f"{stand} out of the noise by up to {height:.3g} standard deviations"
            reason = f"{told}, the first is number {found[0] * width + 1}"
            return Gate(name=name, channel=channel, ok=False, reason=reason, samples=numbers(found * width))
        if width == 1 and step < _FINE * scatter:
            tail = np.flatnonzero(np.abs(off) > _TAIL * scatter) + 1
            expected = off.size * _BEYOND_TAIL
            if tail.size > _FEWEST + 10.0 * expected:
                told = f"{tail.size} samples stand out by more than {_TAIL:g} standard deviations"
                reason = f"{told}, where chance makes {expected:.1g}, the first is number {tail[0] + 1}"
                return Gate(name=name, channel=channel, ok=False, reason=reason, samples=numbers(tail))
        reason = reason or f"no sample stands out by {limit:.1f} standard deviations"
    if not reason:
        return Gate(name=name, channel=channel, ok=None, reason="there is too little noise to hold spikes against")
    return Gate(name=name, channel=channel, ok=True, reason=reason)


def _robust(off: _Array) -> float:
    looked = off[:: max(1, off.size // 100_000)]
    looked = looked[np.isfinite(looked)]
    return 1.4826 * float(np.median(np.abs(looked))) if looked.size else 0.0


def _alone(values: _Array, place: int, limit: float) -> bool:
    """Tell whether a sample, and at most two with it, stands out of a neighbourhood that is quiet."""
    around = values[max(0, place - _AROUND) : place + _AROUND + 1]
    around = around[np.isfinite(around)]
    away = np.abs(around - np.median(around))
    high = abs(float(values[place] - np.median(around)))
    return high > 0.7 * limit and int((away > high / 3.0).sum()) <= _WIDEST


def rounding(values: _Array, facts: Facts) -> float:
    """Return by which part white noise reads too large because readings are rounded to counts; 0 if they show none.

    Rounding adds a variance of q^2 / 12 to that of the noise before it.
    """
    lsb = facts.lsb or _step(values[np.isfinite(values)])
    steps = np.diff(values)
    steps = steps[np.isfinite(steps)]
    if lsb is None or not steps.size:
        return 0.0
    variance = float(np.square(steps).mean()) / 2.0 / lsb**2
    return 1.0 / math.sqrt(1.0 - 1.0 / (12.0 * variance)) - 1.0 if variance > 1.0 / 6.0 else 0.0


def _step(present: _Array) -> float | None:
    """Return the step of readings that are whole multiples of one, None if they show none."""
    levels = np.unique(present[:_MOST_LEVELS])
    if levels.size < 2 or levels.size > present[:_MOST_LEVELS].size / 2:
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

    Then the noise of the readings does not follow sqrt(s^2 + q^2 / 12) any more, may vanish, and averaging does not
    help. s is taken from differences of neighbours, so that drift does not count as noise.
    """
    lsb = facts.lsb or _step(values[np.isfinite(values)])
    if lsb is None:
        return Gate(name="resolved", channel=channel, ok=None, reason="what one count is worth is not known")
    steps = np.diff(values)
    steps = steps[np.isfinite(steps)]
    if not steps.size:
        return Gate(name="resolved", channel=channel, ok=None, reason="no two samples follow each other")
    scatter = math.sqrt(float(np.square(steps).mean()) / 2.0) / lsb
    least = math.sqrt(_RESOLVED**2 + 1.0 / 12.0)
    reason = f"neighbours scatter by {scatter:.2g} counts, and {least:.2g} are needed"
    if facts.lsb is None:
        reason += f"; one count is {lsb:.4g}, as the readings show"
    return Gate(name="resolved", channel=channel, ok=scatter >= least, reason=reason)
