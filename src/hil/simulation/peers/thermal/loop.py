"""Control loop: sensor input, and PID algorithm with output limits and bumpless transfer."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from hil.analysis.noise.numbers import RandomStream
from hil.model.notation import NotNegative, Number, number
from hil.simulation.faults import Fault, Faults
from hil.simulation.plants.terminal import SignalPoint
from hil.wire.checkpoint import Kept, Stateful

__all__ = ["Regulation", "SensorDetached", "SensorInput", "SensorOpen", "SensorTruth", "Tuning"]


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

    offset: Number = field(default=0.0, metadata={"alias": "sensor_offset"})
    noise: NotNegative = field(default=0.01, metadata={"alias": "sensor_noise"})
    ambient: Annotated[float, number(-60, 80)] = 22.0


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
    noise: RandomStream

    def convert(self, now_ns: int, number: int) -> float | None:
        """Return what conversion `number` reads in degC, or None for a broken sensor."""
        point, truth = self.place, self.truth
        if self.faults.faults:
            if self.faults.now(SensorOpen, now_ns):
                return None
            point = self.room if self.faults.now(SensorDetached, now_ns) else self.place
        there = (point.observe() if point else truth.ambient) + truth.offset
        return there + truth.noise * self.noise.normal(number) if truth.noise else there


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuning:
    """Parameters of the loop.

    Attributes:
        band: proportional band, in the unit of the display: an error of this size asks for 100 %.
        integral: integral time [s], 0 for none.
        derivative: derivative time [s], 0 for none.
        cool_gain: what outputs below zero are multiplied by.
        low, high: limits of the output [%].
    """

    band: float
    integral: float
    derivative: float
    cool_gain: float
    low: float
    high: float

    def limited(self, output: float) -> float:
        """Return an output within the limits."""
        return min(max(output, self.low), self.high)

    def raw(self, error: float, total: float, slope: float) -> float:
        """Return the output [%] without limits."""
        demand = 100 / self.band * (error + total - self.derivative * slope)
        return demand * self.cool_gain if demand < 0 else demand

    def total_for(self, output: float, error: float) -> float:
        """Return the integral term that gives this output at rest."""
        demand = output / self.cool_gain if output < 0 else output
        return demand * self.band / 100 - error


class Regulation(Stateful):
    """One PID loop with anti-windup: the integral term is frozen while the output is limited."""

    _total: Kept[float]
    _last: Kept[float | None]

    def __init__(self) -> None:
        self._total = 0.0
        self._last = None

    def clear(self) -> None:
        """Start again, as after standby."""
        self._total, self._last = 0.0, None

    def hold(self, output: float, error: float, tuning: Tuning) -> None:
        """Track an externally set output, for bumpless transfer."""
        self._total = tuning.total_for(output, error)
        self._last = None

    def output(self, setpoint: float, value: float, tuning: Tuning, seconds: float) -> float:
        """Return the output [%] of one turn."""
        error = setpoint - value
        slope = 0.0 if self._last is None else (value - self._last) / seconds
        self._last = value
        total = self._total + error * seconds / tuning.integral if tuning.integral else 0.0
        wanted = tuning.raw(error, total, slope)
        pushes = (wanted > tuning.high and error > 0) or (wanted < tuning.low and error < 0)
        self._total = self._total if pushes else total
        return tuning.limited(tuning.raw(error, self._total, slope))
