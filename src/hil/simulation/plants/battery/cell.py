"""A lithium cell as open-circuit voltage, a resistance and two RC links, stepped exactly under constant current."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
from math import exp
from typing import Annotated, ClassVar

from hil.model.notation import Positive, number, vector
from hil.simulation.plants.plant import Vector

__all__ = ["Ageing", "Cell", "CellTruth", "Flowing", "OpenCircuit", "Tabs", "Warming"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ageing:
    """Ageing by throughput. A cycle is twice the new capacity: once in, once out.

    Attributes:
        capacity: of the new cell [A.s].
        fade: relative loss of capacity per cycle [1].
        growth: relative growth of every resistance per cycle, of the new value [1].
    """

    capacity: float
    fade: float
    growth: float

    def cycles(self, passed: float) -> float:
        """Return how many full cycles a throughput [A.s], both directions, stands for."""
        return passed / (2 * self.capacity)

    def aged(self, passed: float) -> tuple[float, float]:
        """Return the capacity [A.s] after a throughput, and by what factor resistances have grown."""
        cycles = passed / (2 * self.capacity)
        return self.capacity * exp(-self.fade * cycles), 1 + self.growth * cycles


class OpenCircuit:
    """A table of open-circuit voltages; beyond its ends the outermost lines continue.

    Args:
        charges: states of charge [1], rising, at least two.
        volts: open-circuit voltages there at 25 degC [V], rising.

    Attributes:
        inner: the states of charge at which one line ends and the next begins.
        lines: of each line its volts at 0, and its rise [V].
    """

    def __init__(self, charges: tuple[float, ...], volts: tuple[float, ...]) -> None:
        self.inner = charges[1:-1]
        pairs = tuple(zip(charges, volts, strict=True))
        rises = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(pairs)]
        self.lines = tuple((v - rise * s, rise) for (s, v), rise in zip(pairs, rises, strict=False))

    def line(self, charge: float) -> tuple[float, float]:
        """Return the line that holds at a state of charge: its volts at 0, and its rise [V]."""
        return self.lines[bisect_right(self.inner, charge)]

    def volts(self, charge: float) -> float:
        """Return the open-circuit voltage at a state of charge."""
        start, rise = self.line(charge)
        return start + rise * charge


_ZERO_CELSIUS = 273.15
_REFERENCE = 25.0
_RESTING_VOLTS = 1e-9
_KEPT_STEPS = 256

Tabs = tuple[float, float, float, float]
"""Base [V] and resistance [ohm] of the tabs' voltage over the current, capacity [A.s], factor of resistances [1]."""

