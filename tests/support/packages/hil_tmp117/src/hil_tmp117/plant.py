"""Still air in a box: it goes from one temperature to another, ever more slowly."""

from __future__ import annotations

from math import exp

from hil.simulation.plants.model import PlantModel
from hil.simulation.plants.plant import Inputs, Plant, Vector
from hil.simulation.truth import Truth

__all__ = ["MODEL", "StillAir", "build"]


class StillAir(Plant):
    """Air with the signal `temperature` [degC]; the input `around` [degC] is what it tends to.

    Args:
        name: the plant's name.
        grid_ns: distance of grid points.
        start: temperature at the epoch [degC].
        around: temperature of the box [degC].
        time_s: the time constant [s].
    """

    def __init__(self, name: str, grid_ns: int, start: float, around: float, time_s: float) -> None:
        super().__init__(name, grid_ns, (start,), {"around": around}, frozenset({"temperature"}))
        self._time_s = time_s

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
    start, around = truth.number("start", 20.0), truth.number("around", 30.0)
    time_s = truth.number("time", 100.0, above=0)
    truth.finish()
    return StillAir(name, grid_ns, start, around, time_s)


MODEL = PlantModel(build=build)
