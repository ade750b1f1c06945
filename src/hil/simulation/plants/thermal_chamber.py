"""A plate on a thermoelectric cooler, with a board and its gyroscope, in a box with a heat lamp."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from hil.model.notation import NotNegative, Positive, number
from hil.simulation.plants.model import PlantModel
from hil.simulation.plants.plant import Inputs, Plant, Vector
from hil.simulation.truth import Truth

__all__ = ["MODEL", "ChamberTruth", "ThermalChamber", "build"]

_ZERO_CELSIUS = 273.15
_PLATE, _BOARD, _DIE, _BOX, _SINK = range(5)
_NODES = {"plate": _PLATE, "board": _BOARD, "die": _DIE, "box": _BOX, "sink": _SINK}
_SIGNALS = frozenset((*_NODES, "ambient", "tec_power"))
_KEPT_STEPS = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class ChamberTruth:
    """What the chamber is made of. The defaults reach -16 and 40 degC at the plate from 22 degC within minutes.

    Attributes:
        ambient: temperature of the room, and of everything at the epoch [degC].
        seebeck: of the whole cooler [V/K].
        resistance: of the cooler [ohm].
        conductance: of the cooler between its sides [W/K].
        current: through the cooler at full power [A].
        plate_capacity, board_capacity, die_capacity, box_capacity, sink_capacity: heat capacities [J/K].
        plate_board, board_die, plate_box, board_box, box_ambient, sink_ambient: conductances [W/K].
        lamp_board, lamp_box: what of the lamp's power ends on the board, and in the air and the walls [W].
    """

    ambient: Annotated[float, number(-60, 80)] = 22.0
    seebeck: Positive = 0.05
    resistance: Positive = 1.7
    conductance: Positive = 0.5
    current: Positive = 5.0
    plate_capacity: Positive = 140.0
    board_capacity: Positive = 60.0
    die_capacity: Positive = 5.0
    box_capacity: Positive = 60.0
    sink_capacity: Positive = 400.0
    plate_board: Positive = 3.0
    board_die: Positive = 0.04
    plate_box: Positive = 0.5
    board_box: Positive = 0.1
    box_ambient: Positive = 0.5
    sink_ambient: Positive = 6.7
    lamp_board: NotNegative = 8.0
    lamp_box: NotNegative = 18.0


class ThermalChamber(Plant):
    """Five temperatures: plate, board, die, air of the box, heat sink.

    The cooler of current I (above zero where it heats the plate) gives to the plate
    `a*I*Tp + I^2*R/2 + K*(Ts - Tp)` and to the sink `-a*I*Ts + I^2*R/2 + K*(Tp - Ts)`: Peltier heat at each side's own
    temperature [K], half of Joule's heat, conduction (Rowe, CRC Handbook of Thermoelectrics, 1995, section 1.3). Under
    constant inputs the equations are linear, so every step is exact whatever its length.

    Inputs: `tec`, the share of full current from -1 (cools) to 1 (heats), and `lamp`. Signals: the temperatures of the
    nodes and of the room in degC, and `tec_power`, what the cooler draws, in W.

    Args:
        name: the plant's name.
        grid_ns: distance of grid points.
        truth: what it is made of.
    """

    def __init__(self, name: str, grid_ns: int, truth: ChamberTruth) -> None:
        super().__init__(name, grid_ns, (truth.ambient,) * len(_NODES), {"tec": 0.0, "lamp": False}, _SIGNALS)
        self._truth = truth
        self._roots = np.sqrt(
            (
                truth.plate_capacity,
                truth.board_capacity,
                truth.die_capacity,
                truth.box_capacity,
                truth.sink_capacity,
            )
        )
        self._passive = _passive(truth)
        self._products, self._ratios = np.outer(self._roots, self._roots), np.outer(1 / self._roots, self._roots)
        self._stepped = lru_cache(maxsize=_KEPT_STEPS)(self._exact)

    def step(self, state: Vector, inputs: Inputs, dt: float) -> Vector:
        """Step all nodes at once."""
        decay, rise = self._stepped(_share(inputs), bool(inputs["lamp"]), dt)
        return tuple((decay @ state + rise).tolist())

    def signal(self, name: str, state: Vector, inputs: Inputs, at: float) -> float:
        """Return one of the signals of this plant."""
        del at
        if name in _NODES:
            return state[_NODES[name]]
        readers: Mapping[str, Callable[[], float]] = {
            "ambient": lambda: self._truth.ambient,
            "tec_power": lambda: self._power(state, _share(inputs)),
        }
        return readers[name]()

    def _power(self, state: Vector, share: float) -> float:
        current = share * self._truth.current
        difference = state[_PLATE] - state[_SINK]
        return self._truth.seebeck * current * difference + current**2 * self._truth.resistance

    def _exact(self, share: float, lamp: bool, dt: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return D and r of `x(t + dt) = D x(t) + r`.

        With capacities C and symmetric flows S, `C x' = S x + w`. In `y = sqrt(C) x` the matrix is symmetric, so that
        its modes are orthogonal and each decays by itself.
        """
        flows, watts = self._equations(share * self._truth.current, lamp)
        rates, modes = np.linalg.eigh(flows / self._products)
        turns = rates * dt
        grown = np.where(turns == 0, 1.0, np.expm1(turns) / np.where(turns == 0, 1.0, turns)) * dt
        decay = (modes * np.exp(turns)) @ modes.T * self._ratios
        return decay, (modes * grown) @ modes.T @ (watts / self._roots) / self._roots

    def _equations(self, current: float, lamp: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return S [W/K] and w [W] of `C x' = S x + w`, temperatures in degC."""
        truth = self._truth
        flows, watts = (each.copy() for each in self._passive)
        for node, peltier in ((_PLATE, truth.seebeck * current), (_SINK, -truth.seebeck * current)):
            flows[node, node] += peltier
            watts[node] += peltier * _ZERO_CELSIUS + current**2 * truth.resistance / 2
        if lamp:
            watts[_BOARD] += truth.lamp_board
            watts[_BOX] += truth.lamp_box
        return flows, watts


def _passive(truth: ChamberTruth) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return S [W/K] and w [W] without power."""
    flows, watts = np.zeros((len(_NODES), len(_NODES))), np.zeros(len(_NODES))
    for one, other, conductance in (
        (_PLATE, _BOARD, truth.plate_board),
        (_PLATE, _BOX, truth.plate_box),
        (_PLATE, _SINK, truth.conductance),
        (_BOARD, _DIE, truth.board_die),
        (_BOARD, _BOX, truth.board_box),
    ):
        flows[[one, other], [one, other]] -= conductance
        flows[[one, other], [other, one]] += conductance
    for node, conductance in ((_BOX, truth.box_ambient), (_SINK, truth.sink_ambient)):
        flows[node, node] -= conductance
        watts[node] += conductance * truth.ambient
    return flows, watts


def _share(inputs: Inputs) -> float:
    return min(max(float(inputs["tec"]), -1.0), 1.0)


def build(name: str, grid_ns: int, truth: Truth) -> ThermalChamber:
    """Build the plant from its truth.

    Raises:
        TruthError: with everything that is wrong.
    """
    chamber = truth.part(ChamberTruth)
    truth.finish()
    return ThermalChamber(name, grid_ns, chamber)


MODEL = PlantModel(build=build)
"""The plant model `thermal-chamber`."""
