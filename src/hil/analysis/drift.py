"""Drift of a sensor over temperature and time: slope, offset and hysteresis, with realistic uncertainties.

A record of minutes has thousands of samples but few independent ones: flicker, random walk and the temperature are all
slow. So samples are averaged into bins of equal time, a line is fitted to the averages by least squares, and the noise
of the averages is estimated as a sum of white noise, flicker and random walk by restricted maximum likelihood. The
uncertainty of a coefficient follows from this sum, with Satterthwaite's degrees of freedom: a record that shows little
of the slow noise gives wide intervals. Curvature and hysteresis, which a line cannot follow, count as slow noise.

A slope over temperature includes everything that changed together with the temperature. On a single ramp, drift over
time and over temperature cannot be separated; heating followed by cooling separates them.

Sources: D. A. Harville, Maximum likelihood approaches to variance component estimation, JASA 72 (1977); F. G.
Giesbrecht and J. C. Burns, Biometrics 41 (1985), for the degrees of freedom; N. J. Kasdin, Proc. IEEE 83 (1995), for
the covariance of flicker.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.comparison import relative_deviation
from hil.analysis.gates import celsius, finite, stuck
from hil.analysis.statistics import not_observable
from hil.analysis.tracing import traced
from hil.model.errors import Refused
from hil.model.figure import Figure

__all__ = ["Drift", "drift_of", "fragments"]

_Array: TypeAlias = NDArray[np.float64]

_BINS, _FEWEST, _SAMPLES = 60, 8, 4  # bins per record, the fewest usable bins, fewest samples per bin
_RANGE_K = 5.0
_BEYOND_K = 2.0  # extrapolation beyond the record's temperatures up to which an offset is stated
_CELLS, _FEWEST_CELLS = 8, 3  # temperature cells in which heating and cooling are compared
_MOVING = 0.01  # of the fastest change: a slower change is neither heating nor cooling
_ROUNDS, _SETTLED, _SHARE = 60, 1e-2, 0.05  # of the noise estimate; a smaller share costs no degree of freedom
_HOUR = 3600.0
_STANDS, _SHORTEST, _LONGEST = 20, 20, 1 / 3  # typical runs, samples, part of a record: longer is frozen


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """Drift of one axis; figures that the record does not determine are NOT_OBSERVABLE.

    Attributes:
        slope: change over temperature [unit/K], of the line through heating and cooling.
        offset: value of that line at the reference temperature [unit].
        hysteresis: mean difference of heating minus cooling at equal temperature, over their common range [unit].
        per_hour: change over time, whatever its cause [unit/h].
        warming: change of temperature over time [K/h].
        reasons: why a figure is not observable, by its name, a sentence without its full stop.
        time, temperature, value: means of the bins [s, degC, unit], shape (k,).
        heating: direction of each bin: 1 heating, -1 cooling, 0 neither; shape (k,).
    """

    slope: Figure
    offset: Figure
    hysteresis: Figure
    per_hour: Figure
    warming: Figure
    reasons: Mapping[str, str]
    time: _Array
    temperature: _Array
    value: _Array
    heating: NDArray[np.int8]

    def line(self, temperature: ArrayLike) -> _Array:
        """Return the fitted line at temperatures in degC, of their shape; it passes through the mean of the bins."""
        warmer = np.asarray(temperature, dtype=np.float64) - self.temperature.mean()
        return np.asarray(self.value.mean() + self.slope.value * warmer)

    def why(self, name: str) -> list[str]:
        """Return why this figure is not observable, for a check's `doubts`; empty if it is."""
        return [f"{name} is not observable: {self.reasons[name]}"] if name in self.reasons else []

    def probability(self, name: str) -> float:
        """Return the p-value of this figure under the hypothesis that it is zero (Student's t)."""
        figure: Figure = getattr(self, name)
        return relative_deviation(figure, Figure(value=0.0, unit=figure.unit, uncertainty=0.0)).probability


@dataclass(frozen=True, slots=True)
class _Binned:
    """Means of bins with their numbers, without empty bins."""

    number: NDArray[np.intp]
    time: _Array
    temperature: _Array
    value: _Array
    heating: NDArray[np.int8] = field(default_factory=lambda: np.zeros(0, np.int8))


