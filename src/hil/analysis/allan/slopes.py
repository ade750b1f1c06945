"""Nearest-slope read-out of noise coefficients: a legacy method, for comparison with tables made with it."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from hil.analysis.allan.results import AllanCurve
from hil.analysis.tracing import traced
from hil.model.figure import Figure

__all__ = ["nearest_slopes"]

_FLOOR = math.sqrt(2.0 * math.log(2.0) / math.pi)
_READ = {
    "quantisation": (-1.0, math.sqrt(3.0), 1.0, "{}*s"),
    "white": (-0.5, 1.0, 1.0, "{}/sqrt(Hz)"),
    "flicker": (0.0, 1.0, _FLOOR, "{}"),
    "random_walk": (0.5, 3.0, 1.0, "{}*sqrt(Hz)"),
    "ramp": (1.0, math.sqrt(2.0), 1.0, "{}/s"),
}
"""For each term: slope of the deviation, averaging time of the read-out, divisor, unit."""


@traced
def nearest_slopes(curve: AllanCurve) -> Mapping[str, Figure]:
    """Return the coefficients that tangents to a deviation read at the averaging times of IEEE Std 952 (legacy).

    A line with a term's slope is drawn through the point whose slope to the next one is nearest to it; it is read at
    sqrt(3) s (quantisation), 1 s (white noise), anywhere (flicker, over 0.664), 3 s (random walk) and sqrt(2) s (ramp).
    This is not a measurement: every term gets a number, even one that is absent from the record, and none has an
    uncertainty. A floor raised by white noise or random walk reads 20 to 30 % too high.

    Args:
        curve: an Allan deviation with at least two points above zero; with fewer, the numbers are NaN.
    """
    seen = curve.deviation > 0.0
    tau, deviation = np.log(curve.tau[seen]), np.log(curve.deviation[seen])
    found = {}
    for name, (slope, at, factor, unit) in _READ.items():
        value = math.nan
        if tau.size > 1:
            place = int(np.argmin(np.abs(np.diff(deviation) / np.diff(tau) - slope)))
            value = math.exp(float(deviation[place]) + slope * (math.log(at) - float(tau[place]))) / factor
        found[name] = Figure(value=value, unit=unit.format(curve.unit))
    return found
