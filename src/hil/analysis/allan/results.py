"""Results of an Allan analysis: the curve, and the noise model derived from it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hil.model.figure import Figure

__all__ = ["AllanCurve", "NoiseModel"]

_Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class AllanCurve:
    """An Allan-family deviation; arrays of one shape (k,), in ascending order of tau.

    Attributes:
        estimator: overlapping, nonoverlapping, modified, time, hadamard (overlapping) or total.
        unit: unit of the deviations: that of the rate, times s for the time deviation.
        rate: sampling rate [Hz].
        samples: length of the record in samples, missing ones included.
        missing: number of missing samples.
        confidence: probability that an interval contains the true deviation.
        tau: averaging times [s].
        deviation: deviations, for the total estimator corrected for its known bias.
        m: averaging factors in samples.
        terms: number of differences of averages in the record; all are used unless `starts` is set.
        edf: equivalent degrees of freedom.
        low: lower ends of the confidence intervals.
        high: upper ends of the confidence intervals.
        alpha: noise types, from 2 (white angle) over 0 (white rate) to -2 (random walk of the rate).
        starts: number of differences used per averaging time, 0 for all.
    """

    estimator: str
    unit: str
    rate: float
    samples: int
    missing: int
    confidence: float
    tau: _Array
    deviation: _Array
    m: NDArray[np.int64]
    terms: NDArray[np.int64]
    edf: _Array
    low: _Array
    high: _Array
    alpha: NDArray[np.int64]
    starts: int = 0

    @property
    def figures(self) -> tuple[Figure, ...]:
        """The deviations with their standard uncertainties, deviation / sqrt(2 edf), for error bars in charts."""
        pairs = zip(self.deviation.tolist(), self.edf.tolist(), strict=True)
        return tuple(
            Figure(value=value, unit=self.unit, uncertainty=value / math.sqrt(2.0 * edf) if edf > 0.0 else None)
            for value, edf in pairs
        )

    def scaled(self, scale: float) -> AllanCurve:
        """Return the curve of data multiplied by a factor."""
        return replace(self, deviation=self.deviation * scale, low=self.low * scale, high=self.high * scale)


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseModel:
    """Noise model of a sensor, from a record at rest.

    Attributes:
        quantisation: quantisation of the angle Q, in unit*s.
        white: white noise N (of a gyroscope: angle random walk), in unit/sqrt(Hz).
        flicker: flicker B (bias instability), in the rate's unit; 0.664 B is the floor of the deviation.
        random_walk: random walk of the rate K, in unit*sqrt(Hz).
        ramp: magnitude of the record's slope R (rate ramp), in unit/s.
        averaging_window: averaging time of the smallest deviation, in s, among those with ten degrees of freedom;
            NOT_OBSERVABLE where it is the longest of them.
        curve: the deviations.
        fitted: deviation of the fitted model, without a filter, at the curve's averaging times; empty if nothing was
            fitted.
        chi: root of chi-square per degree of freedom of the fit, NaN where nothing was fitted.
        tau_min: shortest averaging time in the fit, in s.
        remark: why something is not observable, a limit or rejected, otherwise empty.
    """

    quantisation: Figure
    white: Figure
    flicker: Figure
    random_walk: Figure
    ramp: Figure
    averaging_window: Figure
    curve: AllanCurve
    fitted: _Array
    chi: float
    tau_min: float
    remark: str

    @property
    def in_fit(self) -> NDArray[np.bool_]:
        """Mask of the curve's averaging times that were fitted, from `tau_min` on; all False if nothing was fitted."""
        return (self.curve.tau >= self.tau_min * (1.0 - 1e-9)) & bool(self.fitted.size)

    @property
    def line(self) -> tuple[_Array, _Array] | None:
        """Averaging times and deviations of the fitted model over its range; None where nothing was fitted."""
        part = self.in_fit
        return (self.curve.tau[part], self.fitted[part]) if part.any() else None

    def scaled(self, scale: float) -> NoiseModel:
        """Return the model of data multiplied by a factor; averaging times are unchanged."""
        return replace(
            self,
            quantisation=_scaled(self.quantisation, scale),
            white=_scaled(self.white, scale),
            flicker=_scaled(self.flicker, scale),
            random_walk=_scaled(self.random_walk, scale),
            ramp=_scaled(self.ramp, scale),
            curve=self.curve.scaled(scale),
            fitted=self.fitted * scale,
        )


def _scaled(figure: Figure, scale: float) -> Figure:
    uncertainty = None if figure.uncertainty is None else figure.uncertainty * scale
    return replace(figure, value=figure.value * scale, uncertainty=uncertainty)
