"""Gates on a current-voltage curve: plausibility checks of a sweep."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hil.analysis.gates import Gate, factor_of
from hil.analysis.solar.correction import IvConditions
from hil.analysis.solar.fits import AROUND, ISC, PMAX, VOC, Array, Estimates

__all__ = ["IvFacts", "ask"]

_DRIFT, _OTHER_LAMP = 0.02, 0.08
_REACH = 0.10  # of open-circuit voltage or short-circuit current that may be extrapolated
_FARTHEST = {1: 0.2, 2: 0.4}  # by procedure: the largest correction of the irradiance
_WARMEST_K = 40.0
_CLIPPED = 5
_ROUGH = 0.005  # of the maximum power
_PARTS = 3  # parts of a sweep whose means are compared for drift


@dataclass(frozen=True, slots=True, kw_only=True)
class IvFacts:
    """Prior knowledge of cell and lamp; None where unknown.

    Attributes:
        current: short-circuit current of the data sheet [A].
        voltage: open-circuit voltage of the data sheet [V].
        irradiance: irradiance of this lamp at this position, from an earlier survey [W/m^2].
        drift: tolerated relative change of irradiance within one sweep.
    """

    current: float | None = None
    voltage: float | None = None
    irradiance: float | None = None
    drift: float = _DRIFT


def ask(
    measured: Array, shown: tuple[Array, Array], found: Estimates, conditions: IvConditions | None, facts: IvFacts
) -> Iterator[Gate]:
    """Yield the gates of one sweep.

    Args:
        measured: see `hil.analysis.solar.correction.corrected`; at least one point.
        shown: voltage and current as corrected.
        found: the figures.
        conditions: target conditions.
        facts: prior knowledge.
    """
    voltage, current, light, warmth = measured
    yield _sign(voltage, current)
    for name, value, expected in (("voltage", voltage, facts.voltage), ("current", current, facts.current)):
        mixed = factor_of(float(value.max()) / expected) if expected else ""
        if mixed:
            said = f"the largest is {value.max():.3g} where {expected:.3g} is expected, {mixed}"
            yield Gate(name="unit", channel=name, ok=False, reason=said)
    equal = int((current >= current.max() * (1.0 - 1e-9)).sum())
    said = f"{equal} points read the largest current" if equal > 1 else "no two points read the largest current"
    yield Gate(name="saturated", channel="current", ok=equal < _CLIPPED, reason=said)
    yield from _ends(shown, found)
    known = math.isfinite(found.values[PMAX])
    said = "{} points below the largest power and {} above it are within {:.0%} of it"
    yield Gate(name="knee", channel="", ok=known, reason=said.format(*found.sides, 1.0 - AROUND))
    if known:
        said = f"the power scatters by {found.rough:.2%} around a smooth curve"
        yield Gate(name="smooth", channel="", ok=found.rough <= _ROUGH, reason=said)
    yield from _lamp(light, warmth, conditions, facts)


def _sign(voltage: Array, current: Array) -> Gate:
    if voltage.max() <= 0.0:
        said = "no voltage is above zero: the leads are reversed"
        return Gate(name="polarity", channel="voltage", ok=False, reason=said)
    inside = current[(voltage > 0.0) & (voltage < 0.8 * voltage.max())]
    if inside.size and float(np.median(inside)) <= 0.0:
        said = "it is not above zero where a cell gives power: it is counted into the cell, or there is no light"
        return Gate(name="polarity", channel="current", ok=False, reason=said)
    return Gate(name="polarity", channel="current", ok=True, reason="it flows out of the cell")


def _ends(shown: tuple[Array, Array], found: Estimates) -> Iterator[Gate]:
    lowest, least = (float(each.min()) for each in shown)
    highest, most = (float(each.max()) for each in shown)
    ok = math.isfinite(found.values[ISC]) and lowest <= _REACH * highest
    said = f"the sweep comes down to {lowest:.3g} V, and goes up to {highest:.3g} V"
    yield Gate(name="short circuit", channel="voltage", ok=ok, reason=said)
    ok = math.isfinite(found.values[VOC]) and least <= _REACH * most
    said = f"the sweep comes down to {least:.3g} A, and goes up to {most:.3g} A"
    yield Gate(name="open circuit", channel="current", ok=ok, reason=said)


def _lamp(light: Array, warmth: Array, conditions: IvConditions | None, facts: IvFacts) -> Iterator[Gate]:
    mean = float(light.mean())
    if not (light > 0.0).all():
        yield Gate(name="lamp", channel="irradiance", ok=False, reason="there is no light")
        return
    parts = [float(part.mean()) for part in np.array_split(light, min(_PARTS, light.size))]
    drift = (max(parts) - min(parts)) / mean
    said = f"it changes by {drift:.2%} along the sweep"
    yield Gate(name="lamp", channel="irradiance", ok=drift <= facts.drift, reason=said)
    if facts.irradiance:
        off = mean / facts.irradiance - 1.0
        said = f"{mean:.0f} W/m^2 are {off:+.1%} from the {facts.irradiance:.0f} W/m^2 of the survey"
        yield Gate(name="survey", channel="irradiance", ok=abs(off) <= _OTHER_LAMP, reason=said)
    if conditions:
        far, kelvin = conditions.irradiance / mean - 1.0, conditions.temperature - float(warmth.mean())
        ok = abs(far) <= _FARTHEST[conditions.procedure] and abs(kelvin) <= _WARMEST_K
        said = f"the irradiance is corrected by {far:+.1%}, and the temperature by {kelvin:+.1f} K"
        yield Gate(name="correction", channel="", ok=ok, reason=said)
