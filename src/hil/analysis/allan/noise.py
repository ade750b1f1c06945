"""Noise of a sensor at rest: what its Allan curve says, how long to average, and the mean with its uncertainty.

Definitions of the coefficients: IEEE Std 952-1997, annex C.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.allan import fit as allan_fit
from hil.analysis.allan.deviation import deviation
from hil.analysis.allan.results import AllanCurve, NoiseModel
from hil.analysis.statistics import not_observable
from hil.analysis.tracing import traced
from hil.model.errors import Refused
from hil.model.figure import Figure, FigureStatus

__all__ = ["MovingAverage", "best_average", "characterise", "rest_mean"]

_FEWEST_POINTS = 5  # one more than three terms and a degree of freedom for the misfit
_WORST_TAIL = 1e-3  # a right model is rejected once in a thousand records
_MODEL_ERROR = 0.03  # of the deviation: filters, quantisation and temperature bend real curves by about this
_SLOWEST, _FASTEST = 1e-9, 1e12  # Hz; beyond them products of rates and averaging times leave the range of numbers
_KNOWN = 2.0  # a measured square is at least twice its standard uncertainty
_WELL_KNOWN_DOF = 10.0  # of a deviation that may be the smallest: averaging times up to about an eighth of the record


@traced
def characterise(
    data: ArrayLike, rate: float, unit: str, *, confidence: float = 0.68, tau_min: float = 0.0, holes: bool = False
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
        holes: whether NaN stands for a sample that is missing; see `deviation`.

    Raises:
        Refused: the data are not a finite series of two samples or more, or the rate is none of a sensor.
    """
    if not _SLOWEST <= rate <= _FASTEST:
        raise Refused(f"{rate:g} Hz is no sampling rate of a sensor", "check the unit of time")
    curve = deviation(data, rate, unit=unit, confidence=confidence, holes=holes)
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
        averaging_window=replace(_window(curve), status=FigureStatus.MODEL_REJECTED) if rejected else _window(curve),
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
    """Averaging time with the smallest deviation; its uncertainty spans the times that are as good within theirs.

    Only among times whose deviation has ten degrees of freedom: of the few longest ones, one often is low by chance.
    """
    known = max(1, int((curve.edf >= _WELL_KNOWN_DOF).sum()))
    best = int(np.argmin(curve.deviation[:known]))
    alike = np.flatnonzero(curve.low[:known] <= curve.high[best])
    span = float(curve.tau[alike[-1]] * math.sqrt(2.0) - curve.tau[alike[0]] / math.sqrt(2.0))
    ends = {0: FigureStatus.UPPER_LIMIT, known - 1: FigureStatus.NOT_OBSERVABLE}
    status = ends.get(best, FigureStatus.MEASURED)
    return Figure(value=float(curve.tau[best]), unit="s", uncertainty=span / math.sqrt(12.0), status=status)


_Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class MovingAverage:
    """A queue of the last samples whose mean is the output: y[k] = (x[k] + ... + x[k-N+1]) / N.

    Attributes:
        samples: N, the length of the queue.
        rate: samples per second, into the queue and out of it.
    """

    samples: int
    rate: float

    def __post_init__(self) -> None:
        if self.samples < 1 or not self.rate > 0.0:
            raise Refused(
                f"a queue of {self.samples} samples at {self.rate:g} Hz is not possible",
                "give one sample or more, and the samples per second",
            )

    @property
    @traced
    def delay(self) -> float:
        """Group delay in s, the same at all frequencies: (N - 1) / 2 samples."""
        return (self.samples - 1) / (2.0 * self.rate)

    @property
    def settling(self) -> float:
        """Time in s from a step to the first output that holds nothing from before it: N - 1 samples."""
        return (self.samples - 1) / self.rate

    def step(self, time: ArrayLike) -> _Array:
        """Return the response to a unit step that the first sample at or after time 0 sees; time in s."""
        after = np.floor(np.asarray(time, dtype=np.float64) * self.rate + 1e-9) + 1.0
        return np.clip(after / self.samples, 0.0, 1.0)

    def gain(self, frequency: ArrayLike) -> _Array:
        """Return the gain for sines, |sin(pi f N / rate) / (N sin(pi f / rate))|; frequency in Hz."""
        angle = np.pi * np.asarray(frequency, dtype=np.float64) / self.rate
        below = self.samples * np.sin(angle)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.sin(self.samples * angle) / below
        return np.where(np.abs(below) < 1e-12, 1.0, np.abs(ratio))

    def filtered(self, data: ArrayLike) -> _Array:
        """Return what the queue gives once it is full; shape (n,) becomes (n - N + 1,)."""
        sums = np.concatenate([[0.0], np.cumsum(np.asarray(data, dtype=np.float64))])
        return np.asarray((sums[self.samples :] - sums[: -self.samples]) / self.samples)

    @traced
    def noise(self, curve: AllanCurve) -> float:
        """Return the deviation between neighbouring averages over sqrt(2), in the curve's unit: its value at N samples.

        Between averaging times the curve is interpolated as straight lines in logarithms.

        Raises:
            Refused: the queue is longer than the curve's longest averaging time.
        """
        length = self.samples / self.rate
        if length > curve.tau[-1] * (1.0 + 1e-9):
            raise Refused(f"the curve ends at {curve.tau[-1]:g} s and the queue holds {length:g} s", "record longer")
        return float(np.exp(np.interp(math.log(length), np.log(curve.tau), np.log(curve.deviation))))


@traced
def best_average(model: NoiseModel) -> MovingAverage:
    """Return the moving average at the minimum of the Allan deviation: averaging longer lets slower noise in.

    The minimum is flat. The uncertainty of `model.averaging_window` spans the windows that are as good within the
    record's knowledge; the shortest of them delays least.

    Raises:
        Refused: the record does not show its minimum.
    """
    window = model.averaging_window
    if not math.isfinite(window.value):
        raise Refused("no averaging time is known to be best", model.remark or "record longer")
    return MovingAverage(samples=max(1, round(window.value * model.curve.rate)), rate=model.curve.rate)


_FEWEST = 16  # samples: two averages in the eighth of the record
_PART = 8  # averaging times up to this part of the record have ten degrees of freedom and more
_POWERS = {-1: 0, -2: 1}  # of tau, in the Allan variance; white noise and bluer ones: -1


@traced
def rest_mean(samples: ArrayLike, rate: float, unit: str, *, systematic: float = 0.0) -> Figure:
    """Return the mean of a record at rest as a measure of the bias.

    u^2 is the Allan variance at the record's own length T, plus systematic^2. It is that at tau, the longest octave
    within an eighth of the record, extrapolated to T by the noise type found there: tau / T for white noise, 1 for
    flicker and T / tau for random walk. For white noise this is s^2 / n; under flicker or random walk, s / sqrt(n)
    would promise far too much. Degrees of freedom are those of the Allan variance at tau.

    Args:
        samples: shape (n,), in `unit`; NaN stands for a sample that is missing. Fewer than 16 samples, and samples that
            are all the same, make the mean NOT_OBSERVABLE.
        rate: samples per second.
        unit: unit of samples and result.
        systematic: standard uncertainty that all samples share, in `unit`; taken as exactly known.
    """
    values = np.asarray(samples, dtype=np.float64)
    present = values[np.isfinite(values)]
    if present.size < _FEWEST or present.min() == present.max():
        return not_observable(unit, float(present.mean()) if present.size else math.nan)
    curve = deviation(values, rate, unit=unit, holes=True)
    place = max(0, int((curve.m <= values.size // _PART).sum()) - 1)
    growth = (values.size / int(curve.m[place])) ** _POWERS.get(int(curve.alpha[place]), -1)
    variance = float(curve.deviation[place]) ** 2 * growth
    dof = float(curve.edf[place])
    total = variance + systematic**2
    return Figure(
        value=float(present.mean()),
        unit=unit,
        uncertainty=math.sqrt(total),
        dof=dof * (total / variance) ** 2 if variance > 0.0 else math.inf,
    )
