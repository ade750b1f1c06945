"""The read-out by nearest slopes: a legacy method, only for comparison with tables that were made with it."""

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
"""Of each term: slope of the deviation, averaging time of the read-out, what is divided by, unit."""


@traced
def nearest_slopes(curve: AllanCurve) -> Mapping[str, Figure]:
    """Return the tangent read-out of a deviation at the averaging times of IEEE Std 952: legacy, not a measurement.

    At the point whose slope to the next one is nearest to that of a term, a line of exactly this slope is drawn through
    the deviation; it is read at sqrt(3) s (quantisation), 1 s (white noise), anywhere (flicker, over 0.664), 3 s
    (random walk) and sqrt(2) s (ramp). Every term gets a number, even one that is not in the record; none has an
    uncertainty. A floor raised by white noise or random walk reads 20 to 30 % too high.

    Args:
        curve: an Allan deviation, with two points above zero or more; with fewer, the numbers are NaN.
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