@traced
def drift_of(
    time: ArrayLike,
    temperature: ArrayLike,
    values: ArrayLike,
    unit: str,
    *,
    reference: float = 25.0,
    least_range: float = _RANGE_K,
) -> Drift:
    """Return drift, offset and hysteresis of one axis.

    A channel that is stuck or has no finite values gives no figures; a temperature that cannot be in degrees Celsius
    (raw counts, kelvin), or that changed too little, gives none per kelvin, but still the drift over time.

    Args:
        time: sample times in s, ascending, shape (n,).
        temperature: temperature of the sensor in degC, shape (n,).
        values: readings of the axis in `unit`, shape (n,).
        unit: unit of the values.
        reference: reference temperature of the offset [degC].
        least_range: least temperature range for a slope [K].

    Raises:
        Refused: arrays of different shapes.
    """
    seconds, degrees, given = (np.asarray(each, dtype=np.float64) for each in (time, temperature, values))
    if not seconds.shape == degrees.shape == given.shape or seconds.ndim != 1:
        raise Refused("time, temperature and values have different shapes", "give one of each per sample")
    binned = _binned(seconds, degrees, given)
    told = _reason_at_all(seconds, given, binned)
    if told:
        return _nothing(unit, dict.fromkeys(("slope", "offset", "hysteresis", "per_hour", "warming"), told), binned)
    found = _nothing(unit, {}, binned)
    hours = (binned.time - binned.time.mean()) / _HOUR
    per_hour = _line(hours, binned.number, binned.value).figure(f"{unit}/h", (0.0, 1.0))
    told = _reason_of_temperature(degrees, binned, least_range)
    if told:
        warming = not_observable("K/h")
        reasons = dict.fromkeys(("slope", "offset", "hysteresis"), told)
        if not np.isfinite(binned.temperature).all() or not celsius("temperature", degrees).ok:
            reasons["warming"] = told
        else:
            warming = _line(hours, binned.number, binned.temperature).figure("K/h", (0.0, 1.0))
        return replace(found, per_hour=per_hour, warming=warming, reasons=reasons)
    line = _line(binned.temperature - reference, binned.number, binned.value)
    hysteresis, reasons = _hysteresis(binned, unit, least_range)
    offset = line.figure(unit, (1.0, 0.0))
    low, high = float(binned.temperature.min()), float(binned.temperature.max())
    if not low - _BEYOND_K <= reference <= high + _BEYOND_K:
        reasons["offset"] = f"{reference:g} degC is not within the {low:.1f} to {high:.1f} degC of the record"
        offset = not_observable(unit, offset.value)
    return replace(
        found,
        slope=line.figure(f"{unit}/K", (0.0, 1.0)),
        offset=offset,
        hysteresis=hysteresis,
        per_hour=per_hour,
        warming=_line(hours, binned.number, binned.temperature).figure("K/h", (0.0, 1.0)),
        reasons=reasons,
    )


@traced
def fragments(time: ArrayLike, rate: float, *, longest_gap: float | None = None) -> list[slice]:
    """Return the contiguous parts of a record: several for an interrupted log.

    Args:
        time: sample times in s, shape (n,).
        rate: nominal sampling rate [Hz].
        longest_gap: gap beyond which a new part begins [s]; five sampling periods if None.
    """
    seconds = np.asarray(time, dtype=np.float64)
    if not seconds.size:
        return []
    longest = 5.0 / rate if longest_gap is None else longest_gap
    steps = np.diff(seconds)
    breaks = np.flatnonzero((steps > longest) | (steps <= 0.0)) + 1
    edges = [0, *breaks.tolist(), seconds.size]
    return [slice(begin, end) for begin, end in pairwise(edges)]


