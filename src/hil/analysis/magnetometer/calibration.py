"""Magnetometer calibration: field = matrix · (measured - bias)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.interchange import Matrix
from hil.analysis.statistics import not_observable
from hil.analysis.tracing import traced
from hil.model.figure import Figure

__all__ = ["AXES", "IDENTIFIABLE", "Calibration", "Warmth"]

AXES = ("x", "y", "z")
"""The axes of the sensor, in the order of every vector."""

IDENTIFIABLE = (
    "magnitudes of the field fix only the symmetric positive-definite factor of the distortion: a rotation or a "
    "reflection (a mounting angle, swapped axes, an axis of the wrong sign) changes no magnitude and stays unknown; "
    "known attitudes or another sensor must show it"
)
"""What a calibration without known attitudes cannot determine."""

_PLACES = {(0, 0): 3, (1, 1): 4, (2, 2): 5, (0, 1): 6, (0, 2): 7, (1, 2): 8}
_FIELD = 9
_ROUNDING = 1e-12  # of a value: least relative uncertainty, even for values exact by construction


@dataclass(frozen=True, slots=True, kw_only=True)
class Warmth:
    """Temperature range of a calibration's readings, and temperature drift of its bias.

    Attributes:
        reference: reference temperature of the bias [degC].
        low: lowest temperature of the readings [degC].
        high: highest temperature of the readings [degC].
        drift: temperature coefficient of the bias by axis, in the unit of the readings per K; None if not determined.
        spread: its standard uncertainty by axis.
    """

    reference: float
    low: float
    high: float
    drift: tuple[float, ...] | None = None
    spread: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """Bias and matrix of one magnetometer.

    Attributes:
        unit: unit of readings, bias and field.
        bias: reading in zero field, in `unit`.
        matrix: symmetric and positive definite, dimensionless; determinant 1 where the field is unknown.
        field: magnitude of calibrated readings in `unit`: the mean of the known ones, or the expected field for a
            matrix of determinant 1.
        absolute: whether the field magnitude was known, so that the matrix includes the absolute scale.
        covariance: (10, 10), of bias, matrix elements xx, yy, zz, xy, xz, yz, and field; None if
            unknown.
        dof: degrees of freedom of the covariance.
        method: `ellipsoid`, `likelihood` or `twostep`.
        shape: `sphere`, `aligned` or `general`.
        observable: whether the readings determine the result; if not, every figure is NOT_OBSERVABLE and export
        refused. warmth: temperatures of the readings, None if unknown; the bias then has no slope.
    """

    unit: str
    bias: tuple[float, ...]
    matrix: Matrix
    field: float
    absolute: bool
    covariance: Matrix | None
    dof: float
    method: str
    shape: str
    observable: bool
    warmth: Warmth | None = None

    @traced
    def correct(self, measured: ArrayLike, temperature: ArrayLike | None = None) -> NDArray[np.float64]:
        """Return fields (n, 3) for readings (n, 3), both in `unit`.

        Args:
            measured: readings (n, 3).
            temperature: sensor temperature in degC, shape (n,) or one for all; the reference temperature if None.
        """
        bias = np.array(self.bias)
        if temperature is not None and self.warmth is not None and self.warmth.drift is not None:
            warmer = np.asarray(temperature, dtype=np.float64) - self.warmth.reference
            bias = bias + np.multiply.outer(warmer, np.array(self.warmth.drift))
        return np.asarray((np.asarray(measured, dtype=np.float64) - bias) @ np.array(self.matrix).T)

    def directions(
        self, measured: ArrayLike, temperature: ArrayLike | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the field directions for readings (n, 3): azimuth about z in deg, and z of the unit vector, each (n,).

        A map of the two is equal-area. Arguments as for `correct`.
        """
        field = self.correct(measured, temperature)
        return np.degrees(np.arctan2(field[:, 1], field[:, 0])), field[:, 2] / np.sqrt(np.square(field).sum(axis=1))

    @property
    @traced
    def drifts(self) -> Mapping[str, Figure]:
        """Temperature coefficient of the bias by axis, per K; empty if not determined."""
        if self.warmth is None or self.warmth.drift is None or self.warmth.spread is None:
            return {}
        unit, pairs = f"{self.unit}/K", zip(AXES, self.warmth.drift, self.warmth.spread, strict=True)
        if not self.observable:
            return {axis: not_observable(unit, value) for axis, value, _ in pairs}
        return {axis: Figure(value=value, unit=unit, uncertainty=spread, dof=self.dof) for axis, value, spread in pairs}

    @property
    @traced
    def biases(self) -> Mapping[str, Figure]:
        """The bias by axis."""
        return {axis: self._figure(self.bias[place], self.unit, place) for place, axis in enumerate(AXES)}

    @property
    @traced
    def elements(self) -> Mapping[str, Figure]:
        """Matrix elements xx, yy, zz, xy, xz and yz by name."""
        return {
            AXES[row] + AXES[column]: self._figure(self.matrix[row][column], "1", place)
            for (row, column), place in _PLACES.items()
        }

    @property
    @traced
    def expected_field(self) -> Figure:
        """Magnitude of calibrated readings; exact where it was known."""
        return self._figure(self.field, self.unit, _FIELD)

    def _figure(self, value: float, unit: str, place: int) -> Figure:
        if not self.observable:
            return not_observable(unit, value)
        if self.covariance is None:
            return Figure(value=value, unit=unit)
        spread = math.sqrt(max(0.0, self.covariance[place][place]))
        spread = spread if spread > _ROUNDING * abs(value) else 0.0
        return Figure(value=value, unit=unit, uncertainty=spread, dof=self.dof if spread else math.inf)
