"""Temperature dependence of a magnetometer's bias: a linear term in the fit, or only a temperature tag."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.magnetometer.calibration import Warmth
from hil.analysis.magnetometer.geometry import BASES, Array, Estimate, Linearised, linearised
from hil.analysis.magnetometer.settling import Given, Method, Shape, settled
from hil.model.errors import Refused

__all__ = ["NONE", "Drift", "checked", "fitted"]

_LEAST_SPAN = 5.0  # K: least span for a slope; below it the calibration is only tagged with its temperatures
_PASSES = 12
_RESTING = 1e-3  # convergence: change in units of a slope's standard uncertainty
_LOW, _HIGH = -100.0, 200.0  # degC


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drift:
    """Temperature dependence found in the readings.

    Attributes:
        slope: (3,), change of the bias per K; zero where none was fitted.
        warmer: (n,), temperature of each reading relative to the reference [K]; None if unknown.
        reference: reference temperature of the bias, the mean of the readings [degC].
        fits: whether a slope was fitted.
        kept: mask of the readings that are not outliers.
        estimate: bias at the reference, and gain.
    """

    slope: Array = field(default_factory=lambda: np.zeros(3))
    warmer: Array | None = None
    reference: float = math.nan
    fits: bool = False
    kept: NDArray[np.bool_] = field(default_factory=lambda: np.ones(0, dtype=np.bool_))
    estimate: Estimate = field(default_factory=lambda: Estimate(bias=np.zeros(3), gain=np.eye(3)))

    def at_reference(self, given: Given) -> Given:
        """Return the readings reduced to the reference temperature."""
        if self.warmer is None or not self.fits:
            return given
        return replace(given, readings=given.readings - np.outer(self.warmer, self.slope))

    def with_slopes(self, about: Linearised) -> Linearised:
        """Return the linearised residuals of the kept readings, with the derivatives by the slopes appended."""
        if self.warmer is None or not self.fits:
            return about
        return replace(about, jacobian=_with_slopes(about, self.warmer[self.kept]))

    def told(self, covariance: Array | None) -> Warmth | None:
        """Return the calibration's `Warmth`, given the covariance (3, 3) of the slopes."""
        if self.warmer is None:
            return None
        inside = self.reference + self.warmer[self.kept]
        spread = np.zeros(3) if covariance is None else np.sqrt(np.maximum(0.0, np.diag(covariance)))
        return Warmth(
            reference=self.reference,
            low=float(inside.min()),
            high=float(inside.max()),
            drift=tuple(self.slope.tolist()) if self.fits else None,
            spread=tuple(spread.tolist()) if self.fits else None,
        )


NONE = Drift()
"""For readings of unknown temperature."""


def checked(temperature: ArrayLike, count: int) -> Array:
    """Return temperatures (n,) in degC, validated.

    Raises:
        Refused: the number of temperatures is wrong, or a value is not plausible.
    """
    degrees = np.array(temperature, dtype=np.float64)
    if degrees.shape != (count,):
        raise Refused(f"{degrees.size} temperatures for {count} readings", "give one for each reading")
    if not (np.isfinite(degrees).all() and degrees.min() > _LOW and degrees.max() < _HIGH):
        raise Refused("a temperature is no number of degC", "give degrees Celsius, or leave the temperature out")
    return degrees


def fitted(
    given: Given, degrees: Array, kept: NDArray[np.bool_], estimate: Estimate, how: tuple[Method, Shape]
) -> Drift:
    """Return the temperature slope of the bias, and the fit to readings corrected for it.

    The slope enters every residual like the bias, times the temperature relative to the mean: each pass solves for its
    change together with bias and gain, and refits these by their own method. It has converged when the change is below
    a thousandth of its uncertainty.

    Args:
        given: the uncorrected readings.
        degrees: temperatures in degC, (n,).
        kept: mask of readings that are not outliers of the fit without a slope.
        estimate: the fit without a slope.
        how: method and shape.
    """
    reference = float(degrees[kept].mean())
    warmer = degrees - reference
    drift = Drift(warmer=warmer, reference=reference, kept=kept, estimate=estimate)
    if float(np.ptp(degrees[kept])) < _LEAST_SPAN:
        return drift
    drift = replace(drift, fits=True)
    for _ in range(_PASSES):
        inliers = drift.at_reference(given).part(drift.kept)
        about = linearised(inliers.readings, inliers.field, drift.estimate, BASES[how[1]])
        scaled = _with_slopes(about, warmer[drift.kept]) / about.spread
        fisher = scaled @ scaled.T
        change = -np.linalg.lstsq(fisher, scaled @ (about.residual / about.spread), rcond=None)[0][-3:]
        variance = float(np.square(about.residual / about.spread).mean())
        resting = _RESTING * np.sqrt(variance * np.maximum(0.0, np.diag(np.linalg.pinv(fisher))[-3:]))
        drift = replace(drift, slope=drift.slope + change)
        kept, estimate = settled(drift.at_reference(given), drift.estimate, *how)
        drift = replace(drift, kept=kept, estimate=estimate)
        if not estimate.physical or (np.abs(change) <= resting).all():
            return drift
    return replace(drift, estimate=replace(drift.estimate, converged=False))


def _with_slopes(about: Linearised, warmer: Array) -> Array:
    return np.vstack([about.jacobian, about.jacobian[:3] * warmer])
