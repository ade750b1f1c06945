"""A plate with a heater foil that a supply feeds through a contact, with or without a thermostat of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from hil.model.notation import NotNegative, Positive, number
from hil.simulation.plants.model import PlantModel
from hil.simulation.plants.plant import Inputs, Plant, Port, Vector
from hil.simulation.truth import Truth

__all__ = ["MODEL", "HeatedPlate", "PlateTruth", "build"]

_FOIL, _PLATE, _ON = range(3)
_SIGNALS = frozenset({"plate", "foil", "ambient", "voltage", "current", "power"})


@dataclass(frozen=True, slots=True, kw_only=True)
class PlateTruth:
    """What the plate is made of. The defaults warm it from 22 to 45 degC in about four minutes with 12 V.

    Attributes:
        resistance: of the heater foil [ohm].
        series: of leads and contact [ohm].
        foil_capacity, plate_capacity: heat capacities [J/K].
        foil_plate, plate_ambient: conductances [W/K]; a foil that came loose has a small first one.
        ambient: temperature of the room, and of everything at the epoch [degC].
        opens, closes: the thermostat's: it opens when the plate is warmer than the first, and closes when it is colder
            than the second [degC]. With the defaults it never opens.
    """

    resistance: Positive = 12.0
    series: NotNegative = 0.1
    foil_capacity: Positive = 4.0
    plate_capacity: Positive = 90.0
    foil_plate: Positive = 1.5
    plate_ambient: Positive = 0.2
    ambient: Annotated[float, number(-60, 80)] = 22.0
    opens: Annotated[float, number(-60, 1000)] = 1000.0
    closes: Annotated[float, number(-60, 1000)] = 999.0


class HeatedPlate(Plant):
    """Two temperatures, of the foil and of the plate, and a thermostat that looks at the plate once per grid step.

    With capacities C, conductances G and the foil's power P:
    `Cf f' = P - Gfp (f - p)` and `Cp p' = Gfp (f - p) - Gpa (p - a)`. Under constant power that is linear, so every
    step is exact whatever its length.

    Port `supply`. The input `contact` is closed until a relay drives it. Signals: `plate`, `foil` and `ambient` [degC];
    `voltage` [V] and `current` [A] at the supply; `power` [W] of the foil.

    Args:
        name: the plant's name.
        grid_ns: distance of grid points.
        truth: what it is made of.
    """

    ports: ClassVar[Mapping[str, Port]] = MappingProxyType({"supply": Port("given", "limit", "voltage", "current")})

    def __init__(self, name: str, grid_ns: int, truth: PlateTruth) -> None:
        inputs: Inputs = {"given": 0.0, "limit": 0.0, "contact": True}
        on = 1.0 if truth.ambient <= truth.opens else 0.0
        super().__init__(name, grid_ns, (truth.ambient, truth.ambient, on), inputs, _SIGNALS)
        self._truth = truth
        self._stepped = lru_cache(maxsize=4096)(self._exact)

    def step(self, state: Vector, inputs: Inputs, dt: float) -> Vector:
        """Step both temperatures, then let the thermostat look."""
        truth = self._truth
        decay, gain = self._stepped(dt)
        warmer = np.array([state[_FOIL] - truth.ambient, state[_PLATE] - truth.ambient])
        foil, plate = (truth.ambient + decay @ warmer + gain * self._power(state, inputs)).tolist()
        on = state[_ON] > 0.5
        return foil, plate, float(plate <= truth.opens if on else plate < truth.closes)

    def signal(self, name: str, state: Vector, inputs: Inputs, at: float) -> float:
        """Return one of the signals of this plant."""
        del at
        if name == "ambient":
            return self._truth.ambient
        if name in {"foil", "plate"}:
            return state[_FOIL if name == "foil" else _PLATE]
        if name == "power":
            return self._power(state, inputs)
        amperes = self._amperes(state, inputs)
        limits = amperes >= float(inputs["limit"])
        return amperes if name == "current" else amperes * self._ohms if limits else float(inputs["given"])

    @property
    def _ohms(self) -> float:
        return self._truth.resistance + self._truth.series

    def _amperes(self, state: Vector, inputs: Inputs) -> float:
        if not inputs["contact"] or state[_ON] <= 0.5:
            return 0.0
        return max(0.0, min(float(inputs["given"]) / self._ohms, float(inputs["limit"])))

    def _power(self, state: Vector, inputs: Inputs) -> float:
        return self._amperes(state, inputs) ** 2 * self._truth.resistance

    def _exact(self, dt: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return D [1] and g [K/W] of `x(t + dt) = D x(t) + g P`, x above the room; modes as in `ThermalChamber`."""
        truth = self._truth
        roots = np.sqrt((truth.foil_capacity, truth.plate_capacity))
        flows = np.array(
            [[-truth.foil_plate, truth.foil_plate], [truth.foil_plate, -truth.foil_plate - truth.plate_ambient]]
        )
        rates, modes = np.linalg.eigh(flows / np.outer(roots, roots))
        decay = (modes * np.exp(rates * dt)) @ modes.T * np.outer(1 / roots, roots)
        gain = (modes * (np.expm1(rates * dt) / rates)) @ modes.T @ (np.array([1.0, 0.0]) / roots) / roots
        return decay, gain


def build(name: str, grid_ns: int, truth: Truth) -> HeatedPlate:
    """Build the plant from its truth.

    Raises:
        TruthError: with everything that is wrong.
    """
    plate = truth.part(PlateTruth)
    truth.finish()
    return HeatedPlate(name, grid_ns, plate)


MODEL = PlantModel(build=build)
"""The plant model `heated-plate`."""
