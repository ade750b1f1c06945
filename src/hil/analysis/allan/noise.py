"""Noise coefficients of a sensor at rest, from its Allan deviation.

Definitions of the coefficients: IEEE Std 952-1997, annex C.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.allan import fit as allan_fit
from hil.analysis.allan.curves import Slow, roughly, slow
from hil.analysis.allan.deviation import deviation
from hil.analysis.allan.ends import line, slope_variances, without
from hil.analysis.allan.results import AllanCurve, NoiseModel
from hil.analysis.allan.rolloff import Filter, rolloff
from hil.analysis.allan.tones import Tone, tones
from hil.analysis.tracing import traced
from hil.model.errors import Refused
from hil.model.figure import Figure, FigureStatus, effective_dof

__all__ = ["characterise"]

_FEWEST_POINTS = 6  # two more than four terms
_WORST_TAIL = 1e-3  # a correct model is rejected once in a thousand records as a misfit, and once as too good a fit
_GOOD_TAIL = 0.05  # to be reached without the shortest averaging times where the model is rejected with them
_SLOWEST, _FASTEST = 1e-9, 1e12  # Hz; beyond them products of rates and averaging times overflow
_SMALLEST, _LARGEST = 1e-40, 1e40  # deviations whose fourth power, times those of rates, does not overflow
_KNOWN = 2.0  # least ratio of a measured square to its standard uncertainty
_APART = 3.0  # least standard deviations of squared flicker from zero, where it takes the place of random walk
_SURE = 0.995  # confidence of a measured ramp, each side
_BENT = 20.0  # gain of a curve above which a line is not measured; one curve-free record in thirty has it
_NO_NOISE = 1e-13  # of the largest sample: rounding residue of a straight line
_WELL_KNOWN_DOF = 10.0  # needed to count as the minimum: averaging times up to about an eighth of the record
_SQUARES = tuple(allan_fit.TERMS)
_FLICKER = _SQUARES.index("flicker")
_FAST = (0, 1)  # the terms that dominate the shortest averaging times


@traced
def characterise(
    data: ArrayLike,
    rate: float,
    unit: str,
    *,
    confidence: float = 0.68,
    tau_min: float = 0.0,
    tau_max: float = math.inf,
    bandwidth: float | None = None,
    holes: bool = False,
) -> NoiseModel:
    """Return the noise coefficients of a sensor at rest, each with its uncertainty and status.

    Model: sigma^2(tau) = 3 Q^2 / tau^2 + N^2 / tau + (2 ln 2 / pi) B^2 + K^2 tau / 3 + R^2 tau^2 / 2 in its exact
    sampled form. R is the slope of the straight line through the record; the others are fitted by `allan.fit.fit` to
    the overlapping Allan variance, at octaves of tau, of the detrended record.

    A filter before the sampling removes a part that decreases as 1 / tau^2; it is fitted with Q. Averaging times below
    five time constants of a filter visible in the spectrum (`rolloff`) are left out. Where the misfit has a probability
    below 0.001, the shortest ones are dropped until it reaches 0.05, up to half of the points, and then one more; if
    that fails, the model is rejected. So is a fit that is too good, with a probability above 0.999, and one where a
    line in the spectrum moves a square by more than its uncertainty (`tones`).

    A coefficient is MEASURED where the criterion keeps its term and its square is known to 50 % or better (flicker in
    place of random walk: to a third, even under the best noise without flicker); otherwise it is an UPPER_LIMIT, whose
    value is a bound at 95 % confidence, and whose uncertainty is that of the estimate below it.
    Flicker, random walk and ramp are also limits where the record shows a curve, or where white noise with a curve
    explains it equally well, and random walk where flicker with a curve does (`curves.slow`). Quantisation is
    NOT_OBSERVABLE where a filter may hide it. Degrees of freedom are those of a chi-square variate with the relative
    spread of the square.

    Args:
        data: evenly spaced rate at rest, shape (n,), in `unit`.
        rate: sampling rate [Hz].
        unit: unit of the data.
        confidence: confidence level of the curve's intervals, between 0 and 1.
        tau_min: shortest averaging time to fit [s].
        tau_max: longest averaging time to fit [s].
        bandwidth: -3 dB bandwidth of the sensor's own filter [Hz]; averaging times below its inverse are not fitted.
        holes: whether NaN marks a missing sample; see `deviation`.

    Raises:
        Refused: the data are not a finite series of at least two samples, or the rate is implausible for a sensor.
    """
    if not _SLOWEST <= rate <= _FASTEST:
        raise Refused(f"{rate:g} Hz is no sampling rate of a sensor", "check the unit of time")
    curve = deviation(data, rate, unit=unit, confidence=confidence, holes=holes)
    if not curve.deviation.any():
        return _unobservable(curve, f"all {curve.samples} samples are the same: stuck, or below the resolution")
    scale = _scale(float(curve.deviation[0]))
    values = np.asarray(data, dtype=np.float64)
    values = values if scale == 1.0 else values / scale
    mean, slope = line(values)
    bare = deviation(without(values, slope), rate, holes=holes)
    if not curve.deviation.all():
        return _unobservable(curve, "the deviation is zero at some averaging times: too few distinct samples")
    straight = bare.deviation[0] <= _NO_NOISE * (abs(mean) + abs(slope) * values.size)
    shown = None if straight else rolloff(values, rate)
    shortest = max(tau_min, 1.0 / bandwidth if bandwidth else 0.0, shown.settling if shown else 0.0)
    usable = np.flatnonzero((bare.tau >= shortest * (1.0 - 1e-9)) & (bare.tau <= tau_max * (1.0 + 1e-9)))
    if usable.size < _FEWEST_POINTS:
        return _unobservable(curve, _too_few(int(usable.size), bare.tau.size, shown))
    if straight:
        return _unobservable(curve, "the samples are a straight line without noise")
    found, start = _fitted(bare, usable)
    slowly = slow(values, rate) if max(found.squares[2:]) > 0.0 or slope else None
    ramp = _Ramp.of(found, slope * rate, curve)
    tone = _loud(found, tones(values, rate), curve.m[start : int(usable[-1]) + 1], rate)
    corner = shown.corner if shown else bandwidth
    fast = found
    if slowly is not None and slowly.curve:
        rest = deviation(slowly.rest(values), rate, holes=holes)
        fast = allan_fit.fit(_points(rest, start, int(usable[-1]) + 1))
    if scale == 1.0:
        return _model(curve, found, fast, start, corner, ramp, slowly, tone)
    return _model(curve.scaled(1.0 / scale), found, fast, start, corner, ramp, slowly, tone).scaled(scale)


def _loud(found: allan_fit.Fit, lines: tuple[Tone, ...], m: NDArray[np.int64], rate: float) -> Tone | None:
    """Return the strongest line if together they move a square by more than its uncertainty, otherwise None."""
    if not lines:
        return None
    moved = (
        found.estimator
        @ np.array([line.variances(m, rate) for line in lines]).T
        / np.sqrt(np.diag(found.covariance))[:, None]
    )
    if float(np.abs(moved.sum(axis=1)).max()) <= 1.0:
        return None
    return lines[int(np.abs(moved).max(axis=0).argmax())]


def _too_few(usable: int, all_times: int, shown: Filter | None) -> str:
    times = "time" if usable == 1 else "times"
    limited = ", or allow the fit more of them" if usable < all_times and not shown else ""
    filtered = f" beyond the filter near {roughly(shown.corner)} Hz that the record shows" if shown else ""
    return f"{usable} averaging {times}{filtered} can be fitted and {_FEWEST_POINTS} are needed: record longer{limited}"


def _scale(size: float) -> float:
    """Return a power of two that scales deviations to about 1 where their fourth powers would overflow."""
    return 1.0 if not size or _SMALLEST < size < _LARGEST else math.ldexp(1.0, math.frexp(size)[1])


def _fitted(bare: AllanCurve, usable: NDArray[np.intp]) -> tuple[allan_fit.Fit, int]:
    """Return the fit of the points beyond the influence of a filter, and the index of the first one.

    Where the model is rejected, the shortest averaging times are dropped: up to half of the points, and then one more,
    because the remaining effect of a filter there is within the noise.
    """
    first, end = int(usable[0]), int(usable[-1]) + 1
    whole = allan_fit.fit(_points(bare, first, end))
    if whole.tail >= _WORST_TAIL:
        return whole, first
    last = first + min(usable.size // 2, usable.size - _FEWEST_POINTS)
    for start in range(first + 1, last + 1):
        if allan_fit.fit(_points(bare, start, end)).tail >= _GOOD_TAIL:
            beyond = min(start + 1, last)
            return allan_fit.fit(_points(bare, beyond, end)), beyond
    return whole, first


def _points(curve: AllanCurve, start: int, end: int) -> allan_fit.Points:
    return allan_fit.Points(
        rate=curve.rate,
        samples=curve.samples,
        m=curve.m[start:end],
        terms=curve.terms[start:end],
        variance=np.square(curve.deviation[start:end]),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Ramp:
    """The slope of a record in unit / s, with its variance under the fitted noise and the degrees of freedom.

    `slow` is set where slow noise contributes to it.
    """

    slope: float
    variance: float
    spread: float
    slow: bool

    @classmethod
    def of(cls, found: allan_fit.Fit, slope: float, curve: AllanCurve) -> _Ramp:
        shares = slope_variances(curve.samples, curve.rate)
        spread = math.sqrt(max(0.0, float(shares @ found.covariance @ shares)))
        squares = np.maximum(found.squares, 0.0)
        if squares[2:].any():  # one kind of slow noise may be mistaken for the other
            squares[2:] = np.maximum(squares[2:], found.offered[2:])
        return cls(slope=slope, variance=float(shares @ squares), spread=spread, slow=bool(squares[2:].any()))

    def figure(self, unit: str, *, doubted: bool) -> Figure:
        """Return the ramp, MEASURED where it exceeds what slow noise missed by the fit could explain."""
        from scipy.special import stdtrit  # noqa: PLC0415 - scipy is slow to import

        dof = max(1.0, 2.0 * (self.variance / self.spread) ** 2) if self.slow else math.inf
        missed = math.sqrt(self.variance + 2.0 * self.spread)
        size, uncertainty = abs(self.slope), math.sqrt(self.variance)
        if not doubted and size > float(stdtrit(dof, _SURE)) * missed:
            return Figure(value=size, unit=unit, uncertainty=uncertainty, dof=dof)
        bound = size + 2.0 * missed
        return Figure(value=bound, unit=unit, uncertainty=uncertainty, dof=dof, status=FigureStatus.UPPER_LIMIT)


def _model(
    curve: AllanCurve,
    found: allan_fit.Fit,
    fast: allan_fit.Fit,
    start: int,
    corner: float | None,
    ramp: _Ramp,
    slowly: Slow | None,
    tone: Tone | None,
) -> NoiseModel:
    """Return the model; quantisation and white noise are those of `fast`, the fit after removing any curve."""
    rejected = tone is not None or not _WORST_TAIL <= found.tail <= 1.0 - _WORST_TAIL
    doubted = _doubted(slowly)
    left = dict.fromkeys(_SQUARES, 0.0) | {"random_walk": slowly.open if slowly else 0.0}
    figures = {
        name: _figure(fast if term in _FAST else found, term, unit, rejected, name in doubted, left[name])
        for term, (name, unit) in enumerate(zip(_SQUARES, _units(curve.unit), strict=False))
    }
    figures["ramp"] = ramp.figure(_units(curve.unit)[-1], doubted=slowly is not None and slowly.gain > _BENT)
    bent = bool(corner) or found.squares[0] < 0.0 or int(curve.m[start]) > 1
    if rejected:
        figures = {
            name: replace(each, uncertainty=None, dof=math.inf, status=_REJECTED) for name, each in figures.items()
        }
    elif bent:
        figures["quantisation"] = replace(_NOWHERE, unit=figures["quantisation"].unit)
    squares = np.maximum(found.squares, 0.0)
    drift = ramp.slope**2 / 2.0 if figures["ramp"].status is FigureStatus.MEASURED else 0.0
    return NoiseModel(
        **figures,
        averaging_window=replace(_window(curve), status=_REJECTED) if rejected else _window(curve),
        curve=curve,
        fitted=np.sqrt(allan_fit.variances(curve.m, curve.rate) @ squares + drift * np.square(curve.tau)),
        chi=found.chi,
        tau_min=float(curve.tau[start]),
        remark="; ".join(_remarks(curve, found, start, corner, slowly, tone)),
    )


def _doubted(slowly: Slow | None) -> set[str]:
    """Return the names of the terms that a curve may mimic."""
    if slowly is None or (slowly.walk and slowly.noise and not slowly.curve):
        return set()
    return {"flicker", "random_walk"} if slowly.curve or not slowly.noise else {"random_walk"}


_REJECTED = FigureStatus.MODEL_REJECTED
_NOWHERE = Figure(value=math.nan, unit="1", status=FigureStatus.NOT_OBSERVABLE)


def _remarks(
    curve: AllanCurve,
    found: allan_fit.Fit,
    start: int,
    corner: float | None,
    slowly: Slow | None,
    tone: Tone | None,
) -> Iterator[str]:
    if tone is not None:
        where = f"a line near {tone.frequency:.3g} Hz"
        yield f"{where} moves the coefficients: find what drives it; those of the spectrum leave it out"
    if found.tail < _WORST_TAIL:
        yield (
            f"quantisation, white noise, flicker and random walk do not describe this record (chi {found.chi:.1f}): "
            "look for motion, temperature, vibration or interference"
        )
    elif found.tail > 1.0 - _WORST_TAIL:
        yield (
            f"the fit is better than noise allows (chi {found.chi:.2f}): the samples were smoothed, interpolated or "
            "repeated, or are no noise"
        )
    elif corner or found.squares[0] < 0.0:
        place = f" near {roughly(corner)} Hz" if corner else ""
        yield f"a filter{place} before the sampling bends the curve, fitted from {curve.tau[start]:.4g} s"
    if slowly is not None and slowly.curve:
        yield f"the record holds {slowly.curve}: flicker, random walk and ramp are bounds"
    elif slowly is not None and not slowly.noise and max(found.squares[2:]) > 0.0:
        yield "a warm-up, an oscillation or a jump explains the record as well: flicker and random walk are bounds"
    elif slowly is not None and not slowly.walk and found.squares[3] > 0.0:
        yield "a warm-up or an oscillation with flicker explains the record as well: random walk is a bound"


def _figure(found: allan_fit.Fit, term: int, unit: str, rejected: bool, doubted: bool, left: float) -> Figure:
    """Return a coefficient; `left` is the half-width of a uniform systematic error (GUM 4.3.7)."""
    square, uncertainty = float(found.offered[term]), math.sqrt(float(found.covariance[term, term]))
    if rejected:
        return Figure(value=math.sqrt(max(0.0, float(found.squares[term]))), unit=unit, status=_REJECTED)
    status = FigureStatus.MEASURED
    wider = math.hypot(uncertainty, 2.0 * math.sqrt(max(0.0, square)) * left / math.sqrt(3.0))
    known = square >= _KNOWN * wider and (term != _FLICKER or found.apart >= _APART)
    if doubted or not (found.squares[term] > 0.0 and known):
        square, status, left = float(found.bound[term]), FigureStatus.UPPER_LIMIT, 0.0
    value = math.sqrt(square)
    parts = [((uncertainty / (2.0 * value)) ** 2, 2.0 * (square / uncertainty) ** 2), (left**2 / 3.0, math.inf)]
    spread = math.sqrt(sum(variance for variance, _ in parts))
    return Figure(value=value, unit=unit, uncertainty=spread, dof=effective_dof(parts), status=status)


def _units(unit: str) -> tuple[str, ...]:
    return f"{unit}*s", f"{unit}/sqrt(Hz)", unit, f"{unit}*sqrt(Hz)", f"{unit}/s"


def _unobservable(curve: AllanCurve, remark: str) -> NoiseModel:
    names = (*_SQUARES, "ramp")
    return NoiseModel(
        **{name: replace(_NOWHERE, unit=unit) for name, unit in zip(names, _units(curve.unit), strict=True)},
        averaging_window=replace(_NOWHERE, unit="s"),
        curve=curve,
        fitted=np.empty(0),
        chi=math.nan,
        tau_min=float(curve.tau[0]),
        remark=remark,
    )


def _window(curve: AllanCurve) -> Figure:
    """Return the averaging time of the minimum; its uncertainty spans the times that are equally good within theirs.

    Only times whose deviation has ten degrees of freedom qualify: one of the longest few is often low by chance.
    """
    known = max(1, int((curve.edf >= _WELL_KNOWN_DOF).sum()))
    best = int(np.argmin(curve.deviation[:known]))
    alike = np.flatnonzero(curve.low[:known] <= curve.high[best])
    span = float(curve.tau[alike[-1]] * math.sqrt(2.0) - curve.tau[alike[0]] / math.sqrt(2.0))
    ends = {0: FigureStatus.UPPER_LIMIT, known - 1: FigureStatus.NOT_OBSERVABLE}
    status = ends.get(best, FigureStatus.MEASURED)
    return Figure(value=float(curve.tau[best]), unit="s", uncertainty=span / math.sqrt(12.0), status=status)
