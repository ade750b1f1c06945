"""Gates on what a channel reads: questions to its samples before anything is computed from them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "FACTORS",
    "HIGHEST",
    "LOWEST",
    "Facts",
    "Gate",
    "alike",
    "celsius",
    "factor_of",
    "finite",
    "numbers",
    "repeated",
    "resolved",
    "rounding",
    "saturated",
    "spikes",
    "stuck",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Gate:
    """One question to a recording that must be answered well before anything is concluded from it.

    Attributes:
        name: what is asked, such as `stuck`.
        channel: the channel that was asked, empty if it was the recording as a whole.
        ok: the answer; None if a fact is missing, so that nothing could be judged.
        reason: what was found, or which fact is missing, in a sentence.
        cycles: numbers of the battery's cycles that the answer speaks against; empty if that is the recording as a
            whole.
        samples: numbers, counted from 1, of the first samples that the answer speaks against.
    """

    name: str
    channel: str
    ok: bool | None
    reason: str
    cycles: tuple[int, ...] = ()
    samples: tuple[int, ...] = ()

    def __str__(self) -> str:
        return f"{self.name} of {self.channel}: {self.reason}" if self.channel else f"{self.name}: {self.reason}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """What is known of a sensor and its settings; None if it is not known. Units are those of the channels.

    Attributes:
        rate: samples per second that were asked for.
        lsb: step between two readings that differ by one count.
        full_scale: largest reading, of either sign.
        bandwidth: frequency at which the sensor's own filter is 3 dB down, in Hz.
        noise_density: of the data sheet, one-sided, per root of a hertz.
        temperature: name of the channel that holds degrees Celsius.
    """

    rate: float | None = None
    lsb: float | None = None
    full_scale: float | None = None
    bandwidth: float | None = None
    noise_density: float | None = None
    temperature: str | None = None


_Array: TypeAlias = NDArray[np.float64]

_ROUNDING = 1e-9  # of the value: a channel that moves less than this does not move
_LONGER = 3.0  # times the longest run that chance makes
_FEWEST = 10  # equal samples that are never called stuck
_MANY = 0.01  # share of repeated rows that is looked at
_FEWEST_ROWS = 5  # repeated rows that are never called so
_NEAR_FULL = 0.999  # of full scale
_NAMED = 10  # samples that a gate names
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
_SIBLINGS, _SCATTER = 3, 2.0  # channels, and the ratio of noises within which they are alike


def finite(channel: str, values: _Array) -> Gate:
    """Trip where a value is NaN or infinite."""
    bad = np.flatnonzero(~np.isfinite(values))
    if not bad.size:
        return Gate(name="finite", channel=channel, ok=True, reason=f"all {values.size} samples are numbers")
    reason = f"{bad.size} of {values.size} samples are not finite numbers, the first is number {bad[0] + 1}"
    return Gate(name="finite", channel=channel, ok=False, reason=reason, samples=numbers(bad))


def numbers(places: NDArray[np.intp]) -> tuple[int, ...]:
    """Return the numbers of the first samples at these places, counted from 1."""
    return tuple((places[:_NAMED] + 1).tolist())


def stuck(channel: str, values: _Array) -> Gate:
    """Trip where a channel never moves, or stands still for much longer than chance explains.

    In n samples of which a share p repeats the one before, the longest run of equal samples is about
    ln(n) / -ln(p); three times that, and ten samples, are allowed.
    """
    present = values[np.isfinite(values)]
    if present.size < 2:
        return Gate(name="stuck", channel=channel, ok=None, reason="fewer than two samples are numbers")
    span = float(np.ptp(present))
    if span <= _ROUNDING * float(np.abs(present).max()):
        return Gate(name="stuck", channel=channel, ok=False, reason=f"all samples are {present[0]:.6g}")
    ends = np.concatenate([[-1], np.flatnonzero(np.diff(present)), [present.size - 1]])
    runs = np.diff(ends)
    longest, place = int(runs.max()), int(ends[int(runs.argmax())] + 1)
    others = max(1, present.size - longest)
    share = min(max((others - runs.size + 1) / others, 0.5 / others), 1.0 - 0.5 / others)
    usual = math.log(present.size) / -math.log(share)
    if longest <= max(_FEWEST, _LONGER * usual):
        return Gate(name="stuck", channel=channel, ok=True, reason=f"at most {longest} equal samples follow each other")
    reason = (
        f"{longest} equal samples follow each other from number {place + 1} on, where chance makes about {usual:.0f}"
    )
    return Gate(name="stuck", channel=channel, ok=False, reason=reason, samples=(place + 1, place + longest))


def repeated(channels: Mapping[str, _Array]) -> Gate:
    """Trip where whole rows repeat the row before: the sensor was read faster than it measures.

    A few repetitions are chance. With several channels they are expected in the product of the channels' own shares;
    with one, in 0.28 steps over the standard deviation of its noise.
    """
    name = "repeated"
    equal = [np.diff(values) == 0.0 for values in channels.values()]
    if not equal or not equal[0].size:
        return Gate(name=name, channel="", ok=None, reason="there are no two samples to compare")
    rows = np.logical_and.reduce(equal)
    share = float(rows.mean())
    if len(equal) > 1:
        expected = math.prod(float(each.mean()) for each in equal)
    else:
        expected = _expected(np.diff(next(iter(channels.values()))))
    counted = f"{share:.1%} of the rows repeat the one before, where chance makes {expected:.1%}"
    ok = share <= max(_MANY, 3.0 * expected) or int(rows.sum()) < _FEWEST_ROWS
    return Gate(
        name=name, channel="", ok=ok, reason=counted, samples=() if ok else numbers(np.flatnonzero(rows)[:_NAMED] + 1)
    )


def _expected(steps: _Array) -> float:
    moving = np.abs(steps[(steps != 0.0) & np.isfinite(steps)])
    if not moving.size:
        return 1.0
    return min(1.0, float(moving.min()) / (2.0 * math.sqrt(math.pi) * float(moving.std() or moving[0])))


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
            if tail.size > _FEWEST_ROWS + 10.0 * expected:
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


def alike(channels: Mapping[str, float]) -> Gate:
    """Trip where the noise of one channel is that of its siblings times a factor that a mixed-up unit makes.

    Args:
        channels: noise by name of the channel, in one unit.
    """
    known = {name: noise for name, noise in channels.items() if math.isfinite(noise) and noise > 0.0}
    if len(known) < _SIBLINGS:
        return Gate(
            name="alike", channel="", ok=None, reason="it takes three channels to see that one has another unit"
        )
    for name, noise in known.items():
        others = [each for other, each in known.items() if other != name]
        ratio = noise / math.exp(sum(map(math.log, others)) / len(others))
        factor = factor_of(ratio) if max(others) <= _SCATTER * min(others) else ""
        if factor and not 1.0 / HIGHEST < ratio < HIGHEST:
            reason = f"its noise is {ratio:.3g} times that of the others, {factor}"
            return Gate(name="alike", channel=name, ok=False, reason=reason)
    return Gate(name="alike", channel="", ok=True, reason="no channel looks as if it were in another unit")


_SAME, _MOST_LEVELS = 1e-2, 20_000


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


_COLDEST, _HOTTEST = -60.0, 150.0  # degC that an electronic part survives
_COARSE = 2.0  # K between neighbours, rms over sqrt(2): no temperature jumps like this
_ZERO = 273.15


def celsius(channel: str, values: NDArray[np.float64], *, series: bool = True) -> Gate:
    """Trip where a temperature cannot be in degrees Celsius: raw counts, or kelvin.

    Raw counts are whole numbers that lie where no part survives, or whose noise would be kelvins from sample to sample;
    the latter only if the values are a series, and not a table of set temperatures.
    """
    present = values[np.isfinite(values)]
    if not present.size:
        return Gate(name="celsius", channel=channel, ok=None, reason="no sample is a number")
    low, high, middle = float(present.min()), float(present.max()), float(np.median(present))
    whole = bool((present == np.rint(present)).all())
    jumps = float(np.sqrt(np.square(np.diff(present)).mean() / 2.0)) if present.size > 1 else 0.0
    reason = f"from {low:g} to {high:g}"
    if low >= _COLDEST and high <= _HOTTEST and not (series and whole and jumps > _COARSE):
        return Gate(name="celsius", channel=channel, ok=True, reason=f"{reason} degC")
    if not (series and whole) and _COLDEST <= middle - _ZERO <= _HOTTEST:
        reason += ", as of kelvin"
    elif whole:
        reason += f" in whole numbers, {jumps:.2g} from sample to sample: raw counts"
    return Gate(name="celsius", channel=channel, ok=False, reason=f"{reason}; not degrees Celsius")


FACTORS = {
    180.0 / math.pi: "degrees and radians",
    9.80665: "g and m/s^2",
    1000.0: "milli, and none",
    math.sqrt(2.0): "one-sided and two-sided densities",
}
"""Factors by which a density is off when two things were taken for each other."""

LOWEST, HIGHEST = 0.5, 3.0  # of the data sheet's density: what scatter of parts and settings explains
_NEAR = 1.3  # factor within which a wrong density is reported as one of FACTORS
_ROOT = 1.05  # the same for the root of two, which the scatter of parts explains as well
_RESOLVED = 0.5  # counts: with less noise than this the step is no longer white noise of q^2 / 12


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


def factor_of(ratio: float) -> str:
    """Return the known factor that a ratio is near to, with what was mixed up; empty if there is none."""
    for factor, meaning in FACTORS.items():
        near = _ROOT if factor < HIGHEST else _NEAR
        for candidate, shown in ((factor, f"{factor:.4g}"), (1.0 / factor, f"1/{factor:.4g}")):
            if ratio > 0.0 and abs(math.log(ratio / candidate)) <= math.log(near):
                return f"near {shown}, as when {meaning} are mixed up"
    return ""
