"""A magnetometer on a rotation table inside a pair of Helmholtz coils: ambient field, iron, and what disturbs them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from math import hypot
from types import MappingProxyType
from typing import Annotated, ClassVar

from hil.model.notation import AnyText, Flag, NotNegative, Number, Positive, number, one_of, vector, whole
from hil.simulation.plants.model import PlantModel
from hil.simulation.plants.plant import Inputs, Port, Vector
from hil.simulation.plants.rotation_table import RotationTable, TableTruth
from hil.simulation.truth import Truth, suggestion

__all__ = ["MODEL", "CageTruth", "DistortionTruth", "HelmholtzTable", "build", "per_ampere"]

_MU_0 = 1.25663706127  # uT m/A
_NOTHING = (0.0, 0.0, 0.0)
_WHOLE = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
_AXES = "xyz"
_FIELDS = {f"field.{axis}": place for place, axis in enumerate(_AXES)}
_REFERENCES = {f"reference.{axis}": place for place, axis in enumerate(_AXES)}
_SIGNALS = frozenset(
    (
        *(*_FIELDS, *_REFERENCES),
        *("voltage", "current", "winding_current", "ambient", "sensor_power.voltage", "sensor_power.current"),
    )
)
_SENSORS_NEED_VOLTS = 1.9
_Three = Annotated[tuple[float, float, float], vector(3)]


def per_ampere(turns: float, radius: float, separation: float) -> float:
    """Return the field [uT/A] in the middle between two coaxial coils of as many turns each [m]."""
    return _MU_0 * turns * radius**2 / hypot(radius, separation / 2) ** 3


@dataclass(frozen=True, slots=True, kw_only=True)
class CageTruth:
    """Coils and surroundings, in the frame of the table: along its 0 deg, along its 90 deg, up.

    Attributes:
        turns: of each of the two coils.
        radius: [m].
        separation: of their planes [m]; the radius where nothing is said.
        resistance: of both in series [ohm].
        winding: `right`: current from contact a to contact b makes a field up; `left`: down.
        broken: an open winding.
        lean: horizontal parts of the coils' axis, of length 1.
        ambient_field: the field without coils [uT].
        ambient_drift: of that field [uT/s].
        ambient: temperature of the air [degC].
        sensor_current: what both sensors draw [A].
        motor_field: what the table's motor adds while it drives [uT].
        iron: what iron adds that somebody brings near [uT].
        iron_from: when [s].
        iron_at_reference: which share of it the reference sees.
        article: what distorts the field at the epoch, one of `articles`; empty for the device as it is.
    """

    turns: Annotated[int, whole(1)]
    radius: Positive
    separation: NotNegative = 0.0
    resistance: Positive
    winding: Annotated[str, one_of("left", "right")] = "right"
    broken: Flag = False
    lean: Annotated[tuple[float, float], vector(2)] = (0.0, 0.0)
    ambient_field: _Three
    ambient_drift: _Three = _NOTHING
    ambient: Annotated[float, number(-273.15, 200)] = 20.0
    sensor_current: NotNegative = 8e-4
    motor_field: _Three = _NOTHING
    iron: _Three = _NOTHING
    iron_from: NotNegative = 0.0
    iron_at_reference: Number = 0.5
    article: AnyText = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class DistortionTruth:
    """What the surroundings on the board make of the field at the sensor: soft · field + hard.

    Attributes:
        soft: nine numbers, row by row.
        hard: [uT].
    """

    soft: Annotated[tuple[float, ...], vector(9)] = field(default=_WHOLE)
    hard: _Three = _NOTHING


class HelmholtzTable(RotationTable):
    """A rotation table whose axis points up along the axis of two coils, fed through two changeover contacts.

    Both contacts released feed the coils forward, both energised in reverse; one alone shorts both ends to one pole,
    and the supply sees nothing. The current follows at once: time constants of milliseconds are over before anything
    is measured.

    Signals besides those of the table: `field.x/y/z` [uT] at the sensor on the board, distorted by the article;
    `reference.x/y/z` [uT] of a sensor that stands still below the table, in the table's frame; `voltage` and `current`
    as the supply sees them, `winding_current`, `ambient`, `sensor_power.voltage/current`.

    Args:
        name: the plant's name.
        grid_ns: distance of grid points.
        table: what the table is.
        cage: coils and surroundings.
        articles: what can distort the field, by name; the empty name is the device as it is.
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
        self, name: str, grid_ns: int, *, table: TableTruth, cage: CageTruth, articles: Mapping[str, DistortionTruth]
    ) -> None:
        inputs: Inputs = {
            "supply_voltage": 0.0,
            "supply_current": 0.0,
            "contact_a": False,
            "contact_b": False,
            "sensor_power_voltage": 0.0,
            "sensor_power_current": 0.0,
            "article": cage.article,
        }
        super().__init__(name, grid_ns, table, inputs, _SIGNALS)
        self._cage = cage
        self._articles = articles
        size = per_ampere(cage.turns, cage.radius, cage.separation or cage.radius)
        size *= 1 if cage.winding == "right" else -1
        length = hypot(1.0, *cage.lean)
        self._coil = (size * cage.lean[0] / length, size * cage.lean[1] / length, size / length)

    def choices(self, name: str) -> tuple[str, ...]:
        """Return the mountings, and the articles."""
        return tuple(self._articles) if name == "article" else super().choices(name)

    def signal(self, name: str, state: Vector, inputs: Inputs, at: float) -> float:
        """Return one of the signals of this plant."""
        place = _FIELDS.get(name)
        if place is not None:
            return self._distorted(place, state, inputs, at)
        place = _REFERENCES.get(name)
        if place is not None:
            return self._outside(inputs, at, self._cage.iron_at_reference, driving=False)[place]
        readers: Mapping[str, Callable[[], float]] = {
            "ambient": lambda: self._cage.ambient,
            "current": lambda: self._fed(inputs)[1],
            "voltage": lambda: self._fed(inputs)[0],
            "winding_current": partial(self._winding, inputs),
            "sensor_power.voltage": lambda: self._sensors(inputs)[0],
            "sensor_power.current": lambda: self._sensors(inputs)[1],
        }
        return readers[name]() if name in readers else super().signal(name, state, inputs, at)

    def _distorted(self, place: int, state: Vector, inputs: Inputs, at: float) -> float:
        driving = bool(inputs["rate_command"])
        seen = self.in_board(self._outside(inputs, at, 1.0, driving=driving), state, inputs, at)
        article = self._articles[str(inputs["article"])]
        row = article.soft[3 * place : 3 * place + 3]
        return sum(each * part for each, part in zip(row, seen, strict=True)) + article.hard[place]

    def _outside(self, inputs: Inputs, at: float, iron: float, *, driving: bool) -> tuple[float, float, float]:
        """Return the field in the table's frame, with a share of the iron where it is there."""
        cage, current = self._cage, self._winding(inputs)
        share = iron if at >= cage.iron_from else 0.0
        motor = 1.0 if driving else 0.0
        x, y, z = (
            cage.ambient_field[place]
            + cage.ambient_drift[place] * at
            + self._coil[place] * current
            + cage.motor_field[place] * motor
            + cage.iron[place] * share
            for place in range(len(_AXES))
        )
        return x, y, z

    def _winding(self, inputs: Inputs) -> float:
        if inputs["contact_a"] != inputs["contact_b"]:
            return 0.0
        return -self._fed(inputs)[1] if inputs["contact_a"] else self._fed(inputs)[1]

    def _fed(self, inputs: Inputs) -> tuple[float, float]:
        """Return voltage and current of the supply."""
        volts, limit = float(inputs["supply_voltage"]), float(inputs["supply_current"])
        if self._cage.broken or inputs["contact_a"] != inputs["contact_b"]:
            return volts, 0.0
        current = min(volts / self._cage.resistance, limit)
        return current * self._cage.resistance, current

    def _sensors(self, inputs: Inputs) -> tuple[float, float]:
        volts, limit = float(inputs["sensor_power_voltage"]), float(inputs["sensor_power_current"])
        if volts < _SENSORS_NEED_VOLTS:
            return volts, 0.0
        return (volts, self._cage.sensor_current) if limit >= self._cage.sensor_current else (0.0, limit)


def build(name: str, grid_ns: int, truth: Truth) -> HelmholtzTable:
    """Build the plant from the truth section of a bench file.

    Raises:
        TruthError: with everything that is wrong in the section.
    """
    table, cage = truth.part(TableTruth), truth.part(CageTruth)
    own = truth.part(DistortionTruth)
    articles = {each: section.part(DistortionTruth) for each, section in truth.sections("articles").items()}
    articles = {"": own, **articles}
    if cage.article not in articles:
        truth.wrong("article", f"unknown article '{cage.article}'{suggestion(cage.article, tuple(articles))}")
    truth.finish()
    return HelmholtzTable(name, grid_ns, table=table, cage=cage, articles=articles)


MODEL = PlantModel(build=build)
"""The plant model `helmholtz-table`."""
