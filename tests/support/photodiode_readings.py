"""Readings of a photodiode that are computed without the library: SciPy's Lambert function solves the circuit."""

from __future__ import annotations

import numpy as np
from scipy.special import lambertw

__all__ = ["FULL_SCALE", "HELD", "LOADS", "TRUTH", "campaign", "solved"]

TRUTH = {"photocurrent": 45e-6, "coefficient": 1.2e-3, "saturation": 1e-9, "ideality": 1.25, "gap": 1.12}
LOADS = (20e3, 5.82e3, 2.83e3)
FULL_SCALE = 3.3
HELD = 300
_K_OVER_Q = 1.380649e-23 / 1.602176634e-19  # exact in the SI


def solved(light, celsius, load, *, shunt=0.0, series=0.0, **truth):
    """Voltage at the load, of a junction in closed form (Jain and Kapoor 2004, with a load for the terminals)."""
    part = {**TRUTH, **truth}
    kelvin = np.asarray(celsius, dtype=float) + 273.15
    n, vt = part["ideality"], _K_OVER_Q * kelvin
    warm = (kelvin / 298.15) ** (3 / n) * np.exp(part["gap"] / (n * _K_OVER_Q) * (1 / 298.15 - 1 / kelvin))
    saturation = part["saturation"] * warm
    given = part["photocurrent"] * np.asarray(light) * (1 + part["coefficient"] * (kelvin - 298.15))
    conductance = 1 / (np.asarray(load) + series) + shunt  # as the junction sees it
    inner = (given + saturation) / conductance
    argument = saturation / (conductance * n * vt) * np.exp(inner / (n * vt))
    junction = inner - n * vt * lambertw(argument).real
    return junction * np.asarray(load) / (np.asarray(load) + series)


def campaign(seed, *, count=1500, errors=(0.0, 0.0, (0.0, 0.0, 0.0), 0.0), monitor=0.002, **truth):
    """Three loads at 16 degC, 15 to 35 degC at the first, three loads at 35 degC, and cooling, which is not fitted.

    Args:
        seed: of the noise.
        count: readings of the heating, and of the cooling.
        errors: relative of the reference, of the zero [V], relative of each load, and of the thermometer [K].
        monitor: how much the lamp's light wanders, relative.
        truth: what else than `TRUTH`.

    Returns:
        Voltage, temperature, load, light, and whether it is fitted.
    """
    generator = np.random.default_rng(seed)
    reference, zero, loads, warmer = errors
    legs = ((16, 16.4, HELD), (15, 35, count), (35, 34.6, HELD), (35, 15, count))
    degrees = np.concatenate([np.linspace(*leg) for leg in legs])
    held, swept = np.repeat([0, 1, 2], HELD // 3), np.zeros(count, dtype=int)
    which = np.concatenate([held, swept, held, swept])
    light = 1.0 + monitor * np.sin(np.arange(degrees.size) / 300.0)
    truly = np.array(LOADS) * (1.0 + np.array(loads))
    counts = solved(light, degrees, truly[which], **truth) / FULL_SCALE * 4095.0
    read = np.rint(counts[:, None] + 0.6 * generator.standard_normal((degrees.size, 16))).mean(axis=1)
    volts = read / 4095.0 * FULL_SCALE * (1.0 + reference) + zero
    return volts, degrees + warmer, np.array(LOADS)[which], light, np.arange(degrees.size) < degrees.size - count
