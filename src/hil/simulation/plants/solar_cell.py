"""A solar panel under a halogen lamp, on an electronic load, with a reference cell beside it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import exp, expm1, log1p
from types import MappingProxyType
from typing import Annotated, ClassVar

from hil.model.notation import Flag, NotNegative, Number, Positive, number
from hil.simulation.plants.model import PlantModel
from hil.simulation.plants.node import MODES
from hil.simulation.plants.plant import Inputs, Plant, Port, Sink, Vector
from hil.simulation.truth import Truth

__all__ = ["MODEL", "CellTruth", "LampTruth", "SolarCell", "build"]

_VOLTS_PER_KELVIN = 8.617333262e-5  # Boltzmann's constant over the elementary charge
_ZERO = 273.15
_GLOW, _CELL, _REFERENCE, _LIT = range(4)
_COLD_FILAMENT = 0.1  # of its resistance at the rated voltage
_BRIGHTNESS = 2.7  # exponent of a halogen lamp's light over its voltage, as the cells see it
_DIM = 1e-9
_BODY_DIODE_V, _STIFF_OHMS = 0.7, 1e-3
_HALVINGS = 60
_SIGNALS = frozenset(
    {"voltage", "current", "irradiance", "temperature", "ambient", "reference.current", "reference.temperature"}
    | {"load.voltage", "load.current"}
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CellTruth:
    """The panel: equal strings side by side, each of several junctions in series. All is at 1367 W/m^2 and 28 degC.

    Attributes:
        photocurrent: of all strings [A], and its change with the temperature, `photocurrent_drift` [A/K].
        open_voltage: without a shunt [V].
        junctions, ideality: how many are in series, and the ideality of each.
        gap: of all junctions together [eV]; from it follows how the voltage falls with the temperature.
        series, shunt: resistances of the whole panel [ohm].
        strings, broken: how many there are, and how many of them are interrupted.
        reversed: whether the leads are swapped.
        leads, least: of the leads, and of the load at its wide-open end [ohm]; the load senses at the panel.
    """

    photocurrent: Positive = 0.4
    photocurrent_drift: Number = 2.4e-4
    open_voltage: Positive = 2.7
    junctions: Positive = 3.0
    ideality: Positive = 1.2
    gap: Positive = 4.2
    series: NotNegative = 0.12
    shunt: Positive = 900.0
    strings: Positive = 2.0
    broken: NotNegative = 0.0
    reversed: Flag = False
    leads: NotNegative = 0.06
    least: Positive = 0.04


@dataclass(frozen=True, slots=True, kw_only=True)
class LampTruth:
    """The lamp, and what its light warms.

    Attributes:
        rated, hot: voltage [V] and resistance [ohm] at which it gives `irradiance` [W/m^2] at the panel.
        warm_up: time constant of the filament [s].
        droop: by which share its light falls in an hour.
        stray: light that is always there [W/m^2].
        ambient: of the room [degC].
        rise, reference_rise: of panel and reference cell under `irradiance` [K], with the time constant `tau` [s].
        sensitivity: of the reference cell [A m^2/W] at 25 degC, and its change `reference_drift` [1/K].
        shade: share of the light that the reference cell does not get, but the panel does.
    """

    rated: Positive = 24.0
    hot: Positive = 12.0
    irradiance: Positive = 1290.0
    warm_up: Positive = 0.4
    droop: Number = 0.004
    stray: NotNegative = 0.4
    ambient: Annotated[float, number(-60, 80)] = 22.0
    rise: NotNegative = 17.0
    reference_rise: NotNegative = 9.0
    tau: Positive = 90.0
    sensitivity: Positive = 2.0e-5
    reference_drift: Number = 5e-4
    shade: Number = 0.0


class SolarCell(Plant):
    """One diode for all junctions, a current source, a series and a shunt resistance.

    With v the voltage at the diode, `I = L - S (exp(v / u) - 1) - v / Rp` and `V = v - I Rs`, where
    u = junctions * ideality * k T / q. The saturation current S goes with T^(3/ideality) exp(-gap / (u T)).

    Port `supply` of the lamp, sink `load`. The input `contact` is closed until a relay drives it. Signals: `voltage`
    [V] and `current` [A] at the lamp; `irradiance` [W/m^2]; `temperature` of the panel, `reference.temperature` and
    `ambient` [degC]; `reference.current` [A]; `load.voltage` and `load.current` at the panel.

    Args:
        name: the plant's name.
        grid_ns: distance of grid points.
        cell: the panel.
        lamp: the lamp, and what it warms.
    """

    ports: ClassVar[Mapping[str, Port]] = MappingProxyType({"supply": Port("given", "limit", "voltage", "current")})
    sinks: ClassVar[Mapping[str, Sink]] = MappingProxyType(
        {"load": Sink("mode", "level", "load.voltage", "load.current")}
    )

    def __init__(self, name: str, grid_ns: int, cell: CellTruth, lamp: LampTruth) -> None:
        inputs: Inputs = {"given": 0.0, "limit": 0.0, "contact": True, "mode": "", "level": 0.0}
        super().__init__(name, grid_ns, (0.0, lamp.ambient, lamp.ambient, 0.0), inputs, _SIGNALS)
        self._cell = cell
        self._lamp = lamp

    def choices(self, name: str) -> tuple[str, ...]:
        """Return the modes of a load."""
        return MODES if name == "mode" else ()

    def step(self, state: Vector, inputs: Inputs, dt: float) -> Vector:
        """Step the filament, both temperatures and the time for which the lamp was on."""
        lamp, (glow, cell, reference, lit) = self._lamp, state
        volts, _ = self._lamp_point(glow, inputs)
        light = self._irradiance(state) / lamp.irradiance
        slow = -expm1(-dt / lamp.tau)
        aim = volts / lamp.rated
        glow += (aim - glow) * -expm1(-dt / lamp.warm_up)
        return (
            glow if glow > _DIM else 0.0,
            cell + (lamp.ambient + lamp.rise * light - cell) * slow,
            reference + (lamp.ambient + lamp.reference_rise * light - reference) * slow,
            lit + dt if aim > 0.1 else 0.0,
        )

    def signal(self, name: str, state: Vector, inputs: Inputs, at: float) -> float:
        """Return one of the signals of this plant."""
        del at
        if name.startswith("load."):
            return self._load_point(state, inputs)[name == "load.current"]
        readers: Mapping[str, Callable[[], float]] = {
            "voltage": lambda: self._lamp_point(state[_GLOW], inputs)[0] if inputs["contact"] else inputs["given"],  # type: ignore[dict-item,return-value]
            "current": lambda: self._lamp_point(state[_GLOW], inputs)[1],
            "irradiance": lambda: self._irradiance(state),
            "temperature": lambda: state[_CELL],
            "ambient": lambda: self._lamp.ambient,
            "reference.temperature": lambda: state[_REFERENCE],
            "reference.current": lambda: self._reference(state),
        }
        return float(readers[name]())

    def _lamp_point(self, glow: float, inputs: Inputs) -> tuple[float, float]:
        """Return voltage [V] and current [A] of the lamp."""
        if not inputs["contact"]:
            return 0.0, 0.0
        ohms = self._lamp.hot * (_COLD_FILAMENT + (1.0 - _COLD_FILAMENT) * glow)
        amperes = max(0.0, min(float(inputs["given"]) / ohms, float(inputs["limit"])))
        return amperes * ohms, amperes

    def _irradiance(self, state: Vector) -> float:
        lamp = self._lamp
        faded = max(0.0, 1.0 - lamp.droop * state[_LIT] / 3600.0)
        return lamp.stray + lamp.irradiance * faded * float(max(0.0, state[_GLOW]) ** _BRIGHTNESS)

    def _reference(self, state: Vector) -> float:
        lamp = self._lamp
        warmth = 1.0 + lamp.reference_drift * (state[_REFERENCE] - 25.0)
        return lamp.sensitivity * self._irradiance(state) * warmth * (1.0 - lamp.shade)

    def _load_point(self, state: Vector, inputs: Inputs) -> tuple[float, float]:
        """Return voltage [V] and current [A] of the load, by halving the diode's voltage until both currents agree."""
        cell = self._cell
        share = max(0.0, 1.0 - cell.broken / cell.strings)
        kelvin, base = state[_CELL] + _ZERO, 28.0 + _ZERO
        unit = cell.junctions * cell.ideality * _VOLTS_PER_KELVIN
        source = share * self._irradiance(state) / 1367.0
        source *= cell.photocurrent + cell.photocurrent_drift * (kelvin - base)
        saturation = share * cell.photocurrent / expm1(cell.open_voltage / (unit * base))
        growth = cell.gap / unit * (1.0 / base - 1.0 / kelvin)
        saturation *= (kelvin / base) ** (3.0 / cell.ideality) * exp(growth)
        if source <= 0.0:
            return 0.0, 0.0
        low, high = 0.0, unit * kelvin * log1p(source / saturation)
        for _ in range(_HALVINGS):
            diode = (low + high) / 2.0
            amperes = source - saturation * expm1(diode / (unit * kelvin)) - diode * share / cell.shunt
            volts = diode - amperes * cell.series / share
            low, high = (diode, high) if amperes > self._drawn(volts, inputs) else (low, diode)
        return (-volts, -amperes) if cell.reversed else (volts, amperes)

    def _drawn(self, volts: float, inputs: Inputs) -> float:
        """Return the current into the load [A] at this voltage of the panel; the other way round its body diode."""
        wide_open = volts / (self._cell.leads + self._cell.least)
        if self._cell.reversed:
            return max(0.0, (volts - _BODY_DIODE_V) / self._cell.leads)
        if volts <= 0.0:
            return 0.0
        level = float(inputs["level"])
        wanted = {
            "": 0.0,
            "CC": level,
            "CR": volts / level if level > 0.0 else wide_open,
            "CP": level / volts,
            "CV": max(0.0, volts - level) / _STIFF_OHMS,
        }
        return min(wide_open, wanted[str(inputs["mode"])])


def build(name: str, grid_ns: int, truth: Truth) -> SolarCell:
    """Build the plant from its truth.

    Raises:
        TruthError: with everything that is wrong.
    """
    cell, lamp = truth.part(CellTruth), truth.part(LampTruth)
    if cell.broken >= cell.strings:
        truth.wrong("broken", "must be less than the number of strings")
    truth.finish()
    return SolarCell(name, grid_ns, cell, lamp)


MODEL = PlantModel(build=build)
"""The plant model `solar-cell`."""
