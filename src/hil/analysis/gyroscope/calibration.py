"""Gyroscope calibration over temperature: rate = alignment · (scale(T) · (measured - bias(T)))."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.interchange import Matrix
from hil.analysis.tracing import traced
from hil.model.errors import Refused
from hil.model.figure import Figure, FigureStatus, effective_dof

__all__ = ["ALIGNED", "CalibratedRate", "Calibration", "Polynomial"]

_Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Polynomial:
    """Polynomial of temperature: c0 + c1 (T - reference) + c2 (T - reference)^2 + ...

    Attributes:
        coefficients: c0, c1..., each in `unit` per kelvin to its power.
        unit: unit of the value.
        reference: temperature at which the value is c0 [degC].
        low: lowest valid temperature [degC].
        high: highest valid temperature [degC].
        covariance: covariance of the coefficients, None if unknown.
        dof: degrees of freedom of the covariance, infinite where it is taken as exact.
    """

    coefficients: tuple[float, ...]
    unit: str
    reference: float
    low: float
    high: float
    covariance: tuple[tuple[float, ...], ...] | None = None
    dof: float = math.inf

    @property
    @traced
    def degree(self) -> int:
        """Degree of the polynomial, 0 for a constant."""
        return len(self.coefficients) - 1

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

    @traced
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


ALIGNED: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""Identity alignment, for axes whose misalignment was not measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibratedRate:
    """One axis: scale(T) · (measured - bias(T)).

    The bias is subtracted before scaling, because it is fitted to uncalibrated readings.

    Attributes:
        bias: reading at rest, in the unit of the readings.
        scale: true rate per bias-free reading, in unit 1.
    """

    bias: Polynomial
    scale: Polynomial

    @traced
    def correct(self, measured: ArrayLike, temperature: ArrayLike) -> _Array:
        """Return rates for readings at temperatures in degC; the two shapes broadcast.

        Raises:
            Refused: a temperature outside what was measured.
        """
        values = np.asarray(measured, dtype=np.float64)
        return np.asarray(self.scale.at(temperature) * (values - self.bias.at(temperature)), dtype=np.float64)

    @traced
    def figure(self, measured: Figure, temperature: float, temperature_uncertainty: float = 0.0) -> Figure:
        """Return the rate for one reading, with the combined uncertainty of reading, bias, scale and temperature.

        u^2 = s^2 (u_m^2 + u_b^2) + (m - b)^2 u_s^2 + (s' (m - b) - s b')^2 u_T^2, where ' is the change per kelvin
        (GUM 10). Unknown if one of them is unknown.

        Raises:
            Refused: the temperature is outside what was measured.
        """
        bias, scale = self.bias.figure(temperature), self.scale.figure(temperature)
        above = measured.value - bias.value
        drift = float(self.scale.slope(temperature)) * above - scale.value * float(self.bias.slope(temperature))
        value = scale.value * above
        if measured.uncertainty is None or bias.uncertainty is None or scale.uncertainty is None:
            return Figure(value=value, unit=measured.unit, status=measured.status)
        variances = [
            ((scale.value * measured.uncertainty) ** 2, measured.dof),
            ((scale.value * bias.uncertainty) ** 2, bias.dof),
            ((above * scale.uncertainty) ** 2, scale.dof),
            ((drift * temperature_uncertainty) ** 2, math.inf),
        ]
        return Figure(
            value=value,
            unit=measured.unit,
            uncertainty=math.sqrt(sum(variance for variance, _ in variances)),
            dof=effective_dof(variances),
            status=measured.status,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """All axes of one gyroscope.

    Attributes:
        unit: of readings and rates.
        axes: the axes by name, in the order of the matrix.
        alignment: matrix from scaled readings to rates about the table's axes.
        alignment_uncertainty: standard uncertainties of its elements, None if not measured.
        alignment_dof: the least of their degrees of freedom, infinite where taken as exact.
    """

    unit: str
    axes: Mapping[str, CalibratedRate]
    alignment: Matrix = ALIGNED
    alignment_uncertainty: Matrix | None = None
    alignment_dof: float = math.inf

    @property
    def low(self) -> float:
        """Lowest temperature valid for every part [degC]."""
        return max(part.low for axis in self.axes.values() for part in (axis.bias, axis.scale))

    @property
    def high(self) -> float:
        """Highest temperature valid for every part [degC]."""
        return min(part.high for axis in self.axes.values() for part in (axis.bias, axis.scale))

    @traced
    def as_it_is(self) -> Calibration:
        """Return the same equations without uncertainty, for determining their actual error."""
        axes = {
            name: CalibratedRate(bias=_exact(axis.bias), scale=_exact(axis.scale)) for name, axis in self.axes.items()
        }
        return replace(self, axes=axes, alignment_uncertainty=None, alignment_dof=math.inf)

    @traced
    def correct(self, measured: Mapping[str, ArrayLike], temperature: ArrayLike) -> dict[str, _Array]:
        """Return rates by axis for readings by axis, at temperatures in degC.

        Raises:
            Refused: an axis is missing, or a temperature is outside what was measured.
        """
        missing = [name for name in self.axes if name not in measured]
        if missing:
            raise Refused(f"no readings of axis {', '.join(missing)}", f"give all of {', '.join(self.axes)}")
        scaled = [axis.correct(measured[name], temperature) for name, axis in self.axes.items()]
        rows = [
            sum((share * each for share, each in zip(row, scaled, strict=True) if share), np.zeros_like(scaled[0]))
            for row in self.alignment
        ]
        return dict(zip(self.axes, rows, strict=True))

    @traced
    def figures(
        self, measured: Mapping[str, Figure], temperature: float, temperature_uncertainty: float = 0.0
    ) -> dict[str, Figure]:
        """Return rates by axis for one reading of all axes, each with its uncertainty.

        The rate r_i = sum_j a_ij f_j has u^2 = sum_j (a_ij u(f_j))^2 + (f_j u(a_ij))^2, with f_j as of
        `CalibratedRate.figure`. An alignment that was not measured contributes nothing.

        Raises:
            Refused: an axis is missing, or the temperature is outside what was measured.
        """
        missing = [name for name in self.axes if name not in measured]
        if missing:
            raise Refused(f"no readings of axis {', '.join(missing)}", f"give all of {', '.join(self.axes)}")
        scaled = [axis.figure(measured[name], temperature, temperature_uncertainty) for name, axis in self.axes.items()]
        spread = self.alignment_uncertainty or tuple(tuple(0.0 for _ in row) for row in self.alignment)
        rows = (
            _combined(row, errors, self.alignment_dof, scaled)
            for row, errors in zip(self.alignment, spread, strict=True)
        )
        return dict(zip(self.axes, rows, strict=True))


def _exact(polynomial: Polynomial) -> Polynomial:
    none = (0.0,) * len(polynomial.coefficients)
    return replace(polynomial, covariance=(none,) * len(none), dof=math.inf)


def _combined(row: tuple[float, ...], errors: tuple[float, ...], dof: float, scaled: list[Figure]) -> Figure:
    parts = [part for part in zip(row, errors, scaled, strict=True) if part[0] or part[1]]
    value = sum(share * figure.value for share, _, figure in parts)
    unit = scaled[0].unit
    status = next((figure.status for _, _, figure in parts if figure.status is not FigureStatus.MEASURED), None)
    variances: list[tuple[float, float]] = []
    for share, error, figure in parts:
        if figure.uncertainty is None:
            return Figure(value=value, unit=unit, status=status or FigureStatus.MEASURED)
        variances += [((share * figure.uncertainty) ** 2, figure.dof), ((error * figure.value) ** 2, dof)]
    return Figure(
        value=value,
        unit=unit,
        uncertainty=math.sqrt(sum(variance for variance, _ in variances)),
        dof=effective_dof(variances),
        status=status or FigureStatus.MEASURED,
    )
