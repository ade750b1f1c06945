"""A supply rail: a contact and wires, what is always on it, and what hangs there: relays, an amplifier, a load."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

from hil.model.notation import NotNegative, Positive
from hil.simulation.plants.model import PlantModel
from hil.simulation.plants.node import MODES, Load, Source, operating_point
from hil.simulation.plants.plant import Inputs, Plant, Port, Sink, Vector
from hil.simulation.truth import Truth

__all__ = ["MODEL", "FeedTruth", "PowerFeed", "build"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedTruth:
    """What is always on the rail: a resistor to ground [ohm]; and the resistance of wires and contact [ohm]."""

    resistance: Positive = 150.0
    series: NotNegative = 0.0


class PowerFeed(Plant):
    """A rail that a supply feeds through a contact and wires, with a resistor and a load on it.

    Port `supply`, sink `load`. The input `contact` is closed until a relay drives it; open, it separates the supply
    from all that hangs on the rail.

    Signals: `voltage` [V] and `current` [A] at the supply; `load.voltage` and `load.current` at the load.

    Args:
        name: the plant's name.
        grid_ns: distance of grid points; nothing here moves by itself.
        truth: its resistances.
    """

    ports: ClassVar[Mapping[str, Port]] = MappingProxyType({"supply": Port("given", "limit", "voltage", "current")})
    sinks: ClassVar[Mapping[str, Sink]] = MappingProxyType(
        {"load": Sink("mode", "level", "load.voltage", "load.current")}
    )

    def __init__(self, name: str, grid_ns: int, truth: FeedTruth) -> None:
        inputs: Inputs = {"given": 0.0, "limit": 0.0, "contact": True, "mode": "", "level": 0.0}
        signals = frozenset({"current", "voltage", "load.current", "load.voltage"})
        super().__init__(name, grid_ns, (), inputs, signals)
        self._truth = truth
        self._solved: tuple[Inputs, Mapping[str, float]] = ({}, {})  # of the inputs that were asked for last

    def choices(self, name: str) -> tuple[str, ...]:
        """Return the modes of a load."""
        return MODES if name == "mode" else ()

    def step(self, state: Vector, inputs: Inputs, dt: float) -> Vector:
        """Return the state, which never changes."""
        del inputs, dt
        return state

    def signal(self, name: str, state: Vector, inputs: Inputs, at: float) -> float:
        """Return voltage or current at the supply, or at the load."""
        del state, at
        if self._solved[0] is not inputs:  # a command makes new ones
            self._solved = (inputs, self._solve(inputs))
        return self._solved[1][name]

    def _solve(self, inputs: Inputs) -> Mapping[str, float]:
        given, limit, truth = float(inputs["given"]), float(inputs["limit"]), self._truth
        if not inputs["contact"]:
            return {**dict.fromkeys(self.signals, 0.0), "voltage": given}
        load = Load(str(inputs["mode"]), float(inputs["level"]))
        node, amperes, drawn = operating_point(Source(given, limit, truth.series), load, truth.resistance)
        return {
            "current": amperes,
            "load.voltage": node,
            "load.current": drawn,
            "voltage": node + amperes * truth.series,
        }


def build(name: str, grid_ns: int, truth: Truth) -> PowerFeed:
    """Build the plant from its truth.

    Raises:
        TruthError: with everything that is wrong.
    """
    feed = truth.part(FeedTruth)
    truth.finish()
    return PowerFeed(name, grid_ns, feed)


MODEL = PlantModel(build=build)
"""The plant model `power-feed`."""
