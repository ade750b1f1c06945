"""Gates on the noise of a channel: resolution, aliasing, and agreement with the data sheet."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hil.analysis.allan.deviation import deviation
from hil.analysis.quality.gate import Facts, Gate
from hil.model.errors import Refused

__all__ = ["FACTORS", "aliased", "density", "density_agrees", "resolved"]

FACTORS = {
    180.0 / math.pi: "degrees and radians",
    9.80665: "g and m/s^2",
    1000.0: "milli, and none",
    math.sqrt(2.0): "one-sided and two-sided densities",
}
"""Factors by which a density is off when two things were taken for each other."""

_LOWEST, _HIGHEST = 0.5, 3.0  # of the data sheet's density: what scatter of parts and settings explains
_NEAR = 1.3  # factor within which a wrong density is told as one of FACTORS
_ROOT = 1.05  # the same for the root of two, which the scatter of parts explains as well
_RESOLVED = 0.5  # counts: with less noise than this the step is no longer white noise of q^2 / 12


def resolved(channel: str, values: NDArray[np.float64], facts: Facts) -> Gate:
    """Trip where the noise before the quantiser is below half a count.

    Then the noise of the readings does not follow sqrt(s^2 + q^2 / 12) any more, may vanish, and averaging does not
    help. s is taken from differences of neighbours, so that drift does not count as noise.
    """
    if facts.lsb is None:
        return Gate(name="resolved", channel=channel, ok=None, reason="what one count is worth is not known")
    steps = np.diff(values)
    steps = steps[np.isfinite(steps)]
    if not steps.size:
        return Gate(name="resolved", channel=channel, ok=None, reason="no two samples follow each other")
    scatter = math.sqrt(float(np.square(steps).mean()) / 2.0) / facts.lsb
    least = math.sqrt(_RESOLVED**2 + 1.0 / 12.0)
    reason = f"neighbours scatter by {scatter:.2g} counts, and {least:.2g} are needed"
    return Gate(name="resolved", channel=channel, ok=scatter >= least, reason=reason)


def aliased(rate: float, facts: Facts) -> Gate:
    """Trip where the sensor lets frequencies above half of the sampling rate through: their noise adds to the density.

    White noise rises by sqrt(2 bandwidth / rate).
    """
    if facts.bandwidth is None:
        return Gate(name="aliased", channel="", ok=None, reason="the sensor's bandwidth is not known")
    if facts.bandwidth <= rate / 2.0:
        reason = f"the bandwidth, {facts.bandwidth:g} Hz, is within half of the rate, {rate:.4g} Hz"
        return Gate(name="aliased", channel="", ok=True, reason=reason)
    reason = (
        f"the bandwidth, {facts.bandwidth:g} Hz, is beyond half of the rate, {rate:.4g} Hz: "
        f"white noise is folded in and reads up to {math.sqrt(2.0 * facts.bandwidth / rate):.2g} times too large"
    )
    return Gate(name="aliased", channel="", ok=False, reason=reason)


def density(values: NDArray[np.float64], rate: float) -> float:
    """Return the density of white noise as the Allan deviation near 1 s tells it: sigma sqrt(tau), per root of a hertz.

    NaN where the record tells none. A record below 4 s is read at its longest averaging time.
    """
    try:
        curve = deviation(values, rate, [_second(values.size, rate)], holes=True)
    except Refused:
        return math.nan
    return float(curve.deviation[0] * math.sqrt(curve.tau[0]))


def _second(samples: int, rate: float) -> float:
    return max(1.0, min(round(rate), samples // 4)) / rate


def density_agrees(channel: str, measured: float, facts: Facts) -> Gate:
    """Trip where the density is not within 0.5 and 3 times that of the data sheet; name the factor if it is known.

    The root of two lies within; it is named in the reason only.
    """
    name = "density"
    if facts.noise_density is None or not math.isfinite(measured):
        return Gate(name=name, channel=channel, ok=None, reason="the density, or that of the data sheet, is not known")
    ratio = measured / facts.noise_density
    ok = _LOWEST <= ratio <= _HIGHEST
    known = _known(ratio)
    reason = f"{measured:.3g} per root of a hertz, {ratio:.3g} times that of the data sheet"
    return Gate(name=name, channel=channel, ok=ok, reason=f"{reason}: {known}" if known else reason)


def _known(ratio: float) -> str:
    for factor, meaning in FACTORS.items():
        near = _ROOT if factor < _HIGHEST else _NEAR
        for candidate, shown in ((factor, f"{factor:.4g}"), (1.0 / factor, f"1/{factor:.4g}")):
            if ratio > 0.0 and abs(math.log(ratio / candidate)) <= math.log(near):
                return f"near {shown}, as when {meaning} are mixed up"
    return ""
