"""Gates on a channel's readings: plausibility checks before anything is computed from them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
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
    "copies",
    "factor_of",
    "finite",
    "numbers",
    "present",
    "repeated",
    "stuck",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Gate:
    """Result of one plausibility check of a recording.

    Attributes:
        name: name of the check, such as `stuck`.
        channel: the channel checked, empty for the recording as a whole.
        ok: whether it passed; None if a missing fact prevents a judgement.
        reason: the finding, or the missing fact, in a sentence.
        cycles: numbers of the battery cycles that are suspect; empty if that is the recording as a
            whole.
        samples: numbers, counted from 1, of the first suspect samples.
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
    """Known properties of a sensor and its settings; None where unknown. Units are those of the channels.

    Attributes:
        rate: requested sampling rate [Hz].
        lsb: one count.
        full_scale: largest reading, of either sign.
        bandwidth: -3 dB bandwidth of the sensor's own filter [Hz].
        noise_density: one-sided noise density of the data sheet, per root Hz.
        temperature: name of the channel that holds degrees Celsius.
    """

    rate: float | None = None
    lsb: float | None = None
    full_scale: float | None = None
    bandwidth: float | None = None
    noise_density: float | None = None
    temperature: str | None = None


_Array: TypeAlias = NDArray[np.float64]

_ROUNDING = 1e-9  # of the value: a smaller change is rounding
_LONGER = 3.0  # allowed multiple of the longest run by chance
_SELDOM = 1e-6  # false-alarm probability of a stuck channel or of repeated rows, per good record
_FEWEST = 10  # equal samples that never count as stuck
_LOOKED_AT = 200_000  # samples that give step and scatter well enough
_MANY = 0.01  # share of repeated rows worth examining
_FEWEST_ROWS = 5  # repeated rows that never trip
_COUNTED = {2: "twice", 3: "three times"}
_GLANCE = 16  # samples that rule out a repeating record in nearly every case
_NAMED = 10  # samples listed by a gate
_SIBLINGS, _SCATTER = 3, 2.0  # channels, and the ratio of noises within which they count as alike


def finite(channel: str, values: _Array) -> Gate:
    """Trip where a value is NaN or infinite."""
    if np.isfinite(values).all():
        return Gate(name="finite", channel=channel, ok=True, reason=f"all {values.size} samples are numbers")
    bad = np.flatnonzero(~np.isfinite(values))
    reason = f"{bad.size} of {values.size} samples are not finite numbers, the first is number {bad[0] + 1}"
    return Gate(name="finite", channel=channel, ok=False, reason=reason, samples=numbers(bad))


def numbers(places: NDArray[np.intp]) -> tuple[int, ...]:
    """Return the sample numbers, counted from 1, of the first of these indices."""
    return tuple((places[:_NAMED] + 1).tolist())


def present(values: _Array) -> _Array:
    """Return the finite values, the array itself if all are."""
    here = np.isfinite(values)
    return values if here.all() else values[here]


def stuck(channel: str, values: _Array) -> Gate:
    """Trip where a channel never changes, or repeats a value for much longer than chance explains.

    In n samples of which a share p repeats the one before, the longest run of equal samples is about ln(n) / -ln(p); a
    run of three times that, of ten samples, or as long as one record in a million has is allowed. A signal that
    reverses or rests in the middle of a count repeats more often there: p is at least the share of its noise that stays
    within a count.
    """
    values = present(values)
    if values.size < 2:
        return Gate(name="stuck", channel=channel, ok=None, reason="fewer than two samples are numbers")
    low, high = float(values.min()), float(values.max())
    if high - low <= _ROUNDING * max(abs(low), abs(high)):
        return Gate(name="stuck", channel=channel, ok=False, reason=f"all samples are {values[0]:.6g}")
    again = np.flatnonzero(values[1:] == values[:-1])
    longest, place = _longest(again)
    runs = values.size - again.size
    others = max(1, values.size - longest)
    most = 1.0 - 0.5 / others
    share = min(max((others - runs + 1) / others, 0.5 / others), most)
    if longest > max(_FEWEST, _LONGER * _by_chance(values.size, share)):
        share = min(max(share, _within_a_count(values, slice(place, place + longest))), most)
    usual, rare = _by_chance(values.size, share), _by_chance(values.size / _SELDOM, share)
    if longest <= max(_FEWEST, _LONGER * usual, rare):
        return Gate(name="stuck", channel=channel, ok=True, reason=f"at most {longest} equal samples follow each other")
    reason = (
        f"{longest} equal samples follow each other from number {place + 1} on, where chance makes about {usual:.0f}"
    )
    return Gate(name="stuck", channel=channel, ok=False, reason=reason, samples=(place + 1, place + longest))


def _by_chance(samples: float, share: float) -> float:
    """Return the expected longest run of equal samples, given the share that repeats the one before."""
    return math.log(samples) / -math.log(share)


def _within_a_count(values: _Array, run: slice) -> float:
    """Return the share of samples that noise leaves within one count, for a signal in its middle.

    Noise is measured against the mean of neighbouring samples, outside the run of equal ones; rounding adds a twelfth
    of the squared count to its variance. The count is the least distance of neighbours.
    """
    steps = np.diff(values)
    moving = np.abs(steps[steps != 0.0])
    off = np.diff(steps)
    off = np.delete(off, slice(max(0, run.start - 2), run.stop))
    if not off.size:
        return 0.0
    count = float(moving.min())
    variance = float(np.square(off).mean()) / 6.0 - count**2 / 12.0
    return math.erf(count / math.sqrt(8.0 * variance)) if variance > 0.0 else 0.0


