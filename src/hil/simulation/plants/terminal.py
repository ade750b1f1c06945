"""Connections at the terminals of simulated instruments: plants, resistors or open, and supply rails."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hil.simulation.plants.plant import Plant, Port, Sink, Value, Vector

__all__ = ["InputPoint", "LoadTerminal", "PlantPort", "Power", "Resistor", "SignalPoint", "Terminal", "observing"]


class Terminal(Protocol):
    """Load as seen by an output of a supply, in V and A."""

    def drive(self, volts: float, limit: float) -> None:
        """Apply a voltage with a current limit; 0 V stands for an output that is off."""
        ...

    def volts(self) -> float:
        """Return the voltage between the terminals."""
        ...

    def amperes(self) -> float:
        """Return the current out of the supply."""
        ...

    def listen(self, callback: Callable[[], None]) -> None:
        """Call back after every command that changed the connected circuit."""
        ...


class Resistor:
    """A fixed load; infinite ohms are open terminals, which show the supply's own voltage."""

    def __init__(self, ohms: float = inf) -> None:
        self._ohms = ohms
        self._volts = 0.0
        self._limit = 0.0

    def drive(self, volts: float, limit: float) -> None:
        """Apply a voltage with a current limit."""
        self._volts, self._limit = volts, limit

    def volts(self) -> float:
        """Return the voltage at the load."""
        return self._volts if self._volts / self._ohms <= self._limit else self._limit * self._ohms

    def amperes(self) -> float:
        """Return the current through the load."""
        return min(self._volts / self._ohms, self._limit)

    def listen(self, callback: Callable[[], None]) -> None:
        """Do nothing: a resistor stays what it is."""


class PlantPort:
    """A supply port of a plant. See `Terminal`; observations are the plant's own functions.

    Attributes:
        volts: observes the voltage.
        amperes: observes the current.
        listen: lets the plant call back.
    """

    def __init__(self, plant: Plant, port: Port) -> None:
        self._plant = plant
        self._port = port
        self.volts: Callable[[], float] = partial(plant.observe, port.voltage_signal)
        self.amperes: Callable[[], float] = partial(plant.observe, port.current_signal)
        self.listen: Callable[[Callable[[], None]], None] = plant.listen

    def drive(self, volts: float, limit: float) -> None:
        """Command the plant."""
        self._plant.command(**{self._port.voltage_input: volts, self._port.current_input: limit})


class LoadTerminal:
    """Source of an electronic load: a node of a plant, or open terminals.

    Args:
        plant: the plant, None where the terminals are open.
        sink: of the plant.
    """

    def __init__(self, plant: Plant | None = None, sink: Sink | None = None) -> None:
        self._plant = plant
        self._sink = sink

    def draw(self, mode: str, level: float) -> None:
        """Take a current: see `hil.simulation.plants.node.Load`."""
        if self._plant and self._sink:
            values: dict[str, Value] = {self._sink.mode_input: mode, self._sink.level_input: level}
            self._plant.command(**values)

    def volts(self) -> float:
        """Return the voltage between the terminals."""
        return self._plant.observe(self._sink.voltage_signal) if self._plant and self._sink else 0.0

    def amperes(self) -> float:
        """Return the current into the load."""
        return self._plant.observe(self._sink.current_signal) if self._plant and self._sink else 0.0


@dataclass(frozen=True, slots=True)
class InputPoint:
    """One input of a plant."""

    plant: Plant
    name: str

    def command(self, value: Value) -> None:
        """Set it."""
        self.plant.command(**{self.name: value})


@dataclass(frozen=True, slots=True)
class SignalPoint:
    """One signal of a plant, or with `axis` one of a group."""

    plant: Plant
    name: str

    def observe(self) -> float:
        """Return it now."""
        return self.plant.observe(self.name)

    def observe_at(self, at_ns: int) -> float:
        """Return it as it was within the last two seconds."""
        return self.plant.observe_at(self.name, at_ns)

    def observe_many(self, times_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return it as it was at rising instants within the last two seconds."""
        return self.plant.observe_many(self.name, times_ns)

    def waveform(self, times_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return it at rising instants within the last two seconds, however fast it changes between grid points."""
        return self.plant.waveform(self.name, times_ns)

    def shape_ns(self, first_ns: int, last_ns: int) -> NDArray[np.int64]:
        """Return instants at which `waveform` shows what happens."""
        return self.plant.shape_ns(first_ns, last_ns)


def observing(points: Sequence[SignalPoint | None], unconnected: Vector) -> Callable[[Sequence[int]], Sequence[Vector]]:
    """Return a function that observes points; those of one plant also ahead of time. See `Plant.observing`.

    Args:
        points: signals; None is an open input.
        unconnected: what an open input shows, by place.
    """
    there = [point for point in points if point is not None]
    if len(there) == len(points) and len({id(point.plant) for point in there}) == 1:
        return there[0].plant.observing(tuple(point.name for point in there))
    pairs = tuple(zip(points, unconnected, strict=True))
    return lambda _: [tuple([shown if point is None else point.observe() for point, shown in pairs])]


_LEAST_VOLTS = 9.0
"""Drop-out voltage of relays and amplifiers for 12 V."""


class Power:
    """Power-good of a supply rail, with notification of changes.

    Args:
        point: the rail's voltage; None if the instrument has power of its own.
    """

    def __init__(self, point: SignalPoint | None) -> None:
        self._point = point

    @property
    def there(self) -> bool:
        """Whether the rail voltage is sufficient."""
        return self._point is None or self._point.observe() >= _LEAST_VOLTS

    def listen(self, callback: Callable[[], None]) -> None:
        """Call back when the rail may have changed."""
        if self._point is not None:
            self._point.plant.listen(callback)
