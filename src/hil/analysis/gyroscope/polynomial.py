"""A polynomial of temperature that knows its covariance and where it was measured."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.model.errors import Refused
from hil.model.figure import Figure

__all__ = ["Polynomial"]

_Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Polynomial:
    """c0 + c1 (T - reference) + c2 (T - reference)^2 + ...

    Attributes:
        coefficients: c0, c1..., each in `unit` per kelvin to its power.
        unit: of the value.
        reference: temperature at which the value is c0, in degC.
        low: lowest temperature that was measured, in degC.
        high: highest temperature that was measured, in degC.
        covariance: of the coefficients, None where unknown.
        dof: degrees of freedom of the covariance, infinite where it is taken as exact.
    """

    coefficients: tuple[float, ...]
    unit: str
    reference: float
    low: float
    high: float
    covariance: tuple[tuple[float, ...], ...] | None = None
    dof: float = math.inf

    def at(self, temperature: ArrayLike) -> _Array:
        """Return the values at temperatures in degC, of the same shape.

        Raises:
            Refused: a temperature outside what was measured, or not a number.
        """
        return self._evaluated(self._inside(temperature), self.coefficients)

    def slope(self, temperature: ArrayLike) -> _Array:
        """Return the change of the value per kelvin at temperatures in degC.

        Raises:
            Refused: a temperature outside what was measured, or not a number.
        """
        powers = range(1, len(self.coefficients))
        return self._evaluated(self._inside(temperature), tuple(k * self.coefficients[k] for k in powers) or (0.0,))

    def figure(self, temperature: float) -> Figure:
        """Return the value at a temperature in degC with its standard uncertainty.

        Raises:
            Refused: a temperature outside what was measured, or not a number.
        """
        value = float(self.at(temperature))
        uncertainty = None
        if self.covariance is not None:
            powers = (temperature - self.reference) ** np.arange(len(self.coefficients))
            uncertainty = math.sqrt(max(0.0, float(powers @ np.asarray(self.covariance) @ powers)))
        return Figure(value=value, unit=self.unit, uncertainty=uncertainty, dof=self.dof)

    def _inside(self, temperature: ArrayLike) -> _Array:
        values = np.asarray(temperature, dtype=np.float64)
        outside = values[~((values >= self.low) & (values <= self.high))]
        if outside.size:
            raise Refused(
                f"{outside.flat[0]:g} degC is outside the calibration, which holds from {self.low:g} to {self.high:g}",
                "calibrate over a wider range; nothing is extrapolated",
            )
        return values

    def _evaluated(self, temperature: _Array, coefficients: tuple[float, ...]) -> _Array:
        result = np.full(temperature.shape, coefficients[-1])
        for coefficient in reversed(coefficients[:-1]):
            result = result * (temperature - self.reference) + coefficient
        return result
