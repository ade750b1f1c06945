"""A rail with a capacitor behind a resistance: what a load switch charges at power-on, in closed form."""

from __future__ import annotations

from math import exp
from types import MappingProxyType

from hil.simulation.plants.plant import Plant, Port

__all__ = ["ChargingRail"]


class ChargingRail(Plant):
    """Its state is the capacitor's voltage; signals `voltage` [V] of the capacitor and `inrush` [A] into it."""

    ports = MappingProxyType({"supply": Port("given", "limit", "voltage", "inrush")})

    def __init__(self, ohms=2.0, farads=1e-3, grid_ns=10_000_000):
        super().__init__("rail", grid_ns, (0.0,), {"given": 0.0, "limit": 0.0}, frozenset({"voltage", "inrush"}))
        self.ohms, self.tau = ohms, ohms * farads

    def step(self, state, inputs, dt):
        """Charge the capacitor."""
        target = float(inputs["given"])
        return (target + (state[0] - target) * exp(-dt / self.tau),)

    def signal(self, name, state, inputs, at):
        """Return voltage or current."""
        return state[0] if name == "voltage" else (float(inputs["given"]) - state[0]) / self.ohms
