"""Allan-family deviations of rate data, each point with the confidence interval of its noise type.

Formulas and notation: W. J. Riley, "Handbook of Frequency Stability Analysis", NIST Special Publication 1065, 2008
(SP1065). The variances at one averaging factor take the phase, the running sum of the rate in samples:
phase[k] = y[0] + ... + y[k-1], shape (n + 1,); they are in the square of the rate's unit, and are computed in
cache-sized blocks.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.allan import confidence as trust
from hil.analysis.allan import strided
from hil.analysis.allan.results import AllanCurve
from hil.analysis.tracing import traced
from hil.model.errors import Refused

__all__ = [
    "ESTIMATORS",
    "MOST_MISSING",
    "Estimator",
    "Taus",
    "deviation",
    "hadamard",
    "modified",
    "nonoverlapping",
    "overlapping",
    "overlapping_with_holes",
    "total",
]

_Array: TypeAlias = NDArray[np.float64]

MOST_MISSING = 0.05
"""Largest share of missing samples in an average; it raises the deviation of white noise by 2.6 % at most."""

_BLOCK = 1 << 15


def overlapping(phase: _Array, m: int) -> tuple[float, int]:
    """Return the overlapping Allan variance and its number of terms, SP1065 equation 11."""
    terms = phase.size - 2 * m
    squares = [_power(_second(phase, m, first, last)) for first, last in _blocks(0, terms)]
    return math.fsum(squares) / (2.0 * m * m * terms), terms


def nonoverlapping(phase: _Array, m: int) -> tuple[float, int]:
    """Return the Allan variance of non-overlapping averages and its number of terms, SP1065 equation 9."""
    picked = phase[::m]
    squares = [_power(_second(picked, 1, first, last)) for first, last in _blocks(0, picked.size - 2)]
    return math.fsum(squares) / (2.0 * m * m * (picked.size - 2)), picked.size - 2


def overlapping_with_holes(phase: _Array, m: int, holes: NDArray[np.int64]) -> tuple[float, int]:
    """Return the overlapping Allan variance of a record with missing samples, and its number of terms.

    An average is taken over its present samples. Terms with an average that lacks more than MOST_MISSING of its samples
    are left out; no phase is carried across them, because the rate within a hole is unknown. Without any term the
    variance is NaN.

    Args:
        phase: the running sum, with missing samples as zero, shape (n + 1,).
        m: averaging factor in samples.
        holes: indices of the missing samples, ascending.
    """
    squares, terms = [0.0], 0
    for first, last in _blocks(0, phase.size - 2 * m):
        edges = [_missing_before(holes, first + shift, last + shift) for shift in (0, m, 2 * m)]
        missing = [edges[1] - edges[0], edges[2] - edges[1]]
        kept = np.flatnonzero(np.maximum(*missing) <= MOST_MISSING * m)
        at = [phase[first + shift : last + shift][kept] for shift in (0, m, 2 * m)]
        earlier, later = ((at[k + 1] - at[k]) / (m - missing[k][kept]) for k in (0, 1))
        squares.append(_power(later - earlier))
        terms += kept.size
    return (math.fsum(squares) / (2.0 * terms) if terms else math.nan), terms


def modified(phase: _Array, m: int) -> tuple[float, int]:
    """Return the modified Allan variance and its number of terms, SP1065 equation 14.

    The inner sum over m second differences shifts by one term per start: it is carried as a running sum of third
    differences, which keeps the precision that a double running sum of the phase would lose in long records.
    """
    terms = phase.size - 3 * m
    inner = math.fsum(float(_second(phase, m, first, last).sum()) for first, last in _blocks(0, m))
    squares = [inner * inner]
    for first, last in _blocks(0, terms):
        steps = _third(phase, m, first, last)
        np.cumsum(steps, out=steps)
        steps += inner
        squares.append(_power(steps))
        inner = float(steps[-1])
    return math.fsum(squares) / (2.0 * float(m) ** 4 * (terms + 1)), terms + 1


def hadamard(phase: _Array, m: int) -> tuple[float, int]:
    """Return the overlapping Hadamard variance and its number of terms, SP1065 equation 18."""
    terms = phase.size - 3 * m
    squares = [_power(_third(phase, m, first, last)) for first, last in _blocks(0, terms)]
    return math.fsum(squares) / (6.0 * m * m * terms), terms


def total(phase: _Array, m: int) -> tuple[float, int]:
    """Return the total variance and its number of terms, SP1065 equation 25.

    The phase is extended beyond both ends by reflection about its end points; the extension is never stored. Red noise
    biases it low, see `confidence.total_bias`.
    """
    last = phase.size - 1
    squares = []
    for first, end in _blocks(1, last):
        difference = _reflected(phase, first - m, end - m)
        difference += _reflected(phase, first + m, end + m)
        difference -= 2.0 * phase[first:end]
        squares.append(_power(difference))
    return math.fsum(squares) / (2.0 * m * m * (last - 1)), last - 1


def _blocks(first: int, end: int) -> Iterator[tuple[int, int]]:
    for begin in range(first, end, _BLOCK):
        yield begin, min(begin + _BLOCK, end)


def _missing_before(holes: NDArray[np.int64], first: int, last: int) -> NDArray[np.int64]:
    """Count the holes before each index from `first` up to, not including, `last`."""
    before, end = np.searchsorted(holes, (first, last - 1))
    return np.asarray(before + np.cumsum(np.bincount(holes[before:end] - first + 1, minlength=last - first)))


def _power(values: _Array) -> float:
    return float(np.einsum("i,i->", values, values))  # not BLAS: independent of the number of cores


def _second(phase: _Array, m: int, first: int, last: int) -> _Array:
    if 8 * m <= _BLOCK:  # saves one pass over the block at the cost of m more differences
        steps = np.subtract(phase[first + m : last + 2 * m], phase[first : last + m])
        return np.subtract(steps[m:], steps[:-m])
    difference = np.subtract(phase[first + 2 * m : last + 2 * m], phase[first + m : last + m])
    difference -= phase[first + m : last + m]
    difference += phase[first:last]
    return difference


def _third(phase: _Array, m: int, first: int, last: int) -> _Array:
    middle = np.subtract(phase[first + 2 * m : last + 2 * m], phase[first + m : last + m])
    middle *= 3.0
    difference = np.subtract(phase[first + 3 * m : last + 3 * m], phase[first:last])
    difference -= middle
    return difference


def _reflected(phase: _Array, first: int, end: int) -> _Array:
    """Return a part of the extended phase as a new array; indices below 0 and beyond the last are reflections."""
    last = phase.size - 1
    below = max(0, min(end, 0) - first)
    beyond = max(0, end - max(first, last + 1))
    result = np.empty(end - first)
    result[:below] = 2.0 * phase[0] - phase[-first - below + 1 : -first + 1][::-1]
    result[below : result.size - beyond] = phase[max(first, 0) : max(0, min(end, last + 1))]
    mirror = 2 * last - end + 1
    result[result.size - beyond :] = 2.0 * phase[last] - phase[mirror : mirror + beyond][::-1]
    return result


_Places: TypeAlias = NDArray[np.int64]

Estimator: TypeAlias = Literal["overlapping", "nonoverlapping", "modified", "time", "hadamard", "total"]
Taus: TypeAlias = Literal["octave", "dense"] | Sequence[float] | _Array

ESTIMATORS: tuple[Estimator, ...] = ("overlapping", "nonoverlapping", "modified", "time", "hadamard", "total")
"""The estimators: overlapping and non-overlapping Allan deviation, modified Allan, time, overlapping Hadamard and total
deviation."""

_BEYOND_CHANCE = 300  # number of averages at which the bound between two types is 3 standard deviations of r1 away
_DENSE = 20  # averaging times per decade: neighbours correlate by more than 0.95, so more would add nothing
_SPANS = {"overlapping": 2, "nonoverlapping": 2, "modified": 3, "time": 3, "hadamard": 3, "total": 2}
"""Number of averages in one term."""


@traced
def deviation(
    data: ArrayLike,
    rate: float,
    taus: Taus = "octave",
    *,
    estimator: Estimator = "overlapping",
    unit: str = "1",
    confidence: float = 0.68,
    holes: bool = False,
    exact: bool = False,
) -> AllanCurve:
    """Return an Allan-family deviation of rate data over averaging time.

    Models: SP1065 equations 11 (overlapping), 9 (nonoverlapping), 14 (modified), 18 (hadamard) and 25 (total), with the
    running sum of the mean-free rate as phase (removing the mean affects only rounding); time is tau / sqrt(3) times
    modified, in `unit` times s. Intervals are chi-square with the equivalent degrees of freedom of the noise type
    identified at each averaging time; where fewer than 30 averages are left, or a bluer type could be chance, the type
    at the nearest shorter time is used. Total deviations are corrected for their known bias under flicker and random
    walk. Memory: one copy of the data.

    Octaves of the overlapping deviation of 2^21 samples or more, none missing, are computed in one pass with memory for
    a sixteenth of the data: exactly up to m = 16, and beyond from the differences that begin at every m/16-th sample.
    The omitted differences are redundant: the variance of the result grows by less than 2 %.

    Args:
        data: evenly spaced rate, shape (n,), in `unit`.
        rate: sampling rate [Hz].
        taus: averaging times in s, each rounded to a whole number of samples; "octave" for 1, 2, 4... samples,
            or "dense" for 20 per decade, both up to a quarter of the record.
        estimator: one of ESTIMATORS.
        unit: unit of the data.
        confidence: confidence level of the intervals, between 0 and 1.
        holes: whether NaN marks a missing sample (overlapping only). Averages are then taken over the present
            samples; differences with an average that lacks more than 5 %, and averaging times without any difference,
            are left out.
        exact: whether to take every difference however long the record, for comparison with other programs.

    Raises:
        Refused: the data are not a finite series of at least two samples, or an averaging time does not fit.
    """
    if not 0.0 < confidence < 1.0:
        raise Refused(f"a confidence of {confidence:g} is not possible", "give a number between 0 and 1, such as 0.68")
    if estimator not in ESTIMATORS:
        raise Refused(f"there is no estimator '{estimator}'", f"choose one of {', '.join(ESTIMATORS)}")
    values, mean, missing = _checked(data, rate, holes=holes)
    samples = values.size
    factors = _factors(samples, rate, taus, _SPANS[estimator])
    octaves = estimator == "overlapping" and isinstance(taus, str) and taus == "octave"
    thinned = octaves and samples >= strided.LONG and not (missing.size or exact)
    averages: Iterable[_Array]
    if thinned:
        variance, averages = strided.octaves(values, mean, factors.size)
        terms = samples + 1 - 2 * factors
    else:
        factors, variance, terms, averages = _differenced(_phase(values, mean, missing), factors, estimator, missing)
    alpha = _noise_types(factors, averages, trust.REDDEST[estimator])
    points = zip(alpha.tolist(), factors.tolist(), terms.tolist(), strict=True)
    degrees = np.array([trust.degrees(estimator, *point, samples) for point in points])
    if estimator == "total":
        variance /= trust.total_bias(alpha, factors, samples)
    if estimator == "time":
        variance, unit = variance * np.square(factors / rate) / 3.0, f"{unit}*s"
    low, high = trust.interval(variance, degrees, confidence)
    return AllanCurve(
        estimator=estimator,
        unit=unit,
        rate=float(rate),
        samples=samples,
        missing=int(missing.size),
        confidence=confidence,
        tau=factors / rate,
        deviation=np.sqrt(variance),
        m=factors,
        terms=terms,
        edf=degrees,
        low=np.sqrt(low),
        high=np.sqrt(high),
        alpha=alpha,
        starts=strided.STARTS if thinned else 0,
    )


def _differenced(
    phase: _Array, factors: _Places, estimator: Estimator, missing: _Places
) -> tuple[_Places, _Array, _Places, Iterable[_Array]]:
    """Return the result of `_estimated`, and consecutive averages at each factor."""
    factors, variance, terms = _estimated(phase, factors, estimator, missing)
    return factors, variance, terms, (_averages(phase, m, missing) for m in factors.tolist())


def _estimated(
    phase: _Array, factors: _Places, estimator: Estimator, missing: _Places
) -> tuple[_Places, _Array, _Places]:
    """Return the factors with at least one usable difference, their variances and numbers of terms."""
    if missing.size and estimator != "overlapping":
        raise Refused(
            f"the {estimator} deviation needs a record without holes, and {missing.size} samples are missing",
            "choose the overlapping one, or a part without holes",
        )
    found = [_variance(phase, m, estimator, missing) for m in factors.tolist()]
    kept = [place for place, (_, terms) in enumerate(found) if terms]
    if not kept:
        raise Refused("no averaging time has two neighbouring averages without holes", "record without gaps")
    variance = np.array([found[place][0] for place in kept])
    return factors[kept], variance, np.array([found[place][1] for place in kept], dtype=np.int64)


def _checked(data: ArrayLike, rate: float, *, holes: bool) -> tuple[_Array, float, _Places]:
    """Return the samples, their mean, and the indices of missing ones."""
    values = np.asarray(data, dtype=np.float64)
    if not (math.isfinite(rate) and rate > 0.0):
        raise Refused(f"a rate of {rate:g} Hz is not possible", "give the samples per second")
    if values.ndim != 1 or values.size < 2:
        raise Refused(f"data of shape {values.shape} hold no Allan deviation", "give one series of two samples or more")
    mean = float(values.mean())
    missing = np.empty(0, dtype=np.int64)
    if holes and math.isnan(mean):
        missing = np.flatnonzero(np.isnan(values))
        mean = float(np.sum(values, where=~np.isnan(values))) / max(1, values.size - missing.size)
    if not math.isfinite(mean):
        raise _not_finite(values, missing)
    if missing.size == values.size:
        raise Refused(f"all {values.size} samples are missing", "check which channel was recorded")
    few = values if missing.size else values[:: 1 + values.size // 1000]  # most records vary within these
    if np.nanmin(few) == np.nanmax(few) and np.nanmin(values) == np.nanmax(values):
        mean = float(values[np.isfinite(values)][0])  # rounding of a computed mean would look like noise
    return values, mean, missing


def _phase(values: _Array, mean: float, missing: _Places) -> _Array:
    phase = np.empty(values.size + 1)
    phase[0] = 0.0
    np.subtract(values, mean, out=phase[1:])
    phase[1:][missing] = 0.0
    np.cumsum(phase[1:], out=phase[1:])
    return phase


def _not_finite(values: _Array, missing: _Places) -> Refused:
    bad = np.setdiff1d(np.flatnonzero(~np.isfinite(values)), missing)
    first = f", the first is number {bad[0] + 1}" if bad.size else "; their sum is too large"
    return Refused(
        f"{bad.size} of {values.size} samples are not finite numbers{first}",
        "cut the record to a part without holes, or find out why they are there",
    )


def _factors(samples: int, rate: float, taus: Taus, span: int) -> _Places:
    if isinstance(taus, str):
        longest = max(samples // 4, 1)
        if taus == "octave":
            return np.asarray(1 << np.arange(int(math.log2(longest)) + 1), dtype=np.int64)
        steps = np.arange(math.floor(_DENSE * math.log10(longest)) + 1)
        return np.unique(np.rint(10.0 ** (steps / _DENSE))).astype(np.int64)
    wanted = np.atleast_1d(np.asarray(taus, dtype=np.float64))
    factors = np.unique(np.rint(wanted * rate)) if np.isfinite(wanted).all() else np.zeros(1)
    if not factors.size or factors[0] < 1 or factors[-1] > samples // span:
        part = {2: "half", 3: "a third"}[span]
        raise Refused(
            f"averaging times must lie between {1 / rate:g} s and {samples // span / rate:g} s, {part} of the record",
            "leave the others out",
        )
    return factors.astype(np.int64)


def _variance(phase: _Array, m: int, estimator: Estimator, missing: _Places) -> tuple[float, int]:
    if missing.size:
        return overlapping_with_holes(phase, m, missing)
    kernels = {
        "overlapping": overlapping,
        "nonoverlapping": nonoverlapping,
        "modified": modified,
        "time": modified,
        "hadamard": hadamard,
        "total": total,
    }
    return kernels[estimator](phase, m)


def _noise_types(factors: _Places, averages: Iterable[_Array], reddest: int) -> _Places:
    """Identify the noise type at each averaging factor from its averages, given that at the next shorter one.

    In a sum of noises the redder one dominates as tau grows, so a bluer type is accepted only if chance is ruled out.
    """
    alpha = np.zeros(factors.size, dtype=np.int64)
    shorter = 0
    for place, (m, each) in enumerate(zip(factors.tolist(), averages, strict=True)):
        known = trust.identify(each, reddest, averaged=m > 1)
        if known is not None and not (known > shorter and each.size < _BEYOND_CHANCE):
            shorter = known
        alpha[place] = shorter
    return alpha


def _averages(phase: _Array, m: int, missing: _Places) -> _Array:
    """Return consecutive averages up to a constant factor; those with too many missing samples are left out."""
    edges = np.arange(0, min(phase.size, m * trust.MOST_AVERAGES + 1), m)
    sums = np.diff(phase[edges])
    if not missing.size:
        return sums
    lost = np.diff(np.searchsorted(missing, edges))
    kept = lost <= MOST_MISSING * m
    return np.asarray(sums[kept] / (m - lost[kept]), dtype=np.float64)