def _binned(time: _Array, temperature: _Array, values: _Array) -> _Binned:
    """Return means over bins of equal time, of their finite samples."""
    count = min(_BINS, time.size // _SAMPLES)
    if count < _FEWEST or not time[-1] > time[0]:
        nothing = np.zeros(0)
        return _Binned(np.zeros(0, np.intp), nothing, nothing, nothing)
    place = np.minimum(((time - time[0]) / (time[-1] - time[0]) * count).astype(np.intp), count - 1)
    samples = np.bincount(place, minlength=count)
    filled = np.flatnonzero(samples * 2 > samples.max())
    means = [np.bincount(place, each, count)[filled] / samples[filled] for each in (time, temperature, values)]
    return _Binned(filled, means[0], means[1], means[2], _heating(means[0], means[1]))


def _heating(time: _Array, temperature: _Array) -> NDArray[np.int8]:
    """Return the direction of each bin; the bins before and after a reversal have none."""
    rates = np.diff(temperature) / np.diff(time)
    fastest = float(np.abs(rates).max(initial=0.0))
    signs = np.where(np.abs(rates) >= _MOVING * fastest, np.sign(rates), 0.0) if fastest > 0.0 else 0.0 * rates
    before, after = np.concatenate([signs[:1], signs]), np.concatenate([signs, signs[-1:]])
    return np.where(before == after, before, 0.0).astype(np.int8)


def _reason_at_all(time: _Array, values: _Array, binned: _Binned) -> str:
    """Return why no figure can be determined, empty if some can."""
    for gate in (finite("values", values), stuck("values", values)):
        if gate.ok is False:
            return f"{gate.name}: {gate.reason}"
    if binned.number.size < _FEWEST:
        long = time[-1] - time[0] if time.size else 0.0
        return f"{time.size} samples in {long:.3g} s are too few: {_FEWEST} bins of {_SAMPLES} samples are needed"
    return ""


def _reason_of_temperature(temperature: _Array, binned: _Binned, least_range: float) -> str:
    """Return why no figure per kelvin can be determined, empty if it can."""
    for gate in (finite("temperature", temperature), celsius("temperature", temperature)):
        if gate.ok is False:
            return f"temperature {gate.reason}"
    changed = float(np.ptp(binned.temperature))
    if changed >= least_range and (told := _frozen(temperature)):
        return told
    return f"the temperature changed by {changed:.2g} K only, {least_range:g} K are needed" * (changed < least_range)


def _frozen(temperature: _Array) -> str:
    """Return that a thermometer is frozen, empty if it is not.

    A coarse one repeats each reading for a while, so the longest run is compared with the typical one.
    """
    edges = np.concatenate([[0], np.flatnonzero(np.diff(temperature)) + 1, [temperature.size]])
    runs = np.diff(edges)
    place, usual = int(runs.argmax()), float(np.median(runs))
    longest = int(runs[place])
    if longest <= max(_SHORTEST, min(_STANDS * usual, _LONGEST * temperature.size)):
        return ""
    stands = f"it reads {temperature[edges[place]]:.4g} degC for {longest} samples from sample {edges[place] + 1} on"
    return f"the temperature is frozen: {stands}; if it was so, leave that part out"


def _nothing(unit: str, reasons: Mapping[str, str], binned: _Binned) -> Drift:
    names = {"slope": f"{unit}/K", "offset": unit, "hysteresis": unit, "per_hour": f"{unit}/h", "warming": "K/h"}
    figures = {name: not_observable(each) for name, each in names.items()}
    return Drift(
        **figures,
        reasons=dict(reasons),
        time=binned.time,
        temperature=binned.temperature,
        value=binned.value,
        heating=binned.heating,
    )


def _hysteresis(binned: _Binned, unit: str, least_range: float) -> tuple[Figure, dict[str, str]]:
    """Return the mean of heating minus cooling over temperature cells that contain both.

    Residuals from the line are compared within each cell, so its bins need not be at equal temperature.
    """
    legs = [binned.temperature[binned.heating == sign] for sign in (1, -1)]
    if not all(leg.size for leg in legs):
        return not_observable(unit), {"hysteresis": f"the temperature only {('fell', 'rose')[bool(legs[0].size)]}"}
    low, high = max(leg.min() for leg in legs), min(leg.max() for leg in legs)
    if high - low < least_range:
        told = f"heating and cooling have {max(high - low, 0.0):.2g} K in common, {least_range:g} K are needed"
        return not_observable(unit), {"hysteresis": told}
    cell = np.floor((binned.temperature - low) / (high - low) * _CELLS).clip(-1, _CELLS)
    weights, both = np.zeros(binned.value.size), 0
    for number in range(_CELLS):
        sides = [(cell == number) & (binned.heating == sign) for sign in (1, -1)]
        if all(side.any() for side in sides):
            weights += sides[0] / sides[0].sum() - sides[1] / sides[1].sum()
            both += 1
    if both < _FEWEST_CELLS:
        return not_observable(unit), {"hysteresis": f"heating and cooling meet in {both} of {_CELLS} ranges only"}
    moving = binned.heating != 0
    sign, warmer = binned.heating[moving], binned.temperature[moving] - binned.temperature[moving].mean()
    straight = np.column_stack([np.ones_like(warmer), warmer])
    weights = weights[moving] / both
    weights -= np.linalg.pinv(straight).T @ (straight.T @ weights)
    loop = np.column_stack([straight, warmer**2, sign, sign * warmer])
    noise = _noise(loop, binned.number[moving], binned.value[moving])
    return noise.figure_of(weights, float(weights @ binned.value[moving]), unit), {}


@dataclass(frozen=True, slots=True)
class _Noise:
    """Variance components of the noise [unit^2], their covariance matrices and their precision.

    Attributes:
        levels: levels of white noise, flicker and random walk, shape (3,).
        parts: covariance matrices at unit level, shape (3, k, k).
        information: Fisher information of the levels, shape (3, 3).
        most: degrees of freedom of the residuals.
    """

    levels: _Array
    parts: _Array
    information: _Array
    most: int

    def figure_of(self, weights: _Array, value: float, unit: str) -> Figure:
        """Return a weighted sum of the bin means as a figure."""
        shares = (self.parts @ weights) @ weights
        variance = float(shares @ self.levels)
        present = self.levels > _SHARE * self.levels.sum()
        if not variance > 0.0:
            return Figure(value=value, unit=unit, uncertainty=0.0, dof=float(self.most))
        gradient = shares[present]
        spread = gradient @ np.linalg.pinv(self.information[np.ix_(present, present)]) @ gradient
        dof = 2.0 * variance**2 / spread if spread > 0.0 else float(self.most)
        dof = float(min(max(dof, 1.0), self.most))
        return Figure(value=value, unit=unit, uncertainty=math.sqrt(variance), dof=dof)


@dataclass(frozen=True, slots=True)
class _Line:
    """A line through the bin means: its estimator, coefficients and noise."""

    inverse: _Array
    value: _Array
    noise: _Noise

    def figure(self, unit: str, of: Sequence[float]) -> Figure:
        """Return a linear combination of intercept and slope as a figure."""
        weights = np.asarray(of) @ self.inverse
        return self.noise.figure_of(weights, float(weights @ self.value), unit)


def _line(argument: _Array, number: NDArray[np.intp], value: _Array) -> _Line:
    """Fit value = a + b * argument by least squares."""
    design = np.column_stack([np.ones_like(argument), argument])
    return _Line(np.linalg.pinv(design), value, _noise(design, number, value))


def _noise(design: _Array, number: NDArray[np.intp], value: _Array) -> _Noise:
    """Estimate the noise of the bin means from the residuals of a linear model, by restricted maximum likelihood.

    That is the likelihood of contrasts y, in which the model vanishes. With V their covariance and K the share of one
    noise, levels are multiplied by sqrt(y'V^-1 K V^-1 y / tr(V^-1 K)) until they converge, which keeps them positive
    and the likelihood increasing (H. Zhou et al., J. Comput. Graph. Stat. 28, 2019).
    """
    count, terms = design.shape
    parts = _parts(int(number[-1]) + 1)[:, number[:, np.newaxis], number]
    contrasts = np.linalg.qr(design, mode="complete")[0][:, terms:]
    left, seen = contrasts.T @ value, contrasts.T @ parts @ contrasts
    flat = seen.reshape(len(seen), -1)
    scale = float(left @ left) / (count - terms)
    levels = np.full(len(parts), max(scale, np.finfo(float).tiny) / len(parts))
    inverse = np.zeros(seen.shape[1:])
    for _ in range(_ROUNDS):
        inverse = np.linalg.inv((levels @ flat).reshape(inverse.shape))
        weighted = inverse @ left
        factor = np.sqrt((seen @ weighted) @ weighted / (flat @ inverse.ravel()))
        levels = levels * factor
        if bool(((np.abs(factor - 1.0) < _SETTLED) | (levels < _SETTLED * _SETTLED * levels.sum())).all()):
            break
    shown = inverse @ seen
    information = 0.5 * shown.reshape(len(shown), -1) @ shown.transpose(0, 2, 1).reshape(len(shown), -1).T
    return _Noise(levels * (scale > 0.0), parts, information, count - terms)


@lru_cache(maxsize=8)
def _parts(count: int) -> _Array:
    """Return covariances of the means of neighbouring bins, each of mean variance 1, shape (3, count, count).

    White noise; flicker, from Kasdin's coefficients of f^-1/2; random walk, whose means over unit bins have the
    covariance min(i, j) - 1/6 on the diagonal and min(i, j) off it. The last two have no absolute level: they are
    referred to their mean over the record.
    """
    steps = np.arange(count)
    response = np.cumprod(np.concatenate([[1.0], (steps[1:] - 0.5) / steps[1:]]))
    apart = steps[:, np.newaxis] - steps
    filtered = np.where(apart >= 0, response[np.abs(apart)], 0.0)
    walk = np.minimum.outer(steps, steps) + 1.0 - np.eye(count) / 6.0
    centred = np.eye(count) - 1.0 / count
    parts = np.array([np.eye(count), centred @ filtered @ filtered.T @ centred, centred @ walk @ centred])
    return np.asarray(parts * (count / np.trace(parts, axis1=1, axis2=2))[:, np.newaxis, np.newaxis])
