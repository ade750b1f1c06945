"""Model of an illuminated junction with a load: currents, load voltage, and their temperature dependence.

With load R, series resistance Rs, shunt conductance G, light m, junction at V_j = V (1 + Rs/R), V_T = k T / q:

(1) V/R = I_ph - I_d - G V_j
(2) I_ph = P m (1 + a (T - T0))
(3) I_d = I_s(T) (exp(V_j / (n V_T)) - 1)
(4) I_s(T) = I_s0 (T/T0)^(3/n) exp(E_g/(n k) (1/T0 - 1/T))
(5) dI_d/dT at constant V_j = I_s(T) ((e - 1) (3/(n T) + E_g/(n k T^2)) - e V_j/(n V_T T)), e = exp(V_j / (n V_T))
(6) dV/dT at constant light = (a P m - dI_d/dT) / D, D = 1/R + (1 + Rs/R) (G + e I_s(T)/(n V_T))

Sources: S. M. Sze and K. K. Ng, Physics of Semiconductor Devices, 3rd ed. (2007), chapters 2 and 13, for (1) and (3);
SPICE's diode (IS, N, XTI = 3, EG, TNOM) for (4), where n divides both exponents; (5) and (6) by differentiation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.tracing import traced

__all__ = ["ELECTRONVOLTS", "KELVIN", "SILICON", "Diode", "Linearised"]

Array: TypeAlias = NDArray[np.float64]

ELECTRONVOLTS = 8.617333262e-5
"""Boltzmann's constant in eV/K, and k/q in V/K (exact in the SI, ten digits)."""

KELVIN = 273.15
"""0 degC in K."""

SILICON = 1.12
"""Energy gap of silicon in eV."""

_STEPS, _SETTLED = 60, 1e-13


