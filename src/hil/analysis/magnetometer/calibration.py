"""A calibration of a magnetometer: field = matrix · (measured - bias)."""

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

__all__ = ["AXES", "IDENTIFIABLE", "Calibration"]

AXES = ("x", "y", "z")
"""The axes of the sensor, in the order of every vector."""

IDENTIFIABLE = (
    "magnitudes of the field fix only the symmetric positive-definite factor of the distortion: a rotation or a "
    "reflection (a mounting angle, swapped axes, an axis of the wrong sign) changes no magnitude and stays unknown; "
    "known attitudes or another sensor must show it"
)
"""What no calibration without attitudes can tell."""

_PLACES = {(0, 0): 3, (1, 1): 4, (2, 2): 5, (0, 1): 6, (0, 2): 7, (1, 2): 8}
_FIELD = 9
_ROUNDING = 1e-12  # of a value: what is certain by construction is not known any better


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """Bias and matrix of one magnetometer.

    Attributes:
        unit: of readings, bias and field.
        bias: reading without a field, in `unit`.
        matrix: symmetric and positive definite, without a unit; of determinant 1 where the field is not known.
        field: magnitude of calibrated readings in `unit`: the mean of the known ones, or the expected field that the
            matrix of determinant 1 gives.
        absolute: whether the magnitude of the field was known, so that the matrix holds the scale as well.
        covariance: (10, 10), of bias, of the elements xx, yy, zz, xy, xz, yz of the matrix, and of the field; None if
            unknown.
        dof: degrees of freedom of the covariance.
        method: `ellipsoid`, `likelihood` or `twostep`.
        shape: `sphere`, `aligned` or `general`.
        observable: whether the readings show the numbers; where not, every figure says so and nothing is exported.
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

    @traced
    def correct(self, measured: ArrayLike) -> NDArray[np.float64]:
        """Return fields (n, 3) for readings (n, 3), both in `unit`."""
        return np.asarray((np.asarray(measured, dtype=np.float64) - self.bias) @ np.array(self.matrix).T)

    @property
    def biases(self) -> Mapping[str, Figure]:
        """The bias by axis."""
        return {axis: self._figure(self.bias[place], self.unit, place) for place, axis in enumerate(AXES)}

    @property
    def elements(self) -> Mapping[str, Figure]:
        """The matrix by its elements xx, yy, zz, xy, xz and yz."""
        return {
            AXES[row] + AXES[column]: self._figure(self.matrix[row][column], "1", place)
            for (row, column), place in _PLACES.items()
        }

    @property
    def expected_field(self) -> Figure:
        """The magnitude of calibrated readings; exact where it was known."""
        return self._figure(self.field, self.unit, _FIELD)

    def _figure(self, value: float, unit: str, place: int) -> Figure:
        if not self.observable:
            return not_observable(unit, value)
        if self.covariance is None:
            return Figure(value=value, unit=unit)
        spread = math.sqrt(max(0.0, self.covariance[place][place]))
        spread = spread if spread > _ROUNDING * abs(value) else 0.0
        return Figure(value=value, unit=unit, uncertainty=spread, dof=self.dof if spread else math.inf)
