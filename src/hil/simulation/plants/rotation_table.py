"""A board on a rotation table: trapezoids of rate, ripple of the drive, tilt of the axis, the Earth's rate."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, radians, sin, sqrt
from types import MappingProxyType
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from hil.clock.port import NANOSECONDS
from hil.model.notation import Notation, Number, number, one_of, read_number, vector
from hil.simulation.plants.model import PlantModel
from hil.simulation.plants.plant import Inputs, Plant, Vector
from hil.simulation.truth import Truth

__all__ = ["MODEL", "RotationTable", "TableTruth", "build", "travelled"]


def travelled(
    rate: float, command: float, acceleration: float, elapsed: float | NDArray[np.float64]
) -> tuple[float | NDArray[np.float64], float | NDArray[np.float64]]:
    """Return the way and the rate after some time.

    The rate goes from `rate` to `command` at `acceleration` and stays there: w0 t + s a t^2 / 2 up to the end of the
    ramp, and the command times what is left after it.

    Args:
        rate: at the beginning [deg/s].
        command: where it goes [deg/s].
        acceleration: its size [deg/s2]; 0 keeps the rate.
        elapsed: time [s], not below 0; any shape.

    Returns:
        Way [deg] and rate [deg/s], both of the shape of `elapsed`.
    """
    if rate == command or not acceleration > 0:
        return rate * elapsed, rate + 0.0 * elapsed
    slope = acceleration if command > rate else -acceleration
    ramp = (command - rate) / slope
    ramping = np.minimum(elapsed, ramp)
    way = rate * ramping + slope * ramping * ramping / 2 + command * (elapsed - ramping)
    return way, np.where(elapsed < ramp, rate + slope * ramping, command)


_AXES = ("x", "y", "z")
_RATES = {f"rate.{axis}": place for place, axis in enumerate(_AXES)}
_SIGNALS = frozenset(("angle", "turns", "table_rate", *_RATES))
_TURN = 360.0
_SECONDS_PER_HOUR = 3600.0


def _per_hour(value: object) -> float:
    return read_number(value, 0, 100) / _SECONDS_PER_HOUR


@dataclass(frozen=True, slots=True, kw_only=True)
class TableTruth:
    """What the table really is.

    Attributes:
        ripple: relative amplitude of the rate, once per turn of the motor side.
        tilt: angles [rad] of the table's axis towards the two board axes that follow the mounted one cyclically.
        earth_rate: [deg/s], in files [deg/h]; 0 for a table on an Earth that does not turn.
        latitude: [deg], positive north; the table's axis points up.
        mounting: the board axis along the table's axis at the epoch.
        angle: of the table at the epoch [deg].
        slow_clock: by which share the bench's clock runs slow: the board turns by so much faster than angle over bench
            time tells.
    """

    ripple: Annotated[float, number(0, 0.5)] = 0.0
    tilt: Annotated[tuple[float, float], vector(2)] = (0.0, 0.0)
    earth_rate: Annotated[float, Notation(_per_hour, 0.0)] = 0.0
    latitude: Annotated[float, number(-90, 90)] = 0.0
    mounting: Annotated[str, one_of("x", "y", "z")] = "z"
    angle: Number = 0.0
    slow_clock: Annotated[float, number(-0.01, 0.01)] = 0.0


class RotationTable(Plant):
    """A table that follows a commanded rate with limited acceleration, exactly and whatever the grid.

    The state is (now, since, motor angle, motor rate, table angle): the last three are those of the instant `since` at
    which something was commanded, so that only `now` moves and interpolation is exact. With the motor's angle f, its
    rate w and the share g of it that grips, the table turns with g w (1 + e cos f): the ripple e comes once per turn,
    and its integral is g (f + e sin f).

    Inputs: `rate_command` [deg/s], `acceleration` [deg/s2], `grip` (1, less where the drive slips) and `mounting`.
    Signals: `angle` [deg] and `turns` of the table, `table_rate` [deg/s], `rate.x/y/z` [deg/s] in the board's frame.

    Args:
        name: the plant's name.
        grid_ns: distance of grid points.
        truth: what the table is.
        inputs: of what stands on it, besides its own.
        signals: likewise.
    """

    def __init__(
        self,
        name: str,
        grid_ns: int,
        truth: TableTruth,
        inputs: Inputs = MappingProxyType({}),
        signals: frozenset[str] = frozenset(),
    ) -> None:
        own: Inputs = {"rate_command": 0.0, "acceleration": 10.0, "grip": 1.0, "mounting": truth.mounting}
        state = (0.0, 0.0, truth.angle, 0.0, truth.angle)
        super().__init__(name, grid_ns, state, {**own, **inputs}, _SIGNALS | signals)
        self._truth = truth
        self._frames = {axis: _frame(place, truth.tilt) for place, axis in enumerate(_AXES)}
        latitude = radians(truth.latitude)
        self._resting: tuple[Vector, Inputs, dict[str, float]] = ((), {}, {})  # what a table at rest shows
        self._up, self._north = truth.earth_rate * sin(latitude), truth.earth_rate * cos(latitude)

    def choices(self, name: str) -> tuple[str, ...]:
        """Return the axes that the board can be mounted along."""
        return _AXES if name == "mounting" else ()

    def step(self, state: Vector, inputs: Inputs, dt: float) -> Vector:
        """Let time pass; the closed form does the rest."""
        del inputs
        return (state[0] + dt, *state[1:])

    def commanded(self, state: Vector, before: Inputs, after: Inputs) -> Vector:
        """Begin a new trapezoid where the old one has come to."""
        del after
        motor, rate = self._motor(state, before, state[0])
        return (state[0], state[0], float(motor), float(rate), float(self._angle(state, before, motor)))

    def signal(self, name: str, state: Vector, inputs: Inputs, at: float) -> float:
        """Return one of the signals of this plant."""
        return float(self._seen(name, state, inputs, at))

    def observe_many(self, signal: str, times_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return a signal at many rising instants of the last two seconds, in closed form."""
        if not times_ns.size:
            return np.empty(0)
        self._keep_up()
        first, last = int(times_ns[0]), int(times_ns[-1])
        moments = self._moments_between(first, last)
        if first < moments[0].at_ns or last > self._now_ns:
            raise ValueError(f"plant {self.name} cannot be observed at {first} to {last} ns, it is {self._now_ns} ns")
        # Grid points change nothing here: only a command begins another trapezoid.
        new = [place for place, item in enumerate(moments) if not place or item.inputs is not moments[place - 1].inputs]
        if len(new) == 1:
            return self._seen_many(signal, moments[0].state, moments[0].inputs, times_ns)
        # The moment of an instant is the last one before it: no command of that instant is seen yet.
        ends = [*np.searchsorted(times_ns, [moments[place].at_ns for place in new[1:]], side="right"), times_ns.size]
        begins = [0, *ends[:-1]]
        parts = [
            self._seen_many(signal, moments[place].state, moments[place].inputs, times_ns[begin:end])
            for place, begin, end in zip(new, begins, ends, strict=True)
        ]
        return np.concatenate(parts)

    def in_board(
        self, vector: tuple[float, float, float], state: Vector, inputs: Inputs, at: float
    ) -> tuple[float, float, float]:
        """Return in the board's frame what stands still outside: along 0 deg and 90 deg of the table, and up."""
        axis, forward, left = self._frames[str(inputs["mounting"])]
        motor, _ = self._motor(state, inputs, at)
        angle = radians(float(self._angle(state, inputs, motor)))
        ahead = vector[0] * cos(angle) + vector[1] * sin(angle)
        aside = vector[1] * cos(angle) - vector[0] * sin(angle)
        x, y, z = (
            vector[2] * axis[place] + ahead * forward[place] + aside * left[place] for place in range(len(_AXES))
        )
        return x, y, z

    def _seen_many(
        self, signal: str, state: Vector, inputs: Inputs, times_ns: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Return a signal at instants of one trapezoid; a table at rest is looked at once."""
        if not state[3] and not inputs["rate_command"]:
            if self._resting[:2] != (state[1:], inputs):
                self._resting = (state[1:], inputs, {})
            values = self._resting[2]
            if signal not in values:
                values[signal] = self.signal(signal, state, inputs, state[0])
            return np.full(times_ns.size, values[signal])
        return np.asarray(self._seen(signal, state, inputs, times_ns / NANOSECONDS), dtype=np.float64)

    def _seen(
        self, name: str, state: Vector, inputs: Inputs, at: float | NDArray[np.float64]
    ) -> float | NDArray[np.float64]:
        motor, rate = self._motor(state, inputs, at)
        if name in {"angle", "turns"}:
            angle = self._angle(state, inputs, motor)
            return angle if name == "angle" else angle / _TURN
        table_rate = float(inputs["grip"]) * rate * (1 + self._truth.ripple * np.cos(np.radians(motor)))
        if name == "table_rate":
            return table_rate
        place = _RATES[name]
        axis, forward, left = self._frames[str(inputs["mounting"])]
        seen = axis[place] * (table_rate * (1 + self._truth.slow_clock) + self._up)
        if self._north:
            angle = np.radians(self._angle(state, inputs, motor))
            seen = seen + self._north * (forward[place] * np.cos(angle) - left[place] * np.sin(angle))
        return seen

    def _motor(
        self, state: Vector, inputs: Inputs, at: float | NDArray[np.float64]
    ) -> tuple[float | NDArray[np.float64], float | NDArray[np.float64]]:
        _, since, angle, rate, _ = state
        way, now = travelled(rate, float(inputs["rate_command"]), float(inputs["acceleration"]), at - since)
        return angle + way, now

    def _angle(self, state: Vector, inputs: Inputs, motor: float | NDArray[np.float64]) -> float | NDArray[np.float64]:
        return state[4] + float(inputs["grip"]) * (self._rippled(motor) - self._rippled(state[2]))

    def _rippled(self, motor: float | NDArray[np.float64]) -> float | NDArray[np.float64]:
        return motor + self._truth.ripple * (180 / pi) * np.sin(np.radians(motor))


_Axis = tuple[float, float, float]


def _frame(place: int, tilt: tuple[float, float]) -> tuple[_Axis, _Axis, _Axis]:
    """Return the table's axis, and two directions across it (north and west at angle 0), in the board's frame."""
    axis = np.zeros(3)
    axis[[place, (place + 1) % 3, (place + 2) % 3]] = (1.0, *tilt)
    axis /= sqrt(float(axis @ axis))
    forward = np.zeros(3)
    forward[(place + 1) % 3] = 1.0
    forward -= axis * float(axis @ forward)
    forward /= sqrt(float(forward @ forward))
    rows = [[float(part) for part in row] for row in (axis, forward, np.cross(axis, forward))]
    return tuple((row[0], row[1], row[2]) for row in rows)  # type: ignore[return-value]  # there are three rows


def build(name: str, grid_ns: int, truth: Truth) -> RotationTable:
    """Build the plant from the truth section of a bench file.

    Raises:
        TruthError: with everything that is wrong in the section.
    """
    table = truth.part(TableTruth)
    truth.finish()
    return RotationTable(name, grid_ns, table)


MODEL = PlantModel(build=build)
"""The plant model `rotation-table`."""