@dataclass(frozen=True, slots=True, kw_only=True)
class Linearised:
    """Voltages (n,) of the model, and their derivatives, each (n,).

    Attributes:
        voltage: load voltages [V].
        jacobian: (7, n), with respect to ln P, a, ln I_s0, n, E_g, G and Rs.
        by_load: with respect to ln R.
        by_temperature: with respect to temperature, equation 6 [V/K].
    """

    voltage: Array
    jacobian: Array
    by_load: Array
    by_temperature: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Diode:
    """One photodiode.

    Attributes:
        photocurrent: P, photocurrent at the nominal temperature and light 1 [A].
        coefficient: a, temperature coefficient of the photocurrent [1/K].
        saturation: I_s0, saturation current at the nominal temperature [A].
        ideality: n, ideality factor.
        nominal: T0, nominal temperature [degC].
        gap: E_g, energy gap [eV].
        shunt: G, shunt conductance [S].
        series: Rs, series resistance [ohm].
    """

    photocurrent: float
    coefficient: float
    saturation: float
    ideality: float
    nominal: float = 25.0
    gap: float = SILICON
    shunt: float = 0.0
    series: float = 0.0

    @traced
    def saturation_at(self, temperature: ArrayLike) -> Array:
        """Return I_s(T) in A, equation 4, at temperatures in degC, of their shape."""
        return self.saturation * np.exp(self._growth(_kelvin(temperature)))

    @traced
    def light_of(self, voltage: ArrayLike, temperature: ArrayLike, load: ArrayLike) -> Array:
        """Return the calibrated reading: the photocurrent in A of this light at the nominal temperature, shape (n,).

        Equations 1 to 3 solved for P m, in closed form.

        Args:
            voltage: voltage across the load in V, shape (n,) or a number, as all others.
            temperature: junction temperature in degC.
            load: load resistance in ohm.
        """
        volts, kelvin, ohms = np.asarray(voltage, dtype=np.float64), _kelvin(temperature), np.asarray(load, dtype=float)
        junction = volts * (1.0 + self.series / ohms)
        diode = self.saturation_at(temperature) * np.expm1(junction / self._slope(kelvin))
        return np.asarray((volts / ohms + diode + self.shunt * junction) / self._warmed(kelvin))

    @traced
    def voltage_of(self, light: ArrayLike, temperature: ArrayLike, load: ArrayLike) -> Array:
        """Return the load voltage in V, equation 1, shape (n,), by Newton's method from above, which never overshoots.

        Args:
            light: m, dimensionless; shape (n,) or a number, as all others.
            temperature: junction temperature in degC.
            load: load resistance in ohm.
        """
        kelvin, ohms = _kelvin(temperature), np.asarray(load, dtype=np.float64)
        factor, slope, saturation = 1.0 + self.series / ohms, self._slope(kelvin), self.saturation_at(temperature)
        given = self.photocurrent * np.asarray(light, dtype=np.float64) * self._warmed(kelvin)
        linear = 1.0 / ohms + self.shunt * factor
        volts = np.minimum(given / linear, slope / factor * np.log1p(np.maximum(given, 0.0) / saturation))
        for _ in range(_STEPS):
            rising = saturation * np.exp(factor * volts / slope)
            step = (volts * linear + rising - saturation - given) / (linear + rising * factor / slope)
            volts = volts - step
            if np.all(np.abs(step) <= _SETTLED):
                break
        return np.asarray(volts)

    @traced
    def diode_coefficient(self, voltage: ArrayLike, temperature: ArrayLike) -> Array:
        """Return the relative temperature coefficient of I_d at constant junction voltage, in 1/K: (5) / (3).

        Without the 1 in equation 3 this is 3/(n T) + (E_g - V_j)/(n k T^2).

        Args:
            voltage: junction voltage in V, above zero; any shape.
            temperature: temperature in degC.
        """
        kelvin, volts = _kelvin(temperature), np.asarray(voltage, dtype=np.float64)
        exponent = volts / self._slope(kelvin)
        grown = 3.0 / (self.ideality * kelvin) + self.gap / (self.ideality * ELECTRONVOLTS * kelvin**2)
        return np.asarray(grown - exponent / kelvin / -np.expm1(-exponent))

    @traced
    def sensitivity(self, light: ArrayLike, temperature: ArrayLike, load: ArrayLike) -> Array:
        """Return the temperature sensitivity of the load voltage in constant light, in V/K, (n,): equation 6."""
        return self.linearised(light, temperature, load).by_temperature

    def linearised(self, light: ArrayLike, temperature: ArrayLike, load: ArrayLike) -> Linearised:
        """Return voltages and derivatives; arguments as for `voltage_of`."""
        kelvin, ohms = _kelvin(temperature), np.asarray(load, dtype=np.float64)
        volts = self.voltage_of(light, temperature, load)
        factor, slope, saturation = 1.0 + self.series / ohms, self._slope(kelvin), self.saturation_at(temperature)
        junction, plain = factor * volts, self.photocurrent * np.asarray(light, dtype=np.float64)
        exponent = junction / slope
        rising, diode = saturation * np.exp(exponent), saturation * np.expm1(exponent)
        steep = 1.0 / ohms + factor * (self.shunt + rising / slope)
        growth, warmer = self._growth(kelvin), kelvin - self.nominal - KELVIN
        grown = 3.0 / (self.ideality * kelvin) + self.gap / (self.ideality * ELECTRONVOLTS * kelvin**2)
        by_temperature = self.coefficient * plain - (diode * grown - rising * exponent / kelvin)
        rows = (
            plain * self._warmed(kelvin),
            plain * warmer,
            -diode,
            (diode * growth + rising * exponent) / self.ideality,
            -diode * (1.0 / (self.nominal + KELVIN) - 1.0 / kelvin) / (self.ideality * ELECTRONVOLTS),
            -junction,
            -(self.shunt + rising / slope) * volts / ohms,
        )
        return Linearised(
            voltage=volts,
            jacobian=np.stack([np.broadcast_to(row, volts.shape) for row in rows]) / steep,
            by_load=(volts / ohms + (junction - volts) * (self.shunt + rising / slope)) / steep,
            by_temperature=np.asarray(by_temperature / steep),
        )

    def _slope(self, kelvin: Array) -> Array:
        return self.ideality * ELECTRONVOLTS * kelvin

    def _warmed(self, kelvin: Array) -> Array:
        return 1.0 + self.coefficient * (kelvin - self.nominal - KELVIN)

    def _growth(self, kelvin: Array) -> Array:
        """Return ln(I_s(T) / I_s0)."""
        nominal = self.nominal + KELVIN
        power = 3.0 * np.log(kelvin / nominal)
        return np.asarray((power + self.gap / ELECTRONVOLTS * (1.0 / nominal - 1.0 / kelvin)) / self.ideality)


def _kelvin(celsius: ArrayLike) -> Array:
    return np.asarray(celsius, dtype=np.float64) + KELVIN
