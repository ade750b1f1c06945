"""Gates on the samples of a channel, applied before anything is computed from them."""

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
    """One condition on a recording that must hold before anything is concluded from it.

    Attributes:
        name: name of the gate, such as `stuck`.
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
    """Facts about a sensor and its settings; None if unknown. Units are those of the channels.

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
_SELDOM = 1e-6  # records of a good sensor that stand still, or repeat rows, for longer
_FEWEST = 10  # equal samples that are never called stuck
_LOOKED_AT = 200_000  # samples that tell steps and scatter well enough
_MANY = 0.01  # share of repeated rows that is looked at
_FEWEST_ROWS = 5  # repeated rows that are never called so
_COUNTED = {2: "twice", 3: "three times"}
_GLANCE = 16  # samples by which nearly every record is told from one that repeats
_NAMED = 10  # samples that a gate names
_SIBLINGS, _SCATTER = 3, 2.0  # channels, and the ratio of noises within which they are alike


def finite(channel: str, values: _Array) -> Gate:
    """Trip where a value is NaN or infinite."""
    if np.isfinite(values).all():
        return Gate(name="finite", channel=channel, ok=True, reason=f"all {values.size} samples are numbers")
    bad = np.flatnonzero(~np.isfinite(values))
    reason = f"{bad.size} of {values.size} samples are not finite numbers, the first is number {bad[0] + 1}"
    return Gate(name="finite", channel=channel, ok=False, reason=reason, samples=numbers(bad))


def numbers(places: NDArray[np.intp]) -> tuple[int, ...]:
    """Return the numbers of the first samples at these places, counted from 1."""
    return tuple((places[:_NAMED] + 1).tolist())


def present(values: _Array) -> _Array:
    """Return the values that are numbers: the array itself where all are."""
    here = np.isfinite(values)
    return values if here.all() else values[here]


def stuck(channel: str, values: _Array) -> Gate:
    """Trip where a channel never changes, or holds a value for much longer than chance explains.

    In n samples of which a share p repeats the one before, the longest run of equal samples is about ln(n) / -ln(p);
    three times that, ten samples, and what one record in a million holds are allowed. A signal that turns around or
    rests in the middle of a count repeats more often there than elsewhere: p is at least the share of its noise that
    stays within a count.
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
    """Return the length of the longest run of equal samples among so many, of which a share repeats the one before."""
    return math.log(samples) / -math.log(share)


def _within_a_count(values: _Array, run: slice) -> float:
    """Return the share of samples that noise leaves in the count in whose middle the signal stands.

    The noise is that of samples against the mean of their neighbours, outside of a run of equal ones; rounding adds a
    twelfth of the squared count to its variance. The count is the least distance of neighbours.
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
    """Return the length and the first place of the longest run, given the places of samples that the next repeats."""
    if not again.size:
        return 1, 0
    breaks = np.flatnonzero(np.diff(again) != 1)
    edges = np.concatenate([[-1], breaks, [again.size - 1]])
    lengths = np.diff(edges)
    widest = int(lengths.argmax())
    return int(lengths[widest]) + 1, int(again[edges[widest] + 1])


def repeated(channels: Mapping[str, _Array]) -> Gate:
    """Trip where whole rows repeat the row before: the sensor was read faster than it measures.

    It also trips where all rows appear two or three times: a log appended to itself holds no more information.
    A few repetitions are chance: more of them than one record in a million holds are not. With several channels they
    are expected in the product of the channels' own shares; with one, in 0.28 steps over the standard deviation of its
    noise.
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
    """Tell whether chance makes so many repetitions in more than a millionth of records, where so many are usual.

    H. Chernoff's bound on the tail of a Poisson distribution, P(k) <= exp(k - m - k ln(k / m)) for k above m.
    """
    return usual > 0.0 and count * math.log(count / usual) - (count - usual) < -math.log(_SELDOM)


def copies(columns: Iterable[_Array]) -> int:
    """Return how many times the same rows appear in succession, 2 or 3; 1 where they do not, or never change."""
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
    """Tell whether so many values are those a part of the series before."""
    later = values[part : part + most]
    return np.array_equal(later, values[: later.size], equal_nan=True)


def _expected(values: _Array) -> float:
    """Return the share of samples that repeat the one before by chance, as the first of a long record show it."""
    steps = np.diff(values[:_LOOKED_AT])
    moving = np.abs(steps[(steps != 0.0) & np.isfinite(steps)])
    if not moving.size and values.size > _LOOKED_AT:
        return _expected(values[_LOOKED_AT - 1 :])
    if not moving.size:
        return 1.0
    return min(1.0, float(moving.min()) / (2.0 * math.sqrt(math.pi) * float(moving.std() or moving[0])))


def alike(channels: Mapping[str, float]) -> Gate:
    """Trip where the noise of one channel is that of its siblings times the factor of a mixed-up unit.

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


_COLDEST, _HOTTEST = -60.0, 150.0  # degC that an electronic part survives
_COARSE = 2.0  # K between neighbours, rms over sqrt(2): no temperature jumps like this
_ZERO = 273.15


def celsius(channel: str, values: NDArray[np.float64], *, series: bool = True) -> Gate:
    """Trip where a temperature cannot be in degrees Celsius: raw counts, or kelvin.

    Raw counts are whole numbers beyond any survivable temperature, or whose noise would be kelvins from sample to
    sample; the latter only if the values are a series, and not a table of set temperatures.
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


def factor_of(ratio: float) -> str:
    """Return the known factor that a ratio is near to, with what was mixed up; empty if there is none."""
    for factor, meaning in FACTORS.items():
        near = _ROOT if factor < HIGHEST else _NEAR
        for candidate, shown in ((factor, f"{factor:.4g}"), (1.0 / factor, f"1/{factor:.4g}")):
            if ratio > 0.0 and abs(math.log(ratio / candidate)) <= math.log(near):
                return f"near {shown}, as when {meaning} are mixed up"
    return ""
