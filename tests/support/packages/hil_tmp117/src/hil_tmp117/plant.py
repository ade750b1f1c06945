"""Still air in a box: it goes from one temperature to another, ever more slowly."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp

from hil.model.notation import Number, Positive
from hil.simulation.plants.model import PlantModel
from hil.simulation.plants.plant import Inputs, Plant, Vector
from hil.simulation.truth import Truth

__all__ = ["MODEL", "AirTruth", "StillAir", "build"]


@dataclass(frozen=True, kw_only=True)
class AirTruth:
    """What the air is like.

    Attributes:
        start: its temperature at the epoch [degC].
        around: temperature of the box [degC].
        time: how long it takes to follow [s].
    """

    start: Number = 20.0
    around: Number = 30.0
    time: Positive = 100.0


class StillAir(Plant):
    """Air with the signal `temperature` [degC]; the input `around` [degC] is what it tends to.

    Args:
        name: the plant's name.
        grid_ns: distance of grid points.
        truth: what it is like.
    """

    def __init__(self, name: str, grid_ns: int, truth: AirTruth) -> None:
        super().__init__(name, grid_ns, (truth.start,), {"around": truth.around}, frozenset({"temperature"}))
        self._time_s = truth.time

    def step(self, state: Vector, inputs: Inputs, dt: float) -> Vector:
        """Return the temperature `dt` seconds later."""
        around = float(inputs["around"])
        return (around + (state[0] - around) * exp(-dt / self._time_s),)

    def signal(self, name: str, state: Vector, inputs: Inputs, at: float) -> float:
        """Return the temperature."""
        del name, inputs, at
        return state[0]


def build(name: str, grid_ns: int, truth: Truth) -> StillAir:
    """Build the plant from its truth."""
    air = truth.part(AirTruth)
    truth.finish()
    return StillAir(name, grid_ns, air)


MODEL = PlantModel(build=build)
