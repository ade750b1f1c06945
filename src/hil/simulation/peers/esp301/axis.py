"""One axis of the simulated controller: settings, motor power, the motion it believes in, and the table's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from hil.clock.port import NANOSECONDS
from hil.model.notation import Positive, Text, one_of, vector, whole
from hil.simulation.faults import Fault, Faults, Share
from hil.simulation.plants.terminal import InputPoint, SignalPoint
from hil.wire.checkpoint import Kept, Stateful

__all__ = ["Axis", "Drive", "ErrorBuffer", "EspError", "NoStop", "Slipping", "StageTruth", "Stalled"]

_DEPTH = 10
_AXIS = 100
_NO_ERROR = "NO ERROR DETECTED"
_TEXTS: Mapping[int, str] = {
    6: "COMMAND DOES NOT EXIST",
    7: "PARAMETER OUT OF RANGE",
    9: "AXIS NUMBER OUT OF RANGE",
    37: "AXIS NUMBER MISSING",
    38: "COMMAND PARAMETER MISSING",
}
_AXIS_TEXTS: Mapping[int, str] = {
    1: "PARAMETER OUT OF RANGE",
    8: "MOTOR / STAGE NOT CONNECTED",
    10: "MAXIMUM VELOCITY EXCEEDED",
    11: "MAXIMUM ACCELERATION EXCEEDED",
    13: "MOTOR NOT ENABLED",
}


class EspError(Exception):
    """A command that is refused with this code; codes of axis n are n * 100 and more."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class ErrorBuffer(Stateful):
    """A first-in, first-out buffer; where it is full, the oldest entry is lost."""

    entries: Kept[list[tuple[int, int]]]

    def __init__(self) -> None:
        self.entries = []

    def push(self, code: int, ticks: int) -> None:
        """Add an error."""
        self.entries = [*self.entries, (code, ticks)][-_DEPTH:]

    def take(self, ticks: int) -> tuple[int, int, str]:
        """Take the oldest error out: code, its time, its text; code 0 and the time now if there is none."""
        if not self.entries:
            return 0, ticks, _NO_ERROR
        code, when = self.entries.pop(0)
        text = _TEXTS.get(code) if code < _AXIS else _AXIS_TEXTS.get(code % _AXIS)
        return code, when, text or "RESERVED"


@dataclass(frozen=True, slots=True, kw_only=True)
class NoStop(Fault):
    """The stage does not stop when it is told to; `power` says what switching the motor off does."""

    name = "no-stop"

    power: Annotated[str, one_of("cuts", "stays")] = "cuts"


@dataclass(frozen=True, slots=True, kw_only=True)
class Slipping(Fault):
    """Only a share of the rate comes through."""

    name = "slipping"

    share: Share = 0.9


@dataclass(frozen=True, slots=True, kw_only=True)
class Stalled(Fault):
    """The stage stands still whatever drives it."""

    name = "stalled"


