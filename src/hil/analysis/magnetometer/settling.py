"""Robust fitting: rejection of outliers, and selection of the shape, for any method."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hil.analysis.magnetometer import ellipsoid, likelihood, twostep
from hil.analysis.magnetometer.geometry import BASES, Array, Estimate, lengths, linearised, upper

__all__ = ["Given", "Method", "Shape", "chosen", "settled", "started", "typical"]

Method: TypeAlias = Literal["ellipsoid", "likelihood", "twostep"]
Shape: TypeAlias = Literal["auto", "sphere", "aligned", "general"]

_Which: TypeAlias = NDArray[np.bool_]

_LOOKED_AT = 1000  # readings used for the first estimate
_KEPT = 0.75  # share of them with the smallest residuals, beyond the reach of outliers
_NEARLY_ALL, _FAR = 0.95, 4.0  # share of readings, and multiple of their distance that marks corruption
_TRIMMINGS, _REJECTIONS = 10, 10
_UNLIKELY = 0.01  # false-alarm probability of an outlier per recording
_NORMAL = 1.4826  # standard deviation over median absolute deviation of normal noise
_ROUNDING = 1e-12  # of the field: smaller residuals are rounding
_VARIES = 1e-3  # of the field: a smaller variation counts as constant
_PASSES = 10  # of TWOSTEP, each with the weights of the previous one, until its first step vanishes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Given:
    """Input of a fit.

    Attributes:
        readings: (n, 3).
        field: (n,), magnitudes in the same unit, or ones.
        known: whether they are known.
    """

    readings: Array
    field: Array
    known: bool

    @property
    def varies(self) -> bool:
        """Whether the magnitude changes from sample to sample."""
        return float(np.ptp(self.field)) > _VARIES * float(self.field.mean())

    def part(self, which: _Which | slice) -> Given:
        """Return a subset of the samples."""
        return Given(readings=self.readings[which], field=self.field[which], known=self.known)


def typical(gain: Array) -> float:
    """Return the geometric mean of the gain along its principal axes."""
    return math.cbrt(abs(float(np.linalg.det(gain))))


def _scaled(given: Given, estimate: Estimate) -> Array:
    """Return residuals over |G u|, (n,): distances of readings from the ellipsoid, in their unit."""
    calibrated = (given.readings - estimate.bias) @ estimate.gain
    length = lengths(calibrated)
    return np.asarray((length - given.field) * length / lengths(calibrated @ estimate.gain))


def started(given: Given) -> Estimate:
    """Return a robust first estimate from a subset of the readings: the best of several trimmed fits."""
    part = given.part(slice(None, None, max(1, len(given.field) // _LOOKED_AT)))
    starts = [_trimmed(part, lambda some: _by_ellipsoid(some, "general"))]
    if part.varies:
        starts.append(_trimmed(part, _by_centre))
    near = _near(part)
    if len(near.field) < len(part.field):
        starts.append(_trimmed(near, lambda some: _by_ellipsoid(some, "general")))
    physical = [each for each in starts if each.physical] or [
        _trimmed(near, lambda some: _by_ellipsoid(some, "sphere"))
    ]
    return min(physical, key=lambda each: float(np.median(np.abs(_scaled(part, each)))))


def _near(given: Given) -> Given:
    """Return the readings without those so far off that they would dominate a fit, such as corrupted bus words."""
    far = lengths(given.readings - np.median(given.readings, axis=0))
    return given.part(far <= _FAR * np.quantile(far, _NEARLY_ALL))


def _by_ellipsoid(given: Given, shape: str) -> Estimate:
    found = ellipsoid.fit(given.readings, shape)
    return replace(found, gain=found.gain * float(given.field.mean()))


def _by_centre(given: Given) -> Estimate:
    middle, mean = given.readings.mean(axis=0), float(given.field.mean())
    centred = given.readings - middle
    scale = 1.0 / math.sqrt(float(np.square(centred).sum()) / len(centred))
    found = twostep.centred(centred * scale, given.field / mean)
    return replace(found, bias=middle + found.bias / scale, gain=found.gain * (scale * mean))


def _trimmed(given: Given, fit: Callable[[Given], Estimate]) -> Estimate:
    """Return a trimmed fit, found by alternating between fitting and selecting the best-fitting readings."""
    estimate, kept = fit(given), np.ones(len(given.field), dtype=np.bool_)
    for _ in range(_TRIMMINGS):
        if not estimate.physical:
            return estimate
        apart = np.abs(_scaled(given, estimate))
        before, kept = kept, apart <= np.quantile(apart, _KEPT)
        if (kept == before).all():
            break
        estimate = fit(given.part(kept))
    return estimate


def settled(given: Given, start: Estimate, method: Method, shape: str) -> tuple[_Which, Estimate]:
    """Return the mask of readings that are not outliers, and the fit to them, iterated until consistent."""
    kept: _Which = np.ones(len(given.field), dtype=bool)
    estimate = start
    if not start.physical:
        return kept, start
    limit = NormalDist().inv_cdf(1.0 - _UNLIKELY / (2.0 * len(kept)))
    apart = _scaled(given, estimate)
    spread = _NORMAL * float(np.median(np.abs(apart)))
    for _ in range(_REJECTIONS):
        floor = _ROUNDING * float(given.field.max()) / typical(estimate.gain)
        before, kept = kept, np.abs(apart) <= limit * max(spread, floor)
        left = int(kept.sum()) - 3 - BASES[shape].shape[1]
        if left < 1:
            return np.ones(len(kept), dtype=bool), replace(estimate, converged=False)
        if (kept == before).all() and estimate is not start:
            break
        estimate = _fitted(given.part(kept), estimate, method, shape)
        if not estimate.physical:
            break
        apart = _scaled(given, estimate)
        spread = math.sqrt(float(np.square(apart[kept]).sum()) / left)
    return kept, estimate


def _fitted(given: Given, start: Estimate, method: Method, shape: str) -> Estimate:
    if method == "ellipsoid":
        return _by_ellipsoid(given, shape)
    if method == "likelihood":
        return likelihood.fit(given.readings, given.field, start, shape)
    return _by_twostep(given, start)


def _by_twostep(given: Given, start: Estimate) -> Estimate:
    """Return the result of TWOSTEP about an estimate, with the noise taken from its own residuals.

    Readings are normalised to zero bias, and gain and field near one.
    """
    estimate, mean = start, float(given.field.mean())
    for _ in range(_PASSES):
        scale = typical(estimate.gain) / mean
        near = Estimate(bias=np.zeros(3), gain=estimate.gain / (scale * mean))
        about = Given(readings=(given.readings - estimate.bias) * scale, field=given.field / mean, known=True)
        noise = float(np.square(_scaled(about, near)).sum()) / max(1, len(about.field) - 9)
        along, square = about.readings @ near.gain, near.gain @ near.gain
        across = np.square(lengths(along @ near.gain) / lengths(along))
        variance = 4.0 * np.square(about.field) * across + 2.0 * noise * float(np.trace(square @ square))
        found = twostep.fit(about.readings, about.field, near, variance, -noise * float(np.trace(square)))
        estimate = replace(found, bias=estimate.bias + found.bias / scale, gain=found.gain * (scale * mean))
        if not estimate.physical or not estimate.converged or estimate.iterations <= 1:
            break
    return estimate


def chosen(given: Given, general: Estimate) -> Shape:
    """Return the shape with the best Bayesian information criterion.

    The sum of squares of a simpler shape is that of the general one plus the least increase in its quadratic
    approximation with the gain constrained to the shape and the bias free.
    """
    if not general.physical:
        return "general"
    about = linearised(given.readings, given.field, general, BASES["general"])
    scaled = about.jacobian / about.spread
    fisher = scaled @ scaled.T
    alone = fisher[3:, 3:] - fisher[3:, :3] @ np.linalg.lstsq(fisher[:3, :3], fisher[:3, 3:], rcond=None)[0]
    count, gain = len(given.field), upper(general.gain)
    floor = count * (_ROUNDING * float(given.field.max() / about.spread.mean())) ** 2
    least = float(np.square(about.residual / about.spread).sum()) + floor

    def evidence(shape: Shape) -> float:
        basis = BASES[shape]
        parameters = float(3 + basis.shape[1])
        apart = gain - basis @ np.linalg.lstsq(basis.T @ alone @ basis, basis.T @ alone @ gain, rcond=None)[0]
        more = max(0.0, float(apart @ alone @ apart))
        return float(count * math.log((least + more) / count) + parameters * math.log(count))

    shapes: tuple[Shape, ...] = ("sphere", "aligned", "general")
    return min(shapes, key=evidence)
