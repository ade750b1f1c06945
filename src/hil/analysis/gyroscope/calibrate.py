"""Calibration of a gyroscope from readings at several temperatures and rates."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hil.analysis.gyroscope.calibration import ALIGNED, CalibratedRate, Calibration, Polynomial
from hil.analysis.gyroscope.fitting import Fit, fit
from hil.analysis.gyroscope.readings import Reading, Response, Slow, responses
from hil.analysis.interchange import Matrix
from hil.analysis.tracing import traced
from hil.model.errors import Refused
from hil.model.figure import Figure, effective_dof

__all__ = ["CalibrationReport", "calibrate"]

_Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationReport:
    """A calibration with the fits behind it.

    Attributes:
        calibration: the result.
        bias: fit of the bias by axis.
        scale: fit of the scale by axis, without axes that did not turn.
        responses: the gains behind the scales.
        remarks: caveats, in sentences.
    """

    calibration: Calibration
    bias: Mapping[str, Fit]
    scale: Mapping[str, Fit]
    responses: tuple[Response, ...]
    remarks: tuple[str, ...]


@traced
def calibrate(
    readings: Sequence[Reading],
    *,
    reference: float = 25.0,
    rate_uncertainty: float = 0.0,
    bias_uncertainty: float = 0.0,
    slow: Slow | None = None,
    mounting_uncertainty: float = 0.0,
    margin: float = 0.0,
    degree: int | None = None,
) -> CalibrationReport:
    """Fit bias, scale and alignment over temperature.

    Bias: readings at rest over temperature. Scale: reciprocal of each axis's own gain (`readings.responses`) over
    temperature. Both are polynomials whose degree is selected from the data (`fitting.fit`). Alignment: the inverse of
    E, which has ones on its diagonal and off it the mean over temperatures of scale(T) times cross gain, with a row per
    sensor axis and a column per table axis; it needs all three table axes.

    Errors common to several readings do not appear in their scatter. Those common to some (the Earth's rate within a
    mounting, a wandering bias) enter the covariance of the bias fit (`readings.Slow`); those common to all are added to
    the results of the fits: to the constant of the bias, to the scale as a whole, and to every off-diagonal element of
    E. The bias is the one at the start of the sensor (`Reading.at` 0), or equally long after the
    readings.

    Args:
        readings: at rest at two or more temperatures, and turning at two or more temperatures per turning axis.
        reference: reference temperature of the polynomials [degC].
        rate_uncertainty: relative standard uncertainty common to all of the table's rates.
        bias_uncertainty: standard uncertainty common to all readings at rest, in their unit.
        slow: errors common to some readings, which their scatter does not show.
        mounting_uncertainty: standard uncertainty of the angle between a sensor axis, as mounted, and the table's
            axis, towards each of the other axes [rad].
        degree: degree of bias and scale, 1 to 3, where a scale has enough temperatures; None to select it.
        margin: permitted extrapolation beyond the lowest and highest measured temperature [K].

    Raises:
        Refused: too few readings, different axes or units, or as `readings.responses` and `fitting.fit`.
    """
    if not readings:
        raise Refused("there is no reading", "measure at rest at two temperatures or more")
    names = tuple(readings[0].means)
    unit = _unit(readings, names)
    resting = [reading for reading in readings if not reading.turning]
    common = {name: (slow or Slow()).covariance(resting, name) for name in names}
    bias = {name: _bias(name, resting, reference, common[name], bias_uncertainty, degree) for name in names}
    found = responses(readings, slow)
    scale = {name: _scale(name, found, reference, rate_uncertainty, degree) for name in names}
    scaled = {name: each for name, each in scale.items() if each is not None}
    alignment, uncertainty, dof = _alignment(names, found, scaled, mounting_uncertainty)
    axes = {
        name: CalibratedRate(
            bias=_widened(bias[name].polynomial, margin),
            scale=_widened(scaled[name].polynomial if name in scaled else _unmeasured(bias[name].polynomial), margin),
        )
        for name in names
    }
    calibration = Calibration(
        unit=unit, axes=axes, alignment=alignment, alignment_uncertainty=uncertainty, alignment_dof=dof
    )
    return CalibrationReport(
        calibration=calibration,
        bias=bias,
        scale=scaled,
        responses=found,
        remarks=(*_one_way(found), *_remarks(names, bias, scaled, calibration)),
    )


def _unit(readings: Sequence[Reading], names: tuple[str, ...]) -> str:
    units = {figure.unit for reading in readings for figure in reading.means.values()}
    if any(tuple(reading.means) != names for reading in readings) or len(units) != 1:
        raise Refused("the readings do not have the same axes in one unit", "give every axis in each reading")
    unknown = {axis for reading in readings for axis in reading.turning} - set(names)
    if unknown:
        raise Refused(f"the table turns about {', '.join(sorted(unknown))}", f"name one of {', '.join(names)}")
    return units.pop()


def _fitted(
    what: str,
    name: str,
    points: Sequence[Reading | Response],
    values: list[Figure],
    reference: float,
    common: _Array | None,
    degree: int | None,
) -> Fit:
    try:
        return fit([point.temperature for point in points], values, reference=reference, shared=common, degree=degree)
    except Refused as error:
        raise Refused(f"{what} of axis {name}: {error.message}", error.hint) from None


def _bias(
    name: str, resting: Sequence[Reading], reference: float, common: _Array, shared: float, degree: int | None
) -> Fit:
    means = [reading.means[name] for reading in resting]
    fitted = _fitted("bias", name, resting, means, reference, common, degree)
    return _with_shared(fitted, (shared, *(0.0,) * (len(fitted.polynomial.coefficients) - 1)))


def _scale(
    name: str, found: Sequence[Response], reference: float, rate_uncertainty: float, degree: int | None
) -> Fit | None:
    own = [response for response in found if response.axis == name]
    if not own:
        return None
    most = None if degree is None else max(1, min(degree, len({response.temperature for response in own}) - 1))
    fitted = _fitted("scale", name, own, [_inverse(response.gains[name]) for response in own], reference, None, most)
    low, high = min(response.low for response in own), max(response.high for response in own)
    polynomial = replace(fitted.polynomial, low=low, high=high)
    together = tuple(rate_uncertainty * each for each in polynomial.coefficients)
    return _with_shared(replace(fitted, polynomial=polynomial), together)


def _inverse(gain: Figure) -> Figure:
    if not abs(gain.value) > 0.0:
        raise Refused("an axis does not respond to its rate", "check the mounting, and which axis is which")
    uncertainty = None if gain.uncertainty is None else gain.uncertainty / gain.value**2
    return Figure(value=1.0 / gain.value, unit="1", uncertainty=uncertainty, dof=gain.dof)


def _with_shared(fitted: Fit, together: tuple[float, ...]) -> Fit:
    """Add the uncertainty common to all points, which moves all coefficients together by `together`."""
    polynomial = fitted.polynomial
    if polynomial.covariance is None or not any(together):
        return fitted
    own = np.asarray(polynomial.covariance)
    shared = np.outer(together, together)
    dof = polynomial.dof * (1.0 + float(shared[0, 0]) / float(own[0, 0])) ** 2 if own[0, 0] else math.inf
    covariance = tuple(map(tuple, (own + shared).tolist()))
    return replace(fitted, polynomial=replace(polynomial, covariance=covariance, dof=dof))


def _widened(polynomial: Polynomial, margin: float) -> Polynomial:
    return replace(polynomial, low=polynomial.low - margin, high=polynomial.high + margin)


def _unmeasured(bias: Polynomial) -> Polynomial:
    return Polynomial(coefficients=(1.0,), unit="1", reference=bias.reference, low=bias.low, high=bias.high)


def _alignment(
    names: tuple[str, ...], found: Sequence[Response], scale: Mapping[str, Fit], mounting: float
) -> tuple[Matrix, Matrix | None, float]:
    if len(names) != 3 or len(scale) != 3:
        return ALIGNED if len(names) == 3 else _identity(len(names)), None, math.inf
    cross, spread, dofs = np.eye(3), np.zeros((3, 3)), []
    for column, axis in enumerate(names):
        own = [response for response in found if response.axis == axis]
        for row, name in enumerate(names):
            if row != column:
                cross[row, column], scatter, dof = _cross_gain(name, own, scale[name].polynomial)
                spread[row, column] = math.hypot(scatter, mounting)
                dofs.append(effective_dof([(scatter**2, dof), (mounting**2, math.inf)]))
    alignment = np.asarray(np.linalg.inv(cross), dtype=np.float64)
    uncertainty = np.sqrt(np.square(alignment) @ np.square(spread) @ np.square(alignment))
    known = np.isfinite(uncertainty).all()
    return _matrix(alignment), _matrix(uncertainty) if known else None, min(dofs) if known else math.inf


def _cross_gain(name: str, own: Sequence[Response], scale: Polynomial) -> tuple[float, float, float]:
    """Return the mean over temperatures of an axis's scaled cross response: value, standard uncertainty, dof."""
    factors = [
        float(scale.at(min(max(response.temperature, scale.low), scale.high))) for response in own
    ]  # temperatures of two axes differ slightly, and the scale hardly changes within that
    gains = [factor * response.gains[name].value for factor, response in zip(factors, own, strict=True)]
    spreads = [
        math.nan if response.gains[name].uncertainty is None else factor * (response.gains[name].uncertainty or 0.0)
        for factor, response in zip(factors, own, strict=True)
    ]
    dof = effective_dof((spread**2, response.gains[name].dof) for spread, response in zip(spreads, own, strict=True))
    return float(np.mean(gains)), math.sqrt(sum(spread**2 for spread in spreads)) / len(spreads), dof


def _matrix(values: _Array) -> Matrix:
    return tuple(tuple(row) for row in values.tolist())


def _identity(size: int) -> Matrix:
    return _matrix(np.eye(size))


def _one_way(found: Sequence[Response]) -> tuple[str, ...]:
    axes = dict.fromkeys(each.axis for each in found if each.one_way)
    return tuple(
        f"scale of axis {axis}: from one direction and readings at rest, as if the other direction had the same gain"
        for axis in axes
    )


def _remarks(
    names: tuple[str, ...], bias: Mapping[str, Fit], scale: Mapping[str, Fit], calibration: Calibration
) -> tuple[str, ...]:
    remarks = [
        f"{what} of axis {name}: {each.remark}"
        for what, fits in (("bias", bias), ("scale", scale))
        for name, each in fits.items()
        if each.remark
    ]
    still = [name for name in names if name not in scale]
    if still:
        remarks.append(f"scale of axis {', '.join(still)}: not measured, taken as 1 without an uncertainty")
    if calibration.alignment_uncertainty is None:
        remarks.append("alignment: not measured, or without an uncertainty; it needs rates about three axes")
    return tuple(remarks)