def _longest(again: NDArray[np.intp]) -> tuple[int, int]:
    """Return length and first index of the longest run, given the indices of samples repeated by the next."""
    if not again.size:
        return 1, 0
    breaks = np.flatnonzero(np.diff(again) != 1)
    edges = np.concatenate([[-1], breaks, [again.size - 1]])
    lengths = np.diff(edges)
    widest = int(lengths.argmax())
    return int(lengths[widest]) + 1, int(again[edges[widest] + 1])


def repeated(channels: Mapping[str, _Array]) -> Gate:
    """Trip where whole rows repeat the previous row: the sensor was read faster than it samples.

    It also trips where the whole log is duplicated or triplicated, which adds no information. Repetitions are allowed
    up to the number that one record in a million has by chance. The expected share is the product of the channels' own
    shares; for a single channel, 0.28 steps over the standard deviation of its noise.
    """
    name = "repeated"
    times = copies(channels.values())
    if times > 1:
        part = next(iter(channels.values())).size // times
        reason = f"the same {part} rows stand {_COUNTED[times]}, one after the other"
        return Gate(name=name, channel="", ok=False, reason=reason, samples=(part + 1,))
    equal = [values[1:] == values[:-1] for values in channels.values()]
    if not equal or not equal[0].size:
        return Gate(name=name, channel="", ok=None, reason="there are no two samples to compare")
    rows = np.logical_and.reduce(equal) if len(equal) > 1 else equal[0]
    share = float(rows.mean())
    if len(equal) > 1:
        expected = math.prod(float(each.mean()) for each in equal)
    else:
        expected = _expected(next(iter(channels.values())))
    counted = f"{share:.1%} of the rows repeat the one before, where chance makes {expected:.1%}"
    count, usual = int(rows.sum()), expected * rows.size
    ok = share <= max(_MANY, 3.0 * expected) or count < _FEWEST_ROWS or _explained(count, usual)
    return Gate(
        name=name, channel="", ok=ok, reason=counted, samples=() if ok else numbers(np.flatnonzero(rows)[:_NAMED] + 1)
    )


def _explained(count: int, usual: float) -> bool:
    """Return whether chance explains this many repetitions in more than one of a million records.

    H. Chernoff's bound on the tail of a Poisson distribution, P(k) <= exp(k - m - k ln(k / m)) for k above m.
    """
    return usual > 0.0 and count * math.log(count / usual) - (count - usual) < -math.log(_SELDOM)


def copies(columns: Iterable[_Array]) -> int:
    """Return how many copies of the same rows follow each other, 2 or 3; 1 if none, or if they never change."""
    arrays = list(columns)
    for times in (2, 3):
        part = arrays[0].size // times if arrays else 0
        if part < _FEWEST_ROWS or arrays[0].size % times:
            continue
        again = (_alike(each, part, _GLANCE) and _alike(each, part, each.size) for each in arrays)
        if all(again) and any(bool((each[:part] != each[0]).any()) for each in arrays):
            return times
    return 1


def _alike(values: _Array, part: int, most: int) -> bool:
    """Return whether up to `most` values equal those one part of the series earlier."""
    later = values[part : part + most]
    return np.array_equal(later, values[: later.size], equal_nan=True)


def _expected(values: _Array) -> float:
    """Return the share of samples that repeat the one before by chance, from the beginning of a long record."""
    steps = np.diff(values[:_LOOKED_AT])
    moving = np.abs(steps[(steps != 0.0) & np.isfinite(steps)])
    if not moving.size and values.size > _LOOKED_AT:
        return _expected(values[_LOOKED_AT - 1 :])
    if not moving.size:
        return 1.0
    return min(1.0, float(moving.min()) / (2.0 * math.sqrt(math.pi) * float(moving.std() or moving[0])))


def alike(channels: Mapping[str, float]) -> Gate:
    """Trip where the noise of one channel differs from its siblings' by the factor of a mixed-up unit.

    Args:
        channels: noise by channel name, in one unit.
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


_COLDEST, _HOTTEST = -60.0, 150.0  # degC: limits that an electronic part survives
_COARSE = 2.0  # K between neighbours, rms over sqrt(2): too much for a temperature
_ZERO = 273.15


def celsius(channel: str, values: NDArray[np.float64], *, series: bool = True) -> Gate:
    """Trip where a temperature cannot be in degrees Celsius: raw counts, or kelvin.

    Raw counts are whole numbers at temperatures that no part survives, or with a noise of kelvins between samples; the
    latter applies only to a time series, not to a table of setpoints.
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
"""Factors by which a density is wrong when two conventions or units are confused."""

LOWEST, HIGHEST = 0.5, 3.0  # of the data sheet's density: range explained by part tolerance and settings
_NEAR = 1.3  # factor within which a wrong density is reported as one of FACTORS
_ROOT = 1.05  # the same for the root of two, which part tolerance explains too


def factor_of(ratio: float) -> str:
    """Return the known factor nearest to a ratio, with the confusion that causes it; empty if there is none."""
    for factor, meaning in FACTORS.items():
        near = _ROOT if factor < HIGHEST else _NEAR
        for candidate, shown in ((factor, f"{factor:.4g}"), (1.0 / factor, f"1/{factor:.4g}")):
            if ratio > 0.0 and abs(math.log(ratio / candidate)) <= math.log(near):
                return f"near {shown}, as when {meaning} are mixed up"
    return ""
