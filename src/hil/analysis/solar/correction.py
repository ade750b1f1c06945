"""Correction of current-voltage curves to other conditions by IEC 60891:2021, procedures 1 and 2."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hil.analysis.solar.fits import ISC, VOC, Array, estimated
from hil.analysis.statistics import root_sum_square
from hil.analysis.tracing import traced
from hil.model.figure import Figure

__all__ = ["COEFFICIENTS", "IvConditions", "corrected", "reference_irradiance"]

COEFFICIENTS = ("alpha", "beta", "resistance", "kappa", "light")
"""The correction coefficients among the attributes of `IvConditions`."""

_NONE = Figure(value=0.0, unit="1", uncertainty=0.0)
_LOW = 0.2  # of the highest voltage: below it the current is the short-circuit current
_TURNS = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class IvConditions:
    """Target conditions of a correction, and its coefficients, stated at these conditions.

    Attributes:
        irradiance: target irradiance [W/m^2].
        temperature: target temperature [degC].
        procedure: procedure of IEC 60891:2021, 1 or 2.
        alpha: temperature coefficient of short-circuit current: [A/K] for procedure 1, relative [1/K] for procedure 2.
        beta: temperature coefficient of open-circuit voltage: [V/K] for procedure 1, relative [1/K] for procedure 2.
        resistance: internal series resistance [ohm].
        kappa: curve correction factor [ohm/K].
        light: B1, relative change of the open-circuit voltage over ln(irradiance) [1]; for procedure 2.
    """

    irradiance: float
    temperature: float
    procedure: Literal[1, 2] = 2
    alpha: Figure = _NONE
    beta: Figure = _NONE
    resistance: Figure = _NONE
    kappa: Figure = _NONE
    light: Figure = _NONE


def corrected(measured: Array, conditions: IvConditions | None) -> tuple[Array, Array]:
    """Return voltage [V] and current [A], (n,) each, corrected point by point from its irradiance and temperature.

    With 1 for measured and 2 for the target, procedure 1 is I2 = I1 + Isc1 (G2/G1 - 1) + alpha (T2 - T1) and
    V2 = V1 - Rs (I2 - I1) - kappa I2 (T2 - T1) + beta (T2 - T1); Isc1 is proportional to G1. Procedure 2, with B2 = 0
    and coefficients that hold at the conditions, is I2 = I1 (G2/G1) / (1 + alpha (T1 - T2)) and
    V2 = V1 - (Rs + kappa (T1 - T2)) (I2 - I1) - kappa I2 (T2 - T1) + Voc2 (beta f (T2 - T1) + 1 - 1/f) with
    f = 1 + B1 ln(G2/G1); Voc2 is found by repetition.

    Args:
        measured: voltage [V], current [A], irradiance [W/m^2] and temperature [degC], shape (4, n), voltage ascending.
        conditions: target conditions; None for no correction. Without light there is no correction either.
    """
    voltage, current, light, warmth = measured
    if conditions is None or not voltage.size or not (light > 0.0).all():
        return voltage, current
    alpha, beta, ohms, kappa, bend = (getattr(conditions, name).value for name in COEFFICIENTS)
    kelvin, ratio = conditions.temperature - warmth, conditions.irradiance / light
    if conditions.procedure == 1:
        short = voltage <= max(voltage[0], _LOW * voltage[-1])
        per_light = estimated(voltage, current).values[ISC] / light[short].mean()
        raised = current + per_light * (conditions.irradiance - light) + alpha * kelvin
        return voltage - ohms * (raised - current) - kappa * raised * kelvin + beta * kelvin, raised
    raised = current * ratio / (1.0 - alpha * kelvin)
    factor = 1.0 + bend * np.log(ratio)
    moved = voltage - (ohms - kappa * kelvin) * (raised - current) - kappa * raised * kelvin
    change = beta * factor * kelvin + 1.0 - 1.0 / factor
    shifted = voltage
    for _ in range(_TURNS):
        open_voltage = float(estimated(shifted, raised).values[VOC])
        shifted = moved + (open_voltage if math.isfinite(open_voltage) else float(voltage[-1])) * change
    return shifted, raised


@traced
def reference_irradiance(current: Figure, temperature: Figure, sensitivity: Figure, coefficient: Figure) -> Figure:
    """Return the irradiance [W/m^2] measured by a reference cell: G = I / (s (1 + a (T - 25 degC))).

    Source: IEC 60904-1:2020.

    Args:
        current: short-circuit current [A].
        temperature: temperature of the reference cell [degC].
        sensitivity: s at 25 degC [A.m^2/W]; its uncertainty should include spectral mismatch to the cell under test.
        coefficient: temperature coefficient a [1/K].
    """
    kelvin = temperature.value - 25.0
    gain = sensitivity.value * (1.0 + coefficient.value * kelvin)
    value = current.value / gain
    per_warmth = value * sensitivity.value / gain
    uncertainty, dof = root_sum_square(
        (
            (1.0 / gain, current),
            (value / sensitivity.value, sensitivity),
            (per_warmth * coefficient.value, temperature),
            (per_warmth * kelvin, coefficient),
        )
    )
    return Figure(value=value, unit="W/m^2", uncertainty=uncertainty, dof=dof)
