"""The noise coefficients of a sensor at rest, read from its overlapping Allan deviation.

Definitions of the coefficients: IEEE Std 952-1997, annex C.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from hil.analysis.allan import fit as allan_fit
from hil.analysis.allan.deviation import deviation
from hil.analysis.allan.results import AllanCurve, NoiseModel
from hil.model.errors import Refused
from hil.model.figure import Figure, FigureStatus

__all__ = ["characterise"]

_FEWEST_POINTS = 5  # one more than three terms and a degree of freedom for the misfit
_WORST_TAIL = 1e-3  # a right model is rejected once in a thousand records
_MODEL_ERROR = 0.03  # of the deviation: filters, quantisation and temperature bend real curves by about this
_SLOWEST, _FASTEST = 1e-9, 1e12  # Hz; beyond them products of rates and averaging times leave the range of numbers
_KNOWN = 2.0  # a measured square is at least twice its standard uncertainty
_WELL_KNOWN_DOF = 10.0  # of a deviation that may be the smallest: averaging times up to about an eighth of the record


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
        raise Refused(f"{rate:g} Hz is no sampling rate of a sensor", "look at the unit of time")
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
