"""A supply rail that feeds other simulated instruments: relays, a load, an amplifier."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

from hil.model.notation import Positive
from hil.simulation.plants.model import PlantModel
from hil.simulation.plants.plant import Inputs, Plant, Port, Vector
from hil.simulation.truth import Truth

__all__ = ["MODEL", "FeedTruth", "PowerFeed", "build"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedTruth:
    """What is always on the rail: a resistor to ground [ohm]."""

    resistance: Positive = 150.0


class PowerFeed(Plant):
    """A rail with a resistor on it: what its consumers draw when they do nothing.

    Inputs `given` [V] and `limit` [A], and signals `voltage` [V] and `current` [A], are those of its port `supply`.

    Args:
        name: the plant's name.
        grid_ns: distance of grid points; nothing here moves by itself.
        resistance: between the rail and ground [ohm].
    """

    ports: ClassVar[Mapping[str, Port]] = MappingProxyType({"supply": Port("given", "limit", "voltage", "current")})

    def __init__(self, name: str, grid_ns: int, resistance: float) -> None:
        super().__init__(name, grid_ns, (), {"given": 0.0, "limit": 0.0}, frozenset({"current", "voltage"}))
        self._resistance = resistance

    def step(self, state: Vector, inputs: Inputs, dt: float) -> Vector:
        """Return the state, which never changes."""
        del inputs, dt
        return state

    def signal(self, name: str, state: Vector, inputs: Inputs, at: float) -> float:
        """Return voltage or current of the rail."""
        del state, at
        amperes = min(float(inputs["given"]) / self._resistance, float(inputs["limit"]))
        return amperes if name == "current" else amperes * self._resistance


def build(name: str, grid_ns: int, truth: Truth) -> PowerFeed:
    """Build the plant from its truth.

    Raises:
        TruthError: with everything that is wrong.
    """
    feed = truth.part(FeedTruth)
    truth.finish()
    return PowerFeed(name, grid_ns, feed.resistance)


MODEL = PlantModel(build=build)
"""The plant model `power-feed`."""
