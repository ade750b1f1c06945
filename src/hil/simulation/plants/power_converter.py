"""A board with a converter: contact and leads, an input capacitor that charges, a soft start, a rail with a load."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, inf, log
from operator import itemgetter
from types import MappingProxyType
from typing import Annotated, ClassVar

from hil.model.notation import NotNegative, Positive, number
from hil.simulation.plants.model import PlantModel
from hil.simulation.plants.node import MODES, Load, Source, operating_point
from hil.simulation.plants.plant import Inputs, Plant, Port, Sink, Vector
from hil.simulation.truth import Truth

__all__ = ["MODEL", "ConverterTruth", "InputTruth", "PowerConverter", "build"]

_MOST_REGIMES = 16
"""In one grid step; each has its own solution."""
_EMPTY = 1e-6
"""A capacitor with less [V] is empty."""

_RAMPS = 40.0
"""After so many time constants the ramp is over to the last digit."""

_BEGUN = 1e-12
"""Time since the input was high enough, at the instant at which it becomes so."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InputTruth:
    """What lies between supply and converter.

    Attributes:
        leads: resistance of the leads, and of a meter in them [ohm].
        contact: resistance of the closed contact [ohm].
        limiter: in the way of the charge until the converter starts, then bypassed [ohm]; 0 for none.
        capacitance: of the input capacitor [F].
        esr: its series resistance [ohm].
        bleeder: resistor across it [ohm].
    """

    leads: Positive = 0.05
    contact: NotNegative = 0.02
    limiter: NotNegative = 3.0
    capacitance: Positive = 220e-6
    esr: NotNegative = 0.03
    bleeder: Positive = 2200.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ConverterTruth:
    """The converter, from its input capacitor to the rail.

    Attributes:
        starts: input voltage above which it starts [V].
        stops: input voltage below which it stops [V].
        delay: from there to the start of its ramp [s].
        rise: time constant of the ramp [s].
        voltage: of the rail without a load [V].
        output_resistance: by which the rail comes down under load [ohm].
        current_limit: the most that the rail gives [A].
        foldback: share of it that is left in overload; 1 keeps it constant.
        quiescent: what it draws from its input without a load [A].
        proportional_loss: share of the output's power that is lost on the way.
        loss_resistance: its losses over the square of the output's current [ohm].
    """

    starts: Positive = 6.0
    stops: Positive = 5.5
    delay: Positive = 0.02
    rise: Positive = 0.025
    voltage: Positive = 5.05
    output_resistance: NotNegative = 0.02
    current_limit: Positive = 3.0
    foldback: Annotated[float, number(0, 1)] = 0.3
    quiescent: NotNegative = 0.006
    proportional_loss: NotNegative = 0.06
    loss_resistance: NotNegative = 0.08