@dataclass(frozen=True, slots=True, kw_only=True)
class StageTruth:
    """One article of a stage.

    Attributes:
        model: what it says of itself.
        serial: what it says of itself.
        identifies: how it does: as `model, serial`, as `unknown`, as an `empty` line, or `not` at all.
        unit: code of the displacement unit; 7 is the degree.
        resolution: of its encoder [deg].
        maximum_velocity: [deg/s].
        maximum_acceleration: [deg/s2].
        friction: deceleration without motor power [deg/s2].
        limits: software travel limits [deg]; they are kept, not watched.
    """

    model: Text = field(default="URS75BPP", metadata={"alias": "stage"})
    serial: Text = "SN0001"
    identifies: Annotated[str, one_of("model, serial", "unknown", "empty", "not")] = "model, serial"
    unit: Annotated[int, whole(0, 11)] = 7
    resolution: Positive = 0.0002
    maximum_velocity: Positive = 100.0
    maximum_acceleration: Positive = 200.0
    friction: Positive = 60.0
    limits: Annotated[tuple[float, float], vector(2)] = (-360_000.0, 360_000.0)

    def told(self, axis: int) -> str:
        """Return what it says of itself on that axis."""
        if self.identifies == "not":
            raise EspError(_AXIS * axis + 8)
        return {"unknown": "Unknown", "empty": ""}.get(self.identifies, f"{self.model}, {self.serial}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """What the axis moves: inputs of a plant, and the encoder's angle; None if nothing is connected."""

    rate: InputPoint | None = None
    acceleration: InputPoint | None = None
    grip: InputPoint | None = None
    angle: SignalPoint | None = None

    def command(self, rate: float, acceleration: float) -> None:
        """Let the motor go to a rate."""
        if self.acceleration is not None:
            self.acceleration.command(acceleration)
        if self.rate is not None:
            self.rate.command(rate)


class Axis(Stateful):
    """The axis with the rotation stage.

    The controller's velocity is the one that it commands, not the encoder's: a stage that slips shows in
    the position only.

    Args:
        number: of the axis.
        stage: the article.
        drive: what it moves.
        faults: what goes wrong.
    """

    unit: Kept[int]
    limits: Kept[tuple[float, float]]
    velocity: Kept[float]
    acceleration: Kept[float]
    deceleration: Kept[float]
    powered: Kept[bool]
    _direction: Kept[int]
    _since_ns: Kept[int]
    _from: Kept[float]
    _slope: Kept[float]

    def __init__(self, number: int, stage: StageTruth, drive: Drive, faults: Faults) -> None:
        self.number = number
        self.stage = stage
        self._drive = drive
        self._faults = faults
        self.unit = stage.unit
        self.limits = stage.limits
        self.velocity = stage.maximum_velocity / 10
        self.acceleration = stage.maximum_acceleration / 10
        self.deceleration = stage.maximum_acceleration / 10
        self.powered = False
        self._direction = 0
        self._since_ns = 0
        self._from = 0.0
        self._slope = self.acceleration

    def changes_ns(self) -> tuple[int, ...]:
        """Return the instants at which something begins or ceases to go wrong."""
        moving = (fault for kind in (Slipping, Stalled, NoStop) for fault in self._faults.of(kind))
        return tuple(at for fault in moving for at in (fault.start_ns, fault.end_ns))

    def commanded_velocity(self, now_ns: int) -> float:
        """Return the velocity of the trapezoid that the controller follows [deg/s]."""
        gap = self._target() - self._from
        way = self._slope * (now_ns - self._since_ns) / NANOSECONDS
        if way >= abs(gap):
            return self._target()
        return self._from + (way if gap > 0 else -way)

    def done(self, now_ns: int) -> bool:
        """Return whether the trapezoid has ended."""
        return not self._direction and self.commanded_velocity(now_ns) == 0

    def position(self) -> float:
        """Return the encoder's angle [deg], in its steps."""
        angle = self._drive.angle.observe() if self._drive.angle is not None else 0.0
        return round(angle / self.stage.resolution) * self.stage.resolution

    def set_velocity(self, velocity: float, now_ns: int) -> None:
        """Take a velocity; a motion changes to it at once."""
        if velocity > self.stage.maximum_velocity:
            raise EspError(100 * self.number + 10)
        before = self.commanded_velocity(now_ns)
        self.velocity = velocity
        if self._direction:
            self._go(self._direction, before, self.acceleration, now_ns)

    def permitted(self, acceleration: float) -> float:
        """Return an acceleration that the stage may have."""
        if acceleration > self.stage.maximum_acceleration:
            raise EspError(100 * self.number + 11)
        return acceleration

    def power(self, on: bool, now_ns: int) -> None:
        """Switch the motor; without power nothing is commanded, and the stage runs out by friction."""
        self.powered = on
        if on:
            return
        fault = self._faults.now(NoStop, now_ns)
        self._follow(0, 0.0, self.stage.friction, now_ns)
        if fault is None or fault.power != "stays":
            self._drive.command(0.0, self.stage.friction)

    def move(self, direction: int, now_ns: int) -> None:
        """Move indefinitely in a direction."""
        if not self.powered:
            raise EspError(100 * self.number + 13)
        self._go(direction, self.commanded_velocity(now_ns), self.acceleration, now_ns)

    def stop(self, now_ns: int) -> None:
        """Stop with the deceleration; the fault `no-stop` lets the stage continue."""
        self._follow(0, self.commanded_velocity(now_ns), self.deceleration, now_ns)
        if self._faults.now(NoStop, now_ns) is None:
            self._drive.command(0.0, self.deceleration)

    def apply(self, now_ns: int) -> None:
        """Give the drive what holds now: grip, and a stop that was withheld."""
        if self._drive.grip is not None:
            self._drive.grip.command(self._grip(now_ns))
        if not self._direction and self._faults.now(NoStop, now_ns) is None:
            self._drive.command(0.0, self._slope)

    def _grip(self, now_ns: int) -> float:
        if self._faults.now(Stalled, now_ns) is not None:
            return 0.0
        slipping = self._faults.now(Slipping, now_ns)
        return 1.0 if slipping is None else slipping.share

    def _target(self) -> float:
        return self._direction * self.velocity

    def _follow(self, direction: int, velocity: float, slope: float, now_ns: int) -> None:
        """Begin another trapezoid in the controller's mind."""
        self._direction, self._since_ns, self._from, self._slope = direction, now_ns, velocity, slope

    def _go(self, direction: int, velocity: float, slope: float, now_ns: int) -> None:
        self._follow(direction, velocity, slope, now_ns)
        self._drive.command(self._target(), slope)


_STATE = (
    "unit",
    "velocity",
    "acceleration",
    "deceleration",
    "powered",
    "_direction",
    "_since_ns",
    "_from",
    "_slope",
)
