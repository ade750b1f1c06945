"""A photodiode under a halogen lamp in a black box that hot air warms, its loads, and a monitor of the lamp."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log1p
from typing import Annotated

from hil.model.notation import NotNegative, Number, Positive, number, one_of
from hil.simulation.plants.model import PlantModel
from hil.simulation.plants.plant import Inputs, Plant, Vector
from hil.simulation.truth import Truth

__all__ = ["MODEL", "BoxTruth", "PhotodiodeBox", "build"]

_ELEMENTARY, _BOLTZMANN = 1.602176634e-19, 1.380649e-23  # C, J/K; exact in the SI
_ZERO, _NOMINAL = 273.15, 298.15  # K
_BOX, _JUNCTION, _SENSOR, _GLOW, _BURNT = range(5)
_TEMPERATURES = {"box": _BOX, "junction": _JUNCTION, "temperature": _SENSOR}
_SIGNALS = frozenset((*_TEMPERATURES, "ambient", "photodiode", "monitor", "reference"))
_HOUR = 3600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class BoxTruth:
    """What box, lamp and photodiode are. The defaults heat the box from 13 to 36 degC within an hour and a quarter.

    Attributes:
        ambient: temperature of the room, and of everything at the epoch [degC].
        capacity: of the box with what is in it [J/K].
        conductance: from the box to the room [W/K].
        lamp_heat, dryer_heat: what lamp and hair dryer give to the box [W].
        junction_lag, sensor_lag: time constants with which photodiode and thermometer follow the box [s].
        lamp: output of the lamp, 1 for a good one and 0 for a burnt one.
        droop: what the lamp loses per hour of burning, relative.
        leak: light from outside that the photodiode sees, relative to a good lamp.
        photocurrent: at 25 degC under the lamp [A].
        coefficient: of the photocurrent over temperature [1/K].
        saturation: current at 25 degC [A].
        emission: ideality factor.
        gap: of the semiconductor at these temperatures [eV].
        shunt, series: resistances of the photodiode [ohm].
        state: `good`, `shorted` or `open`.
        load: resistor at the photodiode [ohm].
        middle, low: resistors that contacts put beside it [ohm].
        monitor: voltage of the second photodiode under a good lamp [V]; it stays at room temperature.
        reference: voltage that the meter sees at the converter's reference pin [V].
        offset: how much more the thermometer shows [K].
    """

    ambient: Annotated[float, number(-60, 80)] = 13.0
    capacity: Positive = 1500.0
    conductance: Positive = 1.0
    lamp_heat: NotNegative = 10.0
    dryer_heat: NotNegative = 18.0
    junction_lag: Positive = 8.0
    sensor_lag: Positive = 12.0
    lamp: NotNegative = 1.0
    droop: Annotated[float, number(-1, 1)] = 0.002
    leak: NotNegative = 0.0
    photocurrent: Positive = 45e-6
    coefficient: Annotated[float, number(-0.05, 0.05)] = 0.0012
    saturation: Positive = 1e-9
    emission: Positive = 1.25
    gap: Positive = 1.12
    shunt: Positive = 100e6
    series: NotNegative = 20.0
    state: Annotated[str, one_of("good", "shorted", "open")] = "good"
    load: Positive = 20e3
    middle: Positive = 8.2e3
    low: Positive = 3.3e3
    monitor: NotNegative = 1.6
    reference: Positive = 3.3
    offset: Number = 0.0


class PhotodiodeBox(Plant):
    """Temperatures of box, junction and thermometer, the filament's glow, and hours of burning.

    `C T' = P_lamp + P_dryer - G (T - T_room)`; junction and thermometer follow with first-order lags; the glow follows
    the switch within a second. Every step is exact for the box, and uses its mean for what follows it.

    The junction's voltage solves `I_ph - I_s (exp(V/(n kT/q)) - 1) - V/R_sh = V / (R_s + R)` by bisection, so that no
    property of the equation but its sign is used.

    Inputs: `lamp`, `dryer`, `middle` and `low`, for relay contacts. Signals: `box`, `junction`, `temperature` (what the
    thermometer shows) and `ambient` [degC]; `photodiode`, `monitor` and `reference` [V].

    Args:
        name: the plant's name.
        grid_ns: distance of grid points.
        truth: what it is made of.
    """

    def __init__(self, name: str, grid_ns: int, truth: BoxTruth) -> None:
        inputs: Inputs = dict.fromkeys(("lamp", "dryer", "middle", "low"), False)
        super().__init__(name, grid_ns, (truth.ambient,) * 3 + (0.0, 0.0), inputs, _SIGNALS)
        self._truth = truth

    def step(self, state: Vector, inputs: Inputs, dt: float) -> Vector:
        """Step everything by `dt`."""
        truth = self._truth
        burning = bool(inputs["lamp"])
        heat = truth.lamp_heat * truth.lamp * burning + truth.dryer_heat * bool(inputs["dryer"])
        end = truth.ambient + heat / truth.conductance
        box = end + (state[_BOX] - end) * exp(-dt * truth.conductance / truth.capacity)
        mean = (state[_BOX] + box) / 2
        junction, sensor = (
            mean + (state[place] - mean) * exp(-dt / lag)
            for place, lag in ((_JUNCTION, truth.junction_lag), (_SENSOR, truth.sensor_lag))
        )
        glow = burning + (state[_GLOW] - burning) * exp(-dt)
        return box, junction, sensor, glow, state[_BURNT] + dt / _HOUR * burning

    def signal(self, name: str, state: Vector, inputs: Inputs, at: float) -> float:
        """Return a temperature or a voltage."""
        del at
        truth = self._truth
        if name in _TEMPERATURES:
            return state[_TEMPERATURES[name]] + (truth.offset if name == "temperature" else 0.0)
        if name in {"ambient", "reference"}:
            return truth.ambient if name == "ambient" else truth.reference
        lit = truth.lamp * state[_GLOW] * (1.0 - truth.droop * state[_BURNT])
        if name == "monitor":
            return truth.monitor * lit
        return self._volts(lit + truth.leak, state[_JUNCTION] + _ZERO, inputs)

    def _volts(self, lit: float, kelvin: float, inputs: Inputs) -> float:
        """Return the voltage at the load for a light and the junction's temperature."""
        truth = self._truth
        if truth.state != "good":
            return 0.0
        ohms = 1.0 / (1.0 / truth.load + bool(inputs["middle"]) / truth.middle + bool(inputs["low"]) / truth.low)
        thermal = truth.emission * _BOLTZMANN * kelvin / _ELEMENTARY
        barrier = truth.gap * _ELEMENTARY / _BOLTZMANN * (1.0 / _NOMINAL - 1.0 / kelvin)
        dark = truth.saturation * ((kelvin / _NOMINAL) ** 3 * exp(barrier)) ** (1.0 / truth.emission)
        given = truth.photocurrent * lit * (1.0 + truth.coefficient * (kelvin - _NOMINAL))
        below, above = 0.0, thermal * log1p(given / dark) if given > 0.0 else 0.0
        for _ in range(48):
            middle = (below + above) / 2
            left = given - dark * (exp(middle / thermal) - 1.0) - middle / truth.shunt - middle / (truth.series + ohms)
            below, above = (middle, above) if left > 0.0 else (below, middle)
        return below * ohms / (truth.series + ohms)


def build(name: str, grid_ns: int, truth: Truth) -> PhotodiodeBox:
    """Build the plant from its truth.

    Raises:
        TruthError: with everything that is wrong.
    """
    box = truth.part(BoxTruth)
    truth.finish()
    return PhotodiodeBox(name, grid_ns, box)


MODEL = PlantModel(build=build)
"""The plant model `photodiode-box`."""
