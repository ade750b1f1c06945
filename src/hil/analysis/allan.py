"""Overlapping Allan deviation of rate data with honest intervals, and the noise coefficients read from it.

Formulas and notation: W. J. Riley, "Handbook of Frequency Stability Analysis", NIST Special Publication 1065, 2008
(SP1065); noise coefficients as in IEEE Std 952-1997, annex C.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis import allan_confidence, allan_fit
from hil.analysis.allan_results import AllanCurve, NoiseModel
from hil.model.errors import Refused
from hil.model.figure import Figure, FigureStatus

__all__ = ["characterise", "overlapping"]

_Array: TypeAlias = NDArray[np.float64]

_FEWEST_POINTS = 5  # one more than three terms and a degree of freedom for the misfit
_WORST_TAIL = 1e-3  # a right model is rejected once in a thousand records
_BEYOND_CHANCE = 300  # averages at which the bound between two types is 3 standard deviations of r1 away
_MODEL_ERROR = 0.03  # of the deviation: filters, quantisation and temperature bend real curves by about this
_KNOWN = 2.0  # a measured square is at least twice its standard uncertainty


def overlapping(
    data: ArrayLike,
    rate: float,
    taus: Literal["octave"] | Sequence[float] | _Array = "octave",
    *,
    unit: str = "1",
    confidence: float = 0.68,
) -> AllanCurve:
    """Return the overlapping Allan deviation of rate data.

    Model: sigma^2(m) = sum_j (x[j+2m] - 2 x[j+m] + x[j])^2 / (2 (m tau0)^2 (N - 2m)), SP1065 equation 11, with the
    N phases x the running sum of the rate without its mean, which changes nothing but the rounding. Intervals are
    chi-square with the equivalent degrees of freedom of the noise type identified at each m; where fewer than 30
    averages are left, or a bluer type could be chance, the type of the nearest shorter tau stands in.

    Args:
        data: evenly spaced rate, shape (n,), in `unit`.
        rate: samples per second.
        taus: averaging times in s, each taken at the nearest whole number of samples; or "octave": 1, 2, 4...
            samples up to a quarter of the record.
        unit: unit of the data.
        confidence: of the intervals, between 0 and 1.

    Raises:
        Refused: the data are not a finite series of two samples or more, or an averaging time does not fit.
    """
    if not 0.0 < confidence < 1.0:
        raise Refused(f"a confidence of {confidence:g} is not possible", "give a number between 0 and 1, such as 0.68")
    phase = _phase(data, rate)
    samples = phase.size - 1
    factors = _factors(samples, rate, taus)
    variance = np.empty(factors.size)
    degrees = np.empty(factors.size)
    alpha = np.zeros(factors.size, dtype=np.int64)
    scratch = np.empty(samples - 1)
    for place, m in enumerate(factors.tolist()):
        variance[place] = _variance(phase, m, scratch)
        alpha[place] = _noise_type(phase, m, int(alpha[max(0, place - 1)]))
        degrees[place] = allan_confidence.edf({int(alpha[place]): 1.0}, m, samples + 1 - 2 * m)
    low, high = allan_confidence.interval(variance, degrees, confidence)
    return AllanCurve(
        unit=unit,
        rate=float(rate),
        samples=samples,
        confidence=confidence,
        tau=factors / rate,
        deviation=np.sqrt(variance),
        m=factors,
        terms=samples + 1 - 2 * factors,
        edf=degrees,
        low=np.sqrt(low),
        high=np.sqrt(high),
        alpha=alpha,
    )


def _phase(data: ArrayLike, rate: float) -> _Array:
    values = np.asarray(data, dtype=np.float64)
    if not (math.isfinite(rate) and rate > 0.0):
        raise Refused(f"a rate of {rate:g} Hz is not possible", "give the samples per second")
    if values.ndim != 1 or values.size < 2:
        raise Refused(f"data of shape {values.shape} hold no Allan deviation", "give one series of two samples or more")
    mean = float(values.mean())
    if not math.isfinite(mean):
        bad = np.flatnonzero(~np.isfinite(values))
        first = f", the first is number {bad[0] + 1}" if bad.size else "; their sum is too large"
        raise Refused(
            f"{bad.size} of {values.size} samples are not finite numbers{first}",
            "cut the record to a part without holes, or find out why they are there",
        )
    if values.min() == values.max():
        mean = float(values[0])  # a mean that rounds differently would look like noise
    phase = np.empty(values.size + 1)
    phase[0] = 0.0
    np.subtract(values, mean, out=phase[1:])
    np.cumsum(phase[1:], out=phase[1:])
    return phase


def _factors(samples: int, rate: float, taus: Literal["octave"] | Sequence[float] | _Array) -> NDArray[np.int64]:
    if isinstance(taus, str):
        return np.asarray(1 << np.arange(max(1, int(math.log2(max(samples // 4, 1))) + 1)), dtype=np.int64)
    wanted = np.atleast_1d(np.asarray(taus, dtype=np.float64))
    factors = np.unique(np.rint(wanted * rate)) if np.isfinite(wanted).all() else np.zeros(1)
    if not factors.size or factors[0] < 1 or factors[-1] > samples // 2:
        raise Refused(
            f"averaging times must lie between {1 / rate:g} s and {samples // 2 / rate:g} s, half of the record",
            "leave the others out",
        )
    return factors.astype(np.int64)


def _noise_type(phase: _Array, m: int, shorter: int) -> int:
    """Identify the noise type at one averaging factor, given that at the next shorter one.

    In a sum of noises the redder one wins as tau grows, so a bluer type is believed only where chance cannot make it.
    """
    averages = np.diff(phase[::m][: allan_confidence.MOST_AVERAGES + 1])
    known = allan_confidence.identify(averages)
    if known is None or (known > shorter and averages.size < _BEYOND_CHANCE):
        return shorter
    return known


def _variance(phase: _Array, m: int, scratch: _Array) -> float:
    """Overlapping Allan variance at one averaging factor, in place; phase is in units of rate times samples."""
    difference = scratch[: phase.size - 2 * m]
    np.subtract(phase[2 * m :], phase[m:-m], out=difference)
    difference -= phase[m:-m]
    difference += phase[: -2 * m]
    np.square(difference, out=difference)
    return float(difference.sum()) / (2.0 * m * m * difference.size)  # pairwise, and the same on any number of cores


def characterise(
    data: ArrayLike, rate: float, unit: str, *, confidence: float = 0.68, tau_min: float = 0.0
) -> NoiseModel:
    """Return the noise coefficients of a sensor at rest, each with its uncertainty and status.

    Model: sigma^2(tau) = N^2 / tau + (2 ln 2 / pi) B^2 + K^2 tau / 3 in its exact sampled form, fitted to the
    overlapping Allan variance at octaves of tau by `allan_fit.fit`. Where the misfit has a probability below 0.001,
    the model is first granted an error of 3 %, then the shortest averaging time is left out, and so on, up to half of
    the points; a sensor's own filter bends the curve there. What then still does not fit is rejected.

    A coefficient is MEASURED where the information criterion keeps its term and its square is known to 50 % or
    better; else an UPPER_LIMIT, whose value is a bound at 95 % confidence, and whose uncertainty is that of the
    estimate below it. Degrees of freedom are those of a chi-square with the relative uncertainty of the square.

    Args:
        data: evenly spaced rate at rest, shape (n,), in `unit`.
        rate: samples per second.
        unit: unit of the data.
        confidence: of the curve's intervals, between 0 and 1.
        tau_min: averaging times below this, in s, are not fitted.

    Raises:
        Refused: the data are not a finite series of two samples or more.
    """
    curve = overlapping(data, rate, unit=unit, confidence=confidence)
    usable = int((curve.tau >= tau_min * (1.0 - 1e-9)).sum())
    first = curve.tau.size - usable
    if not curve.deviation.any():
        return _unobservable(curve, f"all {curve.samples} samples are the same: stuck, or below the resolution")
    if not curve.deviation.all():
        return _unobservable(curve, "the deviation is zero at some averaging times: too few distinct samples")
    if usable < _FEWEST_POINTS:
        return _unobservable(
            curve, f"{usable} averaging times can be fitted and {_FEWEST_POINTS} are needed: record longer"
        )
    last = first + min(usable // 2, usable - _FEWEST_POINTS)
    for start in range(first, last + 1):
        for floor in (0.0, _MODEL_ERROR):
            found = allan_fit.fit(_points(curve, start), floor)
            if found.tail >= _WORST_TAIL:
                return _model(curve, found, start, floor)
    return _model(curve, allan_fit.fit(_points(curve, first), _MODEL_ERROR), first, _MODEL_ERROR)


def _points(curve: AllanCurve, start: int) -> allan_fit.Points:
    return allan_fit.Points(
        rate=curve.rate,
        m=curve.m[start:],
        terms=curve.terms[start:],
        variance=np.square(curve.deviation[start:]),
        edf=curve.edf[start:],
    )


def _model(curve: AllanCurve, found: allan_fit.Fit, start: int, floor: float) -> NoiseModel:
    rejected = found.tail < _WORST_TAIL
    figures = [_figure(found, term, unit, rejected) for term, unit in enumerate(_units(curve.unit))]
    remark = (
        f"white noise, flicker and random walk together do not describe this record (chi {found.chi:.1f}): "
        "look for motion, temperature, vibration or interference"
    )
    return NoiseModel(
        white=figures[0],
        flicker=figures[1],
        random_walk=figures[2],
        averaging_window=_window(curve),
        curve=curve,
        fitted=np.sqrt(allan_fit.variances(curve.m, curve.rate) @ found.squares),
        chi=found.chi,
        tau_min=float(curve.tau[start]),
        model_error=floor,
        remark=remark if rejected else "",
    )


def _figure(found: allan_fit.Fit, term: int, unit: str, rejected: bool) -> Figure:
    square, uncertainty = float(found.offered[term]), float(found.uncertainty[term])
    if rejected:
        value = math.sqrt(float(found.squares[term]))
        return Figure(value=value, unit=unit, status=FigureStatus.MODEL_REJECTED)
    status = FigureStatus.MEASURED
    if not (found.selected[term] and square >= _KNOWN * uncertainty):
        square, status = float(found.bound[term]), FigureStatus.UPPER_LIMIT
    value = math.sqrt(square)
    dof = 2.0 * (square / uncertainty) ** 2
    return Figure(value=value, unit=unit, uncertainty=uncertainty / (2.0 * value), dof=dof, status=status)


def _units(unit: str) -> tuple[str, str, str]:
    return f"{unit}/sqrt(Hz)", unit, f"{unit}*sqrt(Hz)"


def _unobservable(curve: AllanCurve, remark: str) -> NoiseModel:
    figures = [
        Figure(value=math.nan, unit=unit, status=FigureStatus.NOT_OBSERVABLE) for unit in (*_units(curve.unit), "s")
    ]
    return NoiseModel(
        white=figures[0],
        flicker=figures[1],
        random_walk=figures[2],
        averaging_window=figures[3],
        curve=curve,
        fitted=np.empty(0),
        chi=math.nan,
        tau_min=float(curve.tau[0]),
        model_error=0.0,
        remark=remark,
    )


def _window(curve: AllanCurve) -> Figure:
    """Averaging time with the smallest deviation; its uncertainty spans the times that are as good within theirs."""
    best = int(np.argmin(curve.deviation))
    alike = np.flatnonzero(curve.low <= curve.high[best])
    span = float(curve.tau[alike[-1]] * math.sqrt(2.0) - curve.tau[alike[0]] / math.sqrt(2.0))
    ends = {0: FigureStatus.UPPER_LIMIT, curve.tau.size - 1: FigureStatus.NOT_OBSERVABLE}
    status = ends.get(best, FigureStatus.MEASURED)
    return Figure(value=float(curve.tau[best]), unit="s", uncertainty=span / math.sqrt(12.0), status=status)