Flowing = Callable[[float, float], tuple[float, float, float]]
Warming = Callable[[float, float, float, float], tuple[float, float, float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class CellTruth:
    """A pouch cell of 5.16 Wh by its label, as it showed itself in ten cycles at C/2.

    Capacity, resistances, slow time, entropic coefficient and level of the table were fitted by least squares to the
    times, energies and rises of temperature in Table 1 (sections 6.1 and 6.2) of the PoCat characterisation document;
    the table's shape is typical for lithium cobalt oxide against graphite and was not measured. Fade and growth give a
    loss of 7.1 % in 844 hours of cycles at 40 and 10 degC (section 17, whose 70 and 65 Wh are a tenth of that).

    Attributes:
        charge, open_circuit: states of charge [1] and open-circuit voltages at 25 degC [V].
        capacity: [A.h].
        resistance: ohmic, at 25 degC [ohm].
        fast_resistance, fast_time: of the fast link [ohm, s].
        slow_resistance, slow_time: of the slow link [ohm, s].
        activation: how resistances rise in the cold, as exp(activation*(1/T - 1/298.15 K)) [K].
        entropic: change of the open-circuit voltage with temperature [V/K].
        fade, growth: of capacity and resistance, per cycle [1].
        start: state of charge at the epoch [1].
    """

    charge: ClassVar[tuple[float, ...]] = (0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)
    open_circuit: Annotated[tuple[float, ...], vector(14, rising=True)] = (
        3.0,
        3.288,
        3.438,
        3.568,
        3.658,
        3.698,
        3.738,
        3.778,
        3.838,
        3.908,
        3.988,
        4.078,
        4.128,
        4.2,
    )
    capacity: Positive = 2.022
    resistance: Positive = 0.146
    fast_resistance: Positive = 0.02
    fast_time: Positive = 30.0
    slow_resistance: Positive = 0.117
    slow_time: Positive = 880.0
    activation: Annotated[float, number(0, 10_000)] = 2000.0
    entropic: Annotated[float, number(-0.01, 0.01)] = -2.5e-4
    fade: Annotated[float, number(0, 1)] = 5.5e-4
    growth: Annotated[float, number(0, 1)] = 1e-3
    start: Annotated[float, number(0, 1)] = field(default=0.0, metadata={"alias": "charge"})


class Cell:
    """The equations of one cell; without a state of its own.

    Args:
        truth: what it is made of.
    """

    def __init__(self, truth: CellTruth) -> None:
        self._truth = truth
        self.table = OpenCircuit(truth.charge, truth.open_circuit)
        self.ageing = Ageing(capacity=truth.capacity * 3600, fade=truth.fade, growth=truth.growth)

        # Few steps are of other lengths than the grid's and its parts.
        self.tabs = lru_cache(maxsize=_KEPT_STEPS)(self._tabs)

    def _decays(self, dt: float) -> tuple[float, float]:
        """Return by what the voltages of fast and slow link are multiplied in a step of `dt` seconds."""
        return exp(-dt / self._truth.fast_time), exp(-dt / self._truth.slow_time)

    def _tabs(self, dt: float) -> Callable[[Vector], Tabs]:
        """Return a function of the state: what the tabs will have after a step with any one current.

        Under constant current both links relax exactly, v' = v*a + (1 - a)*R*I with a = exp(-dt/tau), and charge grows
        by I*dt, so that the voltage at the end is affine in I. A step of 0 s gives the voltage of this instant.
        """
        truth, ageing, table = self._truth, self.ageing, self.table
        fast_decay, slow_decay = self._decays(dt)
        ohms = truth.resistance + (1 - fast_decay) * truth.fast_resistance + (1 - slow_decay) * truth.slow_resistance
        activation, entropic = truth.activation / (_REFERENCE + _ZERO_CELSIUS), truth.entropic
        # Nothing of another object is looked up in a step: there are hundreds of thousands of them.
        new, fade, growth, whole = ageing.capacity, ageing.fade, ageing.growth, 2 * ageing.capacity
        inner, lines = table.inner, table.lines

        def tabs(state: Vector) -> Tabs:
            charge, fast, slow, passed, celsius, _, _, _, _, _ = state
            cycles = passed / whole
            off = celsius - _REFERENCE
            factor = (1 + growth * cycles) * exp(-activation * off / (celsius + _ZERO_CELSIUS))
            capacity = new * exp(-fade * cycles)
            start, rise = lines[bisect_right(inner, charge)]
            base = start + rise * charge + entropic * off + fast * fast_decay + slow * slow_decay
            return base, rise * dt / capacity + factor * ohms, capacity, factor

        return tabs

    def step(self, dt: float, flow: Flowing, warmed: Warming) -> Callable[[Vector], Vector]:
        """Return a step of `dt` seconds as a function of the state alone.

        Heat is that of the resistances, and I*T*dU/dT, the reversible part of Bernardi's balance (1985, equation 20).
        Links whose voltages have decayed below a nanovolt without current are at rest.

        Args:
            dt: seconds.
            flow: of base and resistance of the tabs, what flows; its last number goes into the cell.
            warmed: of the three temperatures [degC] and the heat in the cell [W], the temperatures after the step.
        """
        truth, tabs = self._truth, self.tabs(dt)
        fast_decay, slow_decay = self._decays(dt)
        resistance, fast_ohms, slow_ohms = truth.resistance, truth.fast_resistance, truth.slow_resistance
        fast_gain, slow_gain = (1 - fast_decay) * fast_ohms, (1 - slow_decay) * slow_ohms
        entropic = truth.entropic

        def step(state: Vector) -> Vector:
            charge, fast, slow, passed, celsius, plate, box, _, _, _ = state
            base, ohms, capacity, factor = tabs(state)
            supply, volts, current = flow(base, ohms)
            driven = factor * current
            fast_after = fast * fast_decay + fast_gain * driven
            slow_after = slow * slow_decay + slow_gain * driven
            fast_mean, slow_mean = fast + fast_after, slow + slow_after
            heat = (fast_mean * fast_mean / fast_ohms + slow_mean * slow_mean / slow_ohms) / (4 * factor)
            if current:
                heat += current * (resistance * driven + (celsius + _ZERO_CELSIUS) * entropic)
                way = current * dt
                charge, passed = charge + way / capacity, passed + abs(way)
            elif abs(fast_after) + abs(slow_after) < _RESTING_VOLTS:
                fast_after = slow_after = heat = 0.0
            cell, plate, box = warmed(celsius, plate, box, heat)
            return charge, fast_after, slow_after, passed, cell, plate, box, supply, volts, current

        return step
