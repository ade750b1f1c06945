"""Peer models, and the setup from which they build a peer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from hil.analysis.noise.numbers import RandomStream
from hil.model.bench import InstrumentSpec
from hil.simulation.faults import Fault, Faults
from hil.simulation.plants.plant import Plant
from hil.simulation.plants.terminal import InputPoint, LoadTerminal, PlantPort, Resistor, SignalPoint, Terminal
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Path, Truth, TruthError, UnknownPlant, suggestion, together
from hil.wire.peer import BusPeer, SerialPeer

__all__ = ["Connections", "PeerModel", "PeerSetup"]


class Connections:
    """Connections of a peer's terminals to plants. Invalid ones are collected as errors, and left open.

    Args:
        wiring: `plant.point` by terminal, from the bench file.
        plants: every plant by name.
        taken: points already driven, across all peers of the world.
        path: location of the wiring, for messages.
    """

    def __init__(self, wiring: Mapping[str, str], plants: Mapping[str, Plant], taken: set[str], path: Path) -> None:
        self._wiring = wiring
        self._plants = plants
        self._taken = taken
        self._path = path
        self._asked: list[str] = []
        self._errors: list[TruthError] = []

    def port(self, terminal: str, ohms: float) -> Terminal:
        """Return the load of a supply's output: a plant's port, or a resistor of `ohms` if unconnected."""
        found = self._find(terminal)
        if found is None:
            return Resistor(ohms)
        plant, name = found
        if not self._has(terminal, plant, name, tuple(plant.ports), "supply port"):
            return Resistor(ohms)
        self._take(terminal)
        return PlantPort(plant, plant.ports[name])

    def load(self, terminal: str) -> LoadTerminal:
        """Return the source of an electronic load: a plant's sink, or open terminals if unconnected."""
        found = self._find(terminal)
        if found is None:
            return LoadTerminal()
        plant, name = found
        if not self._has(terminal, plant, name, tuple(plant.sinks), "sink for a load"):
            return LoadTerminal()
        self._take(terminal)
        return LoadTerminal(plant, plant.sinks[name])

    def input(self, terminal: str) -> InputPoint | None:
        """Return the plant's input at a terminal, or None if nothing is connected."""
        found = self._find(terminal)
        if found is None:
            return None
        plant, name = found
        if not self._has(terminal, plant, name, tuple(plant.inputs), "input"):
            return None
        self._take(terminal)
        return InputPoint(plant, name)

    def signal(self, terminal: str) -> SignalPoint | None:
        """Return the plant's signal at a terminal, or None if nothing is connected."""
        found = self._find(terminal)
        if found is None:
            return None
        plant, name = found
        return SignalPoint(plant, name) if self._has(terminal, plant, name, tuple(plant.signals), "signal") else None

    def axes(self, terminal: str) -> tuple[SignalPoint, SignalPoint, SignalPoint] | None:
        """Return the three signals `.x`, `.y`, `.z` at a terminal, or None if nothing is connected."""
        found = self._find(terminal)
        if found is None:
            return None
        plant, name = found
        groups = tuple(signal.removesuffix(".x") for signal in plant.signals if signal.endswith(".x"))
        if not self._has(terminal, plant, name, groups, "signal with three axes"):
            return None
        x, y, z = (SignalPoint(plant, f"{name}.{axis}") for axis in "xyz")
        return x, y, z

    def finish(self) -> None:
        """Raise the collected errors, and refuse unknown terminals.

        Raises:
            TruthError: if there is one.
        """
        for terminal in self._wiring:
            if terminal not in self._asked:
                self._wrong(terminal, f"unknown terminal '{terminal}'{suggestion(terminal, self._asked)}")
        if self._errors:
            raise together(self._errors)

    def _find(self, terminal: str) -> tuple[Plant, str] | None:
        self._asked.append(terminal)
        text = self._wiring.get(terminal)
        if text is None:
            return None
        name, _, point = text.partition(".")
        if name not in self._plants:
            self._errors.append(UnknownPlant((*self._path, terminal), name, tuple(self._plants)))
            return None
        return self._plants[name], point

    def _has(self, terminal: str, plant: Plant, name: str, known: tuple[str, ...], kind: str) -> bool:
        if name not in known:
            self._wrong(terminal, f"plant '{plant.name}' has no {kind} '{name}'{suggestion(name, known)}")
        return name in known

    def _take(self, terminal: str) -> None:
        point = self._wiring[terminal]
        if point in self._taken:
            self._wrong(terminal, f"'{point}' is already driven by another terminal")
        self._taken.add(point)

    def _wrong(self, terminal: str, message: str) -> None:
        self._errors.append(TruthError((*self._path, terminal), message))


@dataclass(frozen=True, slots=True, kw_only=True)
class PeerSetup:
    """Everything from which a peer is built.

    Attributes:
        instrument: the instrument it stands for.
        truth: true properties of this article.
        connections: its terminals.
        faults: its injected faults.
        seeds: the bench's random numbers.
    """

    instrument: InstrumentSpec
    truth: Truth
    connections: Connections
    faults: Faults = field(default_factory=Faults)
    seeds: Seeds = field(default_factory=lambda: Seeds(0))

    def stream(self, name: str) -> RandomStream:
        """Return a stream of random numbers of this device."""
        return self.seeds.stream(self.instrument.name, name)

    def finish(self) -> None:
        """Refuse unknown keys of the truth and unknown terminals.

        Raises:
            TruthError: with every error.
        """
        errors: list[TruthError] = []
        for finish in (self.truth.finish, self.connections.finish):
            try:
                finish()
            except TruthError as error:
                errors += (error, *error.others)
        if errors:
            raise together(errors)


@dataclass(frozen=True, slots=True, kw_only=True)
class PeerModel:
    """One kind of simulated instrument; entry points of the group `hil.peers` name objects of this class.

    Attributes:
        link: whether it is on a byte stream or on an I2C bus.
        fault_kinds: the faults that it supports in addition to those of its link.
        build: builds one peer; a serial one for `serial`, a bus peer for `bus`.
        serves_bus: whether its peers are also bus servers (`hil.wire.peer.BusServer`).
    """

    link: Literal["serial", "bus"]
    fault_kinds: tuple[type[Fault], ...]
    build: Callable[[PeerSetup], SerialPeer] | Callable[[PeerSetup], BusPeer]
    serves_bus: bool = False
