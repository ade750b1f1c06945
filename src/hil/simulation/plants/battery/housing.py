"""Where a cell lies, with its thermistor: a metal container, or a thermoelectric assembly in that container."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from math import exp, log

import numpy as np

from hil.model.notation import Positive

__all__ = ["HEALTHY", "STATES", "Housing", "HousingTruth", "Response", "Thermistor", "Warmth"]

HEALTHY = "healthy"
STATES = (HEALTHY, "open", "shorted", "detached")
"""What can be with the thermistor; a detached one hangs in the box."""

_ZERO_CELSIUS = 273.15
_PER_REFERENCE = 1 / (25.0 + _ZERO_CELSIUS)
_OPEN_OHMS = 1e9
_SHORTED_OHMS = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Thermistor:
    """A thermistor with negative temperature coefficient, R = nominal*exp(beta*(1/T - 1/298.15 K)).

    Attributes:
        nominal: resistance at 25 degC [ohm].
        beta: [K].
    """

    nominal: Positive = field(default=10_000.0, metadata={"alias": "ntc_nominal"})
    beta: Positive = field(default=3950.0, metadata={"alias": "ntc_beta"})

    def ohms(self, celsius: float) -> float:
        """Return the resistance at a temperature."""
        kelvin = celsius + _ZERO_CELSIUS
        return self.nominal * exp(self.beta * (1 / kelvin - _PER_REFERENCE))

    def seen(self, state: str, cell: float, box: float) -> float:
        """Return the resistance between its wires, with cell and box at these temperatures [degC]."""
        if state == "open":
            return _OPEN_OHMS
        if state == "shorted":
            return _SHORTED_OHMS
        return self.ohms(box if state == "detached" else cell)

    def read(self, state: str, cell: float, box: float) -> float:
        """Return the temperature that the resistance stands for; far beyond any range where it is open or shorted."""
        if state == HEALTHY:
            return cell
        ratio = self.seen(state, cell, box) / self.nominal
        return 1 / (_PER_REFERENCE + log(ratio) / self.beta) - _ZERO_CELSIUS


_CELL, _PLATE, _BOX = range(3)
_RESTING_KELVIN = 1e-9
_KEPT_STEPS = 8192

Warmth = tuple[float, float, float]
"""Temperatures of cell, plates and box [degC]."""

Response = tuple[float, ...]
"""Nine numbers D row by row, three of r, three of h: x(t + dt) = D x + r + h*watts, in kelvin above the room."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HousingTruth:
    """What the container and the assembly are made of.

    Attributes:
        cell_capacity, plate_capacity, box_capacity: heat capacities [J/K].
        cell_box: conductance of the cell to the box [W/K]; fitted to Table 1 with the cell's heat.
        cell_plate: of the cell between the plates to both of them [W/K]; only in the assembly.
        plate_box, box_ambient: conductances [W/K].
        seebeck: of the coolers [V/K].
        resistance: of the coolers [ohm].
        conductance: of the coolers between their sides [W/K].
        sink_ambient: of heat sinks and fans to the room [W/K].
        current: through the coolers at full power [A].
    """

    cell_capacity: Positive = 28.0
    plate_capacity: Positive = 140.0
    box_capacity: Positive = 300.0
    cell_box: Positive = 0.0218
    cell_plate: Positive = 1.5
    plate_box: Positive = 0.1
    box_ambient: Positive = 1.0
    seebeck: Positive = 0.05
    resistance: Positive = field(default=1.7, metadata={"alias": "tec_resistance"})
    conductance: Positive = field(default=0.5, metadata={"alias": "tec_conductance"})
    sink_ambient: Positive = 6.7
    current: Positive = field(default=5.0, metadata={"alias": "tec_current"})


class Housing:
    """Three temperatures, stepped exactly under constant heat.

    The coolers pump as in Rowe, CRC Handbook of Thermoelectrics (1995), section 1.3; their sinks have no heat capacity.

    Args:
        truth: what it is made of.
    """

    def __init__(self, truth: HousingTruth) -> None:
        self._truth = truth
        self._roots = np.sqrt((truth.cell_capacity, truth.plate_capacity, truth.box_capacity))
        self.response = lru_cache(maxsize=_KEPT_STEPS)(self._response)

    @staticmethod
    def step(room: float, response: Response) -> Callable[[float, float, float, float], Warmth]:
        """Return a function of the three temperatures and of heat in the cell [W]: the temperatures after a step.

        A nanokelvin from the room [degC] is at rest.
        """
        a, b, c, d, e, f, g, h, i, p, q, r, u, v, w = response

        def step(cell: float, plate: float, box: float, watts: float) -> Warmth:
            cell, plate, box = cell - room, plate - room, box - room
            after = a * cell + b * plate + c * box + p + u * watts
            plates = d * cell + e * plate + f * box + q + v * watts
            boxed = g * cell + h * plate + i * box + r + w * watts
            if not watts and abs(after) + abs(plates) + abs(boxed) < _RESTING_KELVIN:
                return (room, room, room)
            return (room + after, room + plates, room + boxed)

        return step

    def _response(self, share: float, room: float, dt: float, *, assembled: bool) -> Response:
        """Return the step of C x' = S x + w under constant inputs.

        In y = sqrt(C) x the matrix is symmetric: its modes are orthogonal, and each decays by itself.
        """
        truth = self._truth
        flows, watts = np.zeros((3, 3)), np.zeros(3)
        for one, other, conductance in (
            (_CELL, _BOX, truth.cell_box),
            (_CELL, _PLATE, truth.cell_plate if assembled else 0.0),
            (_PLATE, _BOX, truth.plate_box),
        ):
            flows[[one, other], [one, other]] -= conductance
            flows[[one, other], [other, one]] += conductance
        flows[_BOX, _BOX] -= truth.box_ambient
        pumped, rising = self._pumped(share * truth.current, room + _ZERO_CELSIUS)
        watts[_PLATE] += pumped
        flows[_PLATE, _PLATE] += rising
        rates, modes = np.linalg.eigh(flows / np.outer(self._roots, self._roots))
        turns = rates * dt
        grown = np.where(turns == 0, 1.0, np.expm1(turns) / np.where(turns == 0, 1.0, turns)) * dt
        decay = (modes * np.exp(turns)) @ modes.T * np.outer(1 / self._roots, self._roots)
        rise = (modes * grown) @ modes.T / np.outer(self._roots, self._roots)
        return (*decay.ravel().tolist(), *(rise @ watts).tolist(), *rise[:, _CELL].tolist())

    def _pumped(self, current: float, room: float) -> tuple[float, float]:
        """Return the heat into plates at the temperature of the room [K], and how it rises with theirs [W/K].

        Of the sinks' balance, sink_ambient*x = -a*I*(room + x) + I^2*R/2 + K*(plates - x), follows their x, and with it
        what the plates get: a*I*(room + plates) + I^2*R/2 + K*(x - plates).
        """
        truth = self._truth
        peltier, joule, through = truth.seebeck * current, current**2 * truth.resistance / 2, truth.conductance
        out = truth.sink_ambient + through + peltier
        heat = peltier * room + joule + through * (joule - peltier * room) / out
        return heat, peltier - through + through**2 / out
