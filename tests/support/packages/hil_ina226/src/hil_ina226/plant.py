"""A rail that starts softly: its voltage goes to what it is set to, ever more slowly."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp

from hil.model.notation import Number, Positive
from hil.simulation.plants.model import PlantModel
from hil.simulation.plants.plant import Inputs, Plant, Vector
from hil.simulation.truth import Truth

__all__ = ["MODEL", "RailTruth", "SoftStart", "build"]


@dataclass(frozen=True, kw_only=True)
class RailTruth:
    """What the rail is like.

    Attributes:
        start: its voltage at the epoch [V].
        target: where it goes [V].
        time: how long it takes to follow [s].
        resistance: of what is on it [ohm].
    """

    start: Number = 0.0
    target: Number = 5.0
    time: Positive = 100.0
    resistance: Positive = 10.0


class SoftStart(Plant):
    """A rail with the signals `voltage` [V] and `current` [A]; the input `target` [V] is what it tends to.

    Args:
        name: the plant's name.
        grid_ns: distance of grid points.
        truth: what it is like.
    """

    def __init__(self, name: str, grid_ns: int, truth: RailTruth) -> None:
        super().__init__(name, grid_ns, (truth.start,), {"target": truth.target}, frozenset({"current", "voltage"}))
        self._truth = truth

    def step(self, state: Vector, inputs: Inputs, dt: float) -> Vector:
        """Return the voltage `dt` seconds later."""
        target = float(inputs["target"])
        return (target + (state[0] - target) * exp(-dt / self._truth.time),)

    def signal(self, name: str, state: Vector, inputs: Inputs, at: float) -> float:
        """Return voltage or current."""
        del inputs, at
        return state[0] if name == "voltage" else state[0] / self._truth.resistance


def build(name: str, grid_ns: int, truth: Truth) -> SoftStart:
    """Build the plant from its truth."""
    rail = truth.part(RailTruth)
    truth.finish()
    return SoftStart(name, grid_ns, rail)


MODEL = PlantModel(build=build)
