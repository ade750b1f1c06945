"""Local fits to a current-voltage curve: near short circuit, near open circuit, and around maximum power.

Following ASTM E1036-15. From open circuit to the knee the single-diode equation is fitted,
V = Voc + a ln(1 - (I + g (V - Voc)) / (Isc - g Voc)) - Rs I with g the shunt conductance, which is linear in Voc, a and
Rs. Around the maximum, power is a polynomial of voltage; of degree 5, because degree 4 misses a sharp knee by 0.05 %.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hil.model.figure import effective_dof

__all__ = ["AROUND", "ISC", "PMAX", "RESISTANCES", "UNITS", "VOC", "Array", "Estimates", "estimated"]

Array: TypeAlias = NDArray[np.float64]

UNITS: Mapping[str, str] = {
    "short_circuit_current": "A",
    "open_circuit_voltage": "V",
    "maximum_power": "W",
    "voltage_at_maximum": "V",
    "current_at_maximum": "A",
    "fill_factor": "1",
    "series_resistance": "ohm",
    "shunt_conductance": "S",
}
"""The figures of a curve with their units."""

ISC, VOC, PMAX, _VMP, _IMP, _FF, _RS, _SHUNT = range(len(UNITS))
RESISTANCES = slice(_RS, _SHUNT + 1)

AROUND = 0.90
"""Share of the maximum power above which points count as around it."""

_NEAR_SHORT, _NEAR_OPEN, _TO_KNEE = 0.2, 0.5, 0.9  # of open voltage, and of short-circuit current
_BEYOND = 0.3  # of short-circuit current that may flow into the cell; the equation holds there, too
_DEGREE = 5
_FEWEST_SHORT, _FEWEST_OPEN, _FEWEST_KNEE, _FEWEST_SIDE = 3, 5, 8, 2


@dataclass(slots=True)
class Estimates:
    """Values in the order of `UNITS`, NaN where there are too few points, with variances from scatter.

    Attributes:
        values, variances, dofs: one number per figure.
        sides: number of points around the maximum below and above it.
        rough: rms residual of the power polynomial, relative to the maximum.
    """

    values: Array = field(default_factory=lambda: np.full(len(UNITS), math.nan))
    variances: Array = field(default_factory=lambda: np.full(len(UNITS), math.nan))
    dofs: Array = field(default_factory=lambda: np.full(len(UNITS), math.inf))
    sides: tuple[int, int] = (0, 0)
    rough: float = math.nan

    def put(self, place: int, value: float, variance: float, dof: float) -> None:
        """Set one figure."""
        self.values[place], self.variances[place], self.dofs[place] = value, variance, dof


def estimated(voltage: Array, current: Array) -> Estimates:
    """Return the figures of points, (n,) in V and A, voltage ascending."""
    found = Estimates()
    if not ((voltage > 0.0) & (current > 0.0)).any():
        return found
    short, slope = voltage <= _NEAR_SHORT * voltage.max(), 0.0
    if int(short.sum()) >= _FEWEST_SHORT:
        line, covariance, _, dof = _fitted(np.vander(voltage[short], 2, increasing=True), current[short])
        found.put(ISC, line[0], covariance[0, 0], dof)
        found.put(_SHUNT, -line[1], covariance[1, 1], dof)
        slope = max(0.0, -float(line[1]))
    source = found.values[ISC] if found.values[ISC] > 0.0 else float(current.max())
    _near_open(found, voltage, current, source, slope)
    _around_maximum(found, voltage, current)
    three = [ISC, VOC, PMAX]
    isc, voc, power = found.values[three]
    if isc > 0.0 and voc > 0.0:
        # The fits use disjoint points, so their scatter is independent.
        shares = found.variances[three] / np.square(found.values[three])
        dof = effective_dof(zip(shares.tolist(), found.dofs[three].tolist(), strict=True))
        ratio = power / (isc * voc)
        found.put(_FF, ratio, float(shares.sum()) * ratio**2, dof)
    return found


def _near_open(found: Estimates, voltage: Array, current: Array, source: float, slope: float) -> None:
    highest = float(voltage.max())
    diode = 1.0 - (current + slope * (voltage - highest)) / (source - slope * highest)
    for place, column, below in ((VOC, 0, _NEAR_OPEN), (_RS, 2, _TO_KNEE)):
        used = (current <= below * source) & (current > -_BEYOND * source) & (diode > (1.0 - below) / 2.0)
        if int(used.sum()) < _FEWEST_OPEN or float(np.ptp(current[used])) < below / 3.0 * source:
            continue
        design = np.column_stack([np.ones(int(used.sum())), np.log(diode[used]), -current[used]])
        solved, covariance, _, dof = _fitted(design, voltage[used])
        found.put(place, solved[column], covariance[column, column], dof)


def _around_maximum(found: Estimates, voltage: Array, current: Array) -> None:
    """Find the maximum of the polynomial, propagating its scatter to voltage and current by their gradients."""
    power = voltage * current
    top = int(np.argmax(power))
    used = (power >= AROUND * power[top]) & (current > 0.0)
    found.sides = int((used & (voltage < voltage[top])).sum()), int((used & (voltage > voltage[top])).sum())
    if int(used.sum()) < _FEWEST_KNEE or min(found.sides) < _FEWEST_SIDE:
        return
    middle, half = float(voltage[used].mean()), float(np.ptp(voltage[used])) / 2.0
    place = (voltage[used] - middle) / half
    solved, covariance, spread, dof = _fitted(np.vander(place, _DEGREE + 1, increasing=True), power[used])
    polynomial = np.polynomial.Polynomial(solved)
    bend = polynomial.deriv(2)
    flat = [each.real for each in polynomial.deriv().roots() if abs(each.imag) < 1e-9 and abs(each.real) <= 1.0]
    peaks = [float(each) for each in flat if bend(each) < 0.0]
    if not peaks:
        return
    peak = max(peaks, key=polynomial)
    powers = np.arange(_DEGREE + 1)
    best, volts = float(polynomial(peak)), middle + half * peak
    of_power = peak**powers
    of_volts = -half * powers * np.concatenate([[0.0], peak ** powers[:-1]]) / bend(peak)
    of_amperes = of_power / volts - best / volts**2 * of_volts
    found.rough = math.sqrt(spread) / best
    values = ((PMAX, best, of_power), (_VMP, volts, of_volts), (_IMP, best / volts, of_amperes))
    for where, value, gradient in values:
        found.put(where, value, float(gradient @ covariance @ gradient), dof)


def _fitted(design: Array, values: Array) -> tuple[Array, Array, float, float]:
    """Return solution, covariance, residual variance and degrees of freedom of a least-squares fit."""
    inverse = np.asarray(np.linalg.pinv(design), dtype=np.float64)
    solved = inverse @ values
    dof = max(1, values.size - design.shape[1])
    spread = float(np.square(values - design @ solved).sum()) / dof
    return solved, spread * (inverse @ inverse.T), spread, float(dof)