class PowerConverter(Plant):
    """A converter with an input capacitor that a supply charges through leads, a contact and a limiter.

    Until the converter starts, the capacitor charges as one of a series circuit does; the supply's current limit is
    slower than that, and holds from the start on. Afterwards the converter draws the power of its rail and its losses,
    taken from the beginning of each grid step; all else is exact, whatever the grid. Nothing flows back into the
    supply.

    Port `supply`, sink `load`. The input `contact` is closed until a relay drives it.

    Signals: `voltage` [V] and `current` [A] at the supply; `input.voltage` [V] of the capacitor; `load.voltage` [V] and
    `load.current` [A] at the rail.

    Args:
        name: the plant's name.
        grid_ns: distance of grid points.
        entry: what lies before the converter.
        truth: the converter.
    """

    ports: ClassVar[Mapping[str, Port]] = MappingProxyType({"supply": Port("given", "limit", "voltage", "current")})
    sinks: ClassVar[Mapping[str, Sink]] = MappingProxyType(
        {"load": Sink("mode", "level", "load.voltage", "load.current")}
    )

    def __init__(self, name: str, grid_ns: int, entry: InputTruth, truth: ConverterTruth) -> None:
        inputs: Inputs = {"given": 0.0, "limit": 0.0, "contact": True, "mode": "", "level": 0.0}
        signals = frozenset({"current", "voltage", "input.voltage", "load.current", "load.voltage"})
        super().__init__(name, grid_ns, (0.0, 0.0), inputs, signals)
        self._entry = entry
        self._truth = truth

    def choices(self, name: str) -> tuple[str, ...]:
        """Return the modes of a load."""
        return MODES if name == "mode" else ()

    def step(self, state: Vector, inputs: Inputs, dt: float) -> Vector:
        """Return the capacitor's voltage [V] and the time since the input was high enough [s]."""
        volts, age = state
        draw = self._draw(volts, age, inputs)
        for _ in range(_MOST_REGIMES):
            if dt <= 0.0:
                break
            volts, age, dt = self._within_regime(volts, age, inputs, draw, dt)
        # A board at rest shall have a state that no longer changes, so that nothing has to be computed for it.
        return volts if volts > _EMPTY else 0.0, min(age, self._truth.delay + _RAMPS * self._truth.rise)

    def signal(self, name: str, state: Vector, inputs: Inputs, at: float) -> float:
        """Return voltage or current at the supply, at the capacitor, or at the load."""
        del at
        volts, age = state
        if name == "input.voltage":
            return volts
        if name.startswith("load."):
            node, drawn = self._rail(age, inputs)
            return node if name == "load.voltage" else drawn
        amperes = self._into(volts, age, inputs)
        if name == "current":
            return amperes
        given = float(inputs["given"])
        if not inputs["contact"]:
            return given
        return volts if volts > given else min(given, volts + amperes * self._ohms(age))

    def _ohms(self, age: float) -> float:
        entry = self._entry
        way = entry.leads + entry.contact
        return way if age >= self._truth.delay else way + entry.limiter + entry.esr

    def _into(self, volts: float, age: float, inputs: Inputs) -> float:
        """Return the current out of the supply [A]."""
        if not inputs["contact"]:
            return 0.0
        amperes = max(0.0, (float(inputs["given"]) - volts) / self._ohms(age))
        return min(amperes, float(inputs["limit"])) if age >= self._truth.delay else amperes

    def _rail(self, age: float, inputs: Inputs) -> tuple[float, float]:
        """Return the rail's voltage [V], and the current into the load [A]."""
        truth = self._truth
        ramp = 1.0 - exp(-(age - truth.delay) / truth.rise) if age > truth.delay else 0.0
        source = Source(truth.voltage * ramp, truth.current_limit, truth.output_resistance)
        load = Load(str(inputs["mode"]), float(inputs["level"]))
        node, given, drawn = operating_point(source, load)
        if given >= truth.current_limit:
            folded = Source(source.volts, truth.current_limit * truth.foldback, source.ohms)
            node, _, drawn = operating_point(folded, load)
        return node, drawn

    def _draw(self, volts: float, age: float, inputs: Inputs) -> float:
        """Return what the converter draws from its capacitor [A]."""
        truth = self._truth
        if age < truth.delay or volts <= 0.0:
            return 0.0
        node, drawn = self._rail(age, inputs)
        watts = node * drawn * (1.0 + truth.proportional_loss) + truth.loss_resistance * drawn * drawn
        return truth.quiescent + watts / volts

    def _within_regime(
        self, volts: float, age: float, inputs: Inputs, draw: float, dt: float
    ) -> tuple[float, float, float]:
        """Go on until the present regime ends, or for all of `dt`; return voltage, age and the time that is left.

        In each regime C dV/dt = a - k V, solved by V = a/k + (V0 - a/k) exp(-t k/C).
        """
        truth, on, started = self._truth, age > 0.0, age >= self._truth.delay
        leak, ohms, draw = 1.0 / self._entry.bleeder, self._ohms(age), draw if started else 0.0
        given = float(inputs["given"]) if inputs["contact"] else 0.0
        limit = float(inputs["limit"]) if started else inf
        breaks = (given - limit * ohms, given)  # the supply limits below the first, and gives nothing above the second
        rising = self._into(volts, age, inputs) - leak * volts - draw > 0.0
        place = (bisect_right if rising else bisect_left)(breaks, volts)
        rate = (leak, leak + 1.0 / ohms, leak)[place]
        final = ((limit if place == 0 else given / ohms if place == 1 else 0.0) - draw) / rate
        tau = self._entry.capacitance / rate
        threshold = truth.stops if on else truth.starts
        ends = {bound: _reached(volts, final, bound, tau) for bound in (*breaks, threshold)}
        bound, lasts = min(ends.items(), key=itemgetter(1))
        wait = truth.delay - age if on and not started else inf
        if min(lasts, wait) >= dt:
            return final + (volts - final) * exp(-dt / tau), age + dt if on else 0.0, 0.0
        if wait < lasts:
            return final + (volts - final) * exp(-wait / tau), truth.delay, dt - wait
        if bound == threshold:
            return bound, 0.0 if on else _BEGUN, dt - lasts
        return bound, age + lasts if on else 0.0, dt - lasts


def _reached(volts: float, final: float, bound: float, tau: float) -> float:
    """Return when a relaxation passes a bound on its way, infinite where it does not."""
    ahead = final < bound < volts if final < volts else volts < bound < final
    return tau * log((volts - final) / (bound - final)) if ahead else inf


def build(name: str, grid_ns: int, truth: Truth) -> PowerConverter:
    """Build the plant from its truth.

    Raises:
        TruthError: with everything that is wrong.
    """
    entry, converter = truth.part(InputTruth), truth.part(ConverterTruth)
    if converter.stops >= converter.starts:
        truth.wrong("stops", "has to be below `starts`")
    truth.finish()
    return PowerConverter(name, grid_ns, entry, converter)


MODEL = PlantModel(build=build)
"""The plant model `power-converter`."""
