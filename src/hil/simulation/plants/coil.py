"""A magnetorquer on an outer board, in the Earth's field: reverser, copper, field at the sensor."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import exp, inf, log
from types import MappingProxyType
from typing import Annotated, ClassVar

from hil.model.notation import AnyText, Flag, NotNegative, Positive, number, one_of, vector, whole
from hil.simulation.plants.magnetics import field_per_ampere, rotation
from hil.simulation.plants.model import PlantModel
from hil.simulation.plants.plant import Inputs, Plant, Port, Vector
from hil.simulation.truth import Truth, suggestion

__all__ = ["MODEL", "CoilAndEarthField", "CoilTruth", "EarthTruth", "build", "drive"]


def drive(
    current: float, volts: float, limit: float, *, ohms: float, henries: float, seconds: float
) -> tuple[float, float]:
    """Return the current after `seconds`, and the mean of its square in the meantime.

    L di/dt + R i = V is solved by i = V/R + (i0 - V/R) exp(-t R/L). The supply holds the current once
    it reaches the limit from either side: below it the full voltage drives the coil, above it none does.

    Args:
        current: A at the start, positive out of the supply.
        volts: V that the supply holds as long as the current stays below the limit.
        limit: A, at least 0.
        ohms: resistance, above 0.
        henries: inductance, above 0.
        seconds: how long, above 0.
    """
    tau = henries / ohms
    target, limited = volts / ohms, volts / ohms > limit
    until = seconds
    if limited:
        target = 0.0 if current > limit else target
        until = min(seconds, _time_to(limit, current, target, tau))
    decay = exp(-until / tau)
    after = target + (current - target) * decay
    square = _square(target, current - target, decay, tau, until)
    if limited and until < seconds:
        after = limit
        square += limit * limit * (seconds - until)
    return after, square / seconds


def _time_to(level: float, current: float, target: float, tau: float) -> float:
    """Return when a relaxation from `current` to `target` passes a level between them."""
    if level == target:
        return inf
    return tau * log((current - target) / (level - target))


def _square(target: float, gap: float, decay: float, tau: float, seconds: float) -> float:
    """Return the integral of (target + gap exp(-t/tau))^2 over `seconds`."""
    return target * target * seconds + 2 * target * gap * tau * (1 - decay) + gap * gap * tau / 2 * (1 - decay * decay)


_COPPER_PER_KELVIN = 0.00393  # at 20 degC, IEC 60028
_REFERENCE_TEMPERATURE = 20.0
_FIELDS = {f"field.{axis}": place for place, axis in enumerate("xyz")}
_SENSOR_NEEDS_VOLTS = 1.9
_SIGNALS = frozenset(
    (
        "voltage",
        "current",
        "winding_current",
        "temperature",
        "ambient",
        "outward",
        "sensor_power.voltage",
        "sensor_power.current",
        *_FIELDS,
    )
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CoilTruth:
    """One outer board's coil.

    Attributes:
        turns: number of turns.
        sides: lengths [m] along x and y of the jig.
        distance: from the coil's plane to the sensor, outwards [m].
        resistance: at 20 degC [ohm].
        inductance: [H].
        winding: `right`: current from ADCS to VCC_MAG makes a field along the outward normal; `left`: against it.
        broken: an open winding.
        heat_capacity: of the copper [J/K].
        thermal_resistance: copper to air [K/W].
    """

    turns: Annotated[int, whole(1)]
    sides: Annotated[tuple[float, float], vector(2, above=0)]
    distance: Positive
    resistance: Positive
    inductance: Positive = 1e-3
    winding: Annotated[str, one_of("left", "right")] = "right"
    broken: Flag = False
    heat_capacity: Positive = 5.0
    thermal_resistance: Positive = 40.0

    def ohms(self, temperature: float) -> float:
        """Return the resistance at a copper temperature [degC]."""
        return self.resistance * (1 + _COPPER_PER_KELVIN * (temperature - _REFERENCE_TEMPERATURE))


@dataclass(frozen=True, slots=True, kw_only=True)
class EarthTruth:
    """What is there without a coil.

    Attributes:
        earth_field: Earth's field in the jig's frame [uT].
        earth_drift: of that field [uT/s].
        misalignment: angles about x, y, z by which the sensor is turned in the jig [rad].
        sensor_offset: how far the sensor is off the axis in x and y [m].
        ambient: temperature of the air [degC].
        sensor_current: what the sensor draws [A].
        attached: the board on the jig at the epoch, empty for none.
    """

    earth_field: Annotated[tuple[float, float, float], vector(3)]
    earth_drift: Annotated[tuple[float, float, float], vector(3)] = (0.0, 0.0, 0.0)
    misalignment: Annotated[tuple[float, float, float], vector(3)] = (0.0, 0.0, 0.0)
    sensor_offset: Annotated[tuple[float, float], vector(2)] = (0.0, 0.0)
    ambient: Annotated[float, number(-273.15, 200)] = 20.0
    sensor_current: NotNegative = 4e-4
    attached: AnyText = ""


class CoilAndEarthField(Plant):
    """One coil at a time, fed through two changeover contacts; the outward normal of its board is +z.

    Both contacts released feed the coil forward, both energised feed it in reverse. One energised puts
    both ends on the same pole: the coil is shorted and the supply sees nothing. Without a board, or with
    a broken winding, the supply sees an open circuit. While contacts change the coil's current flows on.

    Signals: `voltage` and `current` as the supply sees them, `winding_current` [A] from ADCS to VCC_MAG,
    `temperature` of the copper, `ambient`, `field.x/y/z` [uT] in the sensor's frame, `outward` [uT]: what the
    coil alone adds along the board's outward normal, `sensor_power.voltage/current`.

    Args:
        name: the plant's name.
        grid_ns: distance of grid points.
        coil: the coil of every board that is not in `boards`.
        boards: the boards that exist, with their coils; empty accepts any name.
        earth: the surroundings.
    """

    ports: ClassVar[Mapping[str, Port]] = MappingProxyType(
        {
            "supply": Port("supply_voltage", "supply_current", "voltage", "current"),
            "sensor_power": Port(
                "sensor_power_voltage", "sensor_power_current", "sensor_power.voltage", "sensor_power.current"
            ),
        }
    )

    def __init__(
        self,
        name: str,
        grid_ns: int,
        *,
        coil: CoilTruth,
        boards: Mapping[str, CoilTruth],
        earth: EarthTruth,
    ) -> None:
        inputs: Inputs = {
            "supply_voltage": 0.0,
            "supply_current": 0.0,
            "contact_a": False,
            "contact_b": False,
            "board": earth.attached,
            "sensor_power_voltage": 0.0,
            "sensor_power_current": 0.0,
        }
        super().__init__(name, grid_ns, (0.0, earth.ambient), inputs, _SIGNALS)
        self._coil = coil
        self._boards = boards
        self._earth = earth
        turn = rotation(earth.misalignment)
        self._background = tuple(float(part) for part in turn @ earth.earth_field)
        self._drift = tuple(float(part) for part in turn @ earth.earth_drift)
        self._outward = {board: self._field(truth) for board, truth in {**boards, "": coil}.items()}
        self._sensed = {board: tuple(float(part) for part in turn @ field) for board, field in self._outward.items()}

    def choices(self, name: str) -> tuple[str, ...]:
        """Return the boards that exist, and the empty text for none."""
        return ("", *self._boards) if name == "board" and self._boards else ()

    def step(self, state: Vector, inputs: Inputs, dt: float) -> Vector:
        """Step current and copper; resistance is the one at the step's start, all else is exact."""
        current, temperature = state
        coil = self._connected(inputs)
        square, ohms = 0.0, 0.0
        if coil is not None:
            ohms = coil.ohms(temperature)
            direction = _direction(inputs)
            volts = float(inputs["supply_voltage"]) if direction else 0.0
            limit = float(inputs["supply_current"]) if direction else inf
            sign = direction or 1
            current, square = drive(sign * current, volts, limit, ohms=ohms, henries=coil.inductance, seconds=dt)
            current *= sign
        thermal = self._truth(inputs)
        final = self._earth.ambient + ohms * square * thermal.thermal_resistance
        decay = exp(-dt / (thermal.thermal_resistance * thermal.heat_capacity))
        return (current, final + (temperature - final) * decay)

    def commanded(self, state: Vector, before: Inputs, after: Inputs) -> Vector:
        """Another board brings a coil without current at the temperature of the air."""
        if before["board"] != after["board"]:
            return (0.0, self._earth.ambient)
        return state

    def signal(self, name: str, state: Vector, inputs: Inputs, at: float) -> float:
        """Return one of the signals of this plant."""
        current, temperature = state
        axis = _FIELDS.get(name)
        if axis is not None:
            coil = self._sensed[self._board(inputs)][axis] * current
            return self._background[axis] + self._drift[axis] * at + coil
        readers: Mapping[str, Callable[[], float]] = {
            "ambient": lambda: self._earth.ambient,
            "current": lambda: _direction(inputs) * current,
            "outward": lambda: self._outward[self._board(inputs)][2] * current,
            "sensor_power.current": lambda: self._sensor_supply(inputs)[1],
            "sensor_power.voltage": lambda: self._sensor_supply(inputs)[0],
            "temperature": lambda: temperature,
            "voltage": lambda: self._terminal_voltage(current, temperature, inputs),
            "winding_current": lambda: current,
        }
        return readers[name]()

    def _terminal_voltage(self, current: float, temperature: float, inputs: Inputs) -> float:
        volts, limit = float(inputs["supply_voltage"]), float(inputs["supply_current"])
        coil = self._connected(inputs)
        direction = _direction(inputs)
        if coil is None or not direction:
            return volts
        ohms = coil.ohms(temperature)
        limiting = volts / ohms > limit and direction * current >= limit
        return direction * current * ohms if limiting else volts

    def _sensor_supply(self, inputs: Inputs) -> tuple[float, float]:
        volts, limit = float(inputs["sensor_power_voltage"]), float(inputs["sensor_power_current"])
        if volts < _SENSOR_NEEDS_VOLTS:
            return (volts, 0.0)
        # A limit below what the sensor draws lets the voltage collapse.
        return (volts, self._earth.sensor_current) if limit >= self._earth.sensor_current else (0.0, limit)

    def _connected(self, inputs: Inputs) -> CoilTruth | None:
        truth = self._truth(inputs)
        return truth if inputs["board"] and not truth.broken else None

    def _truth(self, inputs: Inputs) -> CoilTruth:
        return self._boards.get(str(inputs["board"]), self._coil)

    def _board(self, inputs: Inputs) -> str:
        board = str(inputs["board"])
        return board if board in self._boards else ""

    def _field(self, coil: CoilTruth) -> tuple[float, float, float]:
        offset = self._earth.sensor_offset
        field = field_per_ampere(coil.turns, coil.sides, (offset[0], offset[1], coil.distance))
        sign = 1 if coil.winding == "right" else -1
        return (sign * float(field[0]), sign * float(field[1]), sign * float(field[2]))


def _direction(inputs: Inputs) -> int:
    """Return how the reverser connects the coil: 1 forward, -1 reverse, 0 shorted."""
    if inputs["contact_a"] != inputs["contact_b"]:
        return 0
    return -1 if inputs["contact_a"] else 1


def build(name: str, grid_ns: int, truth: Truth) -> CoilAndEarthField:
    """Build the plant from the truth section of a bench file.

    Raises:
        TruthError: with everything that is wrong in the section.
    """
    coil, earth = truth.part(CoilTruth), truth.part(EarthTruth)
    boards = {board: section.part(CoilTruth) for board, section in truth.sections("boards").items()}
    if boards and earth.attached not in {"", *boards}:
        truth.wrong("attached", f"unknown board '{earth.attached}'{suggestion(earth.attached, tuple(boards))}")
    truth.finish()
    return CoilAndEarthField(name, grid_ns, coil=coil, boards=boards, earth=earth)


MODEL = PlantModel(build=build)
"""The plant model `coil-and-earth-field`."""
