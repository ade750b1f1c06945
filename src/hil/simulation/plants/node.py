"""An electrical node: a source with a current limit, a resistance on the way, a resistor to ground, and a load.

Everything is in closed form, so that a plant without states of its own can be asked at any instant. Plants that feed
one node from another one, such as a converter, solve them in turn: a converter is a load of constant power to what
feeds it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt

__all__ = ["MODES", "OFF", "Load", "Source", "operating_point"]

MODES = ("", "CC", "CR", "CP", "CV")
"""What a load keeps constant: nothing (off), its current, resistance, power or voltage."""

_EPSILON = 1e-9


@dataclass(frozen=True, slots=True)
class Source:
    """What feeds the node.

    Attributes:
        volts: its open voltage [V].
        limit: the most current that it gives [A].
        ohms: between it and the node: wires, contacts, its own.
    """

    volts: float
    limit: float = inf
    ohms: float = 0.0


@dataclass(frozen=True, slots=True)
class Load:
    """What draws from the node.

    Attributes:
        mode: one of `MODES`.
        level: what it keeps constant, in A, ohm, W or V.
        least_ohms: what it is at its wide-open end: where the node cannot give what it wants, it is that resistor.
    """

    mode: str = ""
    level: float = 0.0
    least_ohms: float = 0.05


OFF = Load()
"""Nothing draws."""


def operating_point(source: Source, load: Load = OFF, shunt: float = inf) -> tuple[float, float, float]:
    """Return the node's voltage [V], the current out of the source [A] and that into the load [A].

    With a load of constant power two points exist; this is the stable one at the higher voltage. Where none exists the
    node breaks down to what the wide-open load leaves.

    Args:
        source: what feeds the node.
        load: what draws from it.
        shunt: a resistor from the node to ground [ohm].
    """
    if source.volts <= 0.0 or source.limit <= 0.0:
        return 0.0, 0.0, 0.0
    ohms, leak = source.ohms, 1.0 / shunt
    volts = _volts(source.volts / ohms, 1.0 / ohms + leak, load) if ohms > _EPSILON else source.volts
    drawn = _drawn(volts, load)
    if drawn + volts * leak > source.limit:
        volts = _volts(source.limit, leak, load)
        if volts > source.volts - source.limit * ohms + _EPSILON:  # above, the source does not limit
            volts = source.limit / (leak + 1.0 / load.least_ohms)
        return volts, source.limit, source.limit - volts * leak
    return volts, drawn + volts * leak, drawn


def _volts(amperes: float, siemens: float, load: Load) -> float:
    """Return the voltage where a current source with a conductance beside it feeds a load."""
    wide_open = amperes / (siemens + 1.0 / load.least_ohms)
    if load.mode == "CC":
        return max(wide_open, (amperes - load.level) / siemens if siemens else -inf)
    if load.mode == "CR":
        return amperes / (siemens + 1.0 / max(load.level, load.least_ohms))
    if load.mode == "CP" and load.level > 0.0:
        left = amperes * amperes - 4.0 * siemens * load.level
        if left < 0.0:
            return wide_open
        return max(wide_open, (amperes + sqrt(left)) / (2.0 * siemens) if siemens else load.level / amperes)
    unloaded = amperes / siemens if siemens else inf
    if load.mode == "CV" and unloaded > load.level:
        return (amperes + load.level / load.least_ohms) / (siemens + 1.0 / load.least_ohms)
    return unloaded


def _drawn(volts: float, load: Load) -> float:
    """Return the current into a load at a voltage that nothing changes."""
    most = volts / load.least_ohms
    wanted = {
        "": 0.0,
        "CC": load.level,
        "CR": volts / max(load.level, load.least_ohms),
        "CP": load.level / volts,
        "CV": max(0.0, volts - load.level) / load.least_ohms,
    }
    return min(most, wanted[load.mode])
