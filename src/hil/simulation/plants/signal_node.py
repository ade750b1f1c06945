"""A node that a function generator drives: the voltage there is what it gives, at every instant."""

from __future__ import annotations

from functools import lru_cache
from math import floor, pi, sin

from hil.clock.port import NANOSECONDS
from hil.simulation.plants.model import PlantModel
from hil.simulation.plants.plant import Inputs, Plant, Vector
from hil.simulation.truth import Truth

__all__ = ["MODEL", "SignalNode", "build", "driven"]


def driven(shape: str, frequency: float, amplitude: float, offset: float, since_ns: int) -> str:
    """Return what a generator gives as the input `drive` of a node: shape, Hz, V peak to peak, V, phase zero."""
    return f"{shape} {frequency!r} {amplitude!r} {offset!r} {since_ns}"


class SignalNode(Plant):
    """Input `drive`, see `driven`, empty for nothing; signal `voltage` [V]. Its driver has no output resistance."""

    def __init__(self, name: str, grid_ns: int) -> None:
        super().__init__(name, grid_ns, (), {"drive": ""}, frozenset({"voltage"}))

    def step(self, state: Vector, inputs: Inputs, dt: float) -> Vector:
        """Return the state, of which there is none."""
        del inputs, dt
        return state

    def signal(self, name: str, state: Vector, inputs: Inputs, at: float) -> float:
        """Return the voltage."""
        del name, state
        shape, frequency, amplitude, offset, since = _read(str(inputs["drive"]))
        turns = (at - since) * frequency
        share = turns - floor(turns)
        if shape == "SIN":
            return offset + amplitude / 2 * sin(2 * pi * share)
        if shape == "SQU":
            return offset + (amplitude / 2 if share < 0.5 else -amplitude / 2)
        return offset + amplitude * (share - 0.5) if shape == "RAMP" else offset


@lru_cache(maxsize=64)
def _read(drive: str) -> tuple[str, float, float, float, float]:
    if not drive:
        return "DC", 1.0, 0.0, 0.0, 0.0
    shape, frequency, amplitude, offset, since_ns = drive.split()
    return shape, float(frequency), float(amplitude), float(offset), int(since_ns) / NANOSECONDS


def build(name: str, grid_ns: int, truth: Truth) -> SignalNode:
    """Build the plant; its truth says nothing.

    Raises:
        TruthError: for whatever it says.
    """
    truth.finish()
    return SignalNode(name, grid_ns)


MODEL = PlantModel(build=build)
"""The plant model `signal-node`."""
