"""The input of the controller: what its sensor shows it, with offset, noise, and what can be wrong with a sensor."""

from __future__ import annotations

from dataclasses import dataclass

from hil.simulation.faults import Fault, Faults
from hil.simulation.plants.terminal import SignalPoint
from hil.simulation.seeds import Stream

__all__ = ["SensorDetached", "SensorInput", "SensorOpen", "SensorTruth"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorOpen(Fault):
    """The sensor is broken."""

    name = "sensor-open"


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorDetached(Fault):
    """The sensor hangs in the air of the room."""

    name = "sensor-detached"


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorTruth:
    """What the input is: offset [K], noise [K rms], and what it reads where nothing is connected [degC]."""

    offset: float = 0.0
    noise: float = 0.01
    ambient: float = 22.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorInput:
    """A resistance thermometer at a place of a plant.

    The fault `sensor-open` breaks it, `sensor-detached` lets it hang in the air of the room.

    Attributes:
        truth: offset, noise, ambient.
        place: the temperature where it is mounted.
        room: the temperature of the air.
        faults: what goes wrong.
        noise: random numbers by conversion.
    """

    truth: SensorTruth
    place: SignalPoint | None
    room: SignalPoint | None
    faults: Faults
    noise: Stream

    def convert(self, now_ns: int, number: int) -> float | None:
        """Return what conversion `number` reads in degC, or None for a broken sensor."""
        point, truth = self.place, self.truth
        if self.faults.faults:
            if self.faults.now(SensorOpen, now_ns):
                return None
            point = self.room if self.faults.now(SensorDetached, now_ns) else self.place
        there = (point.observe() if point else truth.ambient) + truth.offset
        return there + truth.noise * self.noise.normal(number) if truth.noise else there
