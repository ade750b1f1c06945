"""A lithium cell as open-circuit voltage, a resistance and two RC links, stepped exactly under constant current."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import exp

from hil.simulation.plants.battery.ageing import Ageing
from hil.simulation.plants.battery.open_circuit import OpenCircuit
from hil.simulation.plants.plant import Vector

__all__ = ["Cell", "CellTruth", "Span", "Tabs"]

_ZERO_CELSIUS = 273.15
_REFERENCE = 25.0
_RESTING_VOLTS = 1e-9
_KEPT_STEPS = 4096

Span = tuple[float, float, float, float, float, float]
"""Seconds, decay of the fast and of the slow link [1], what each gains [ohm], resistance at the end [ohm]."""

Tabs = tuple[float, float, float, float]
"""Base [V] and resistance [ohm] of the tabs' voltage over the current, capacity [A.s], factor of resistances [1]."""


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

    charge: tuple[float, ...] = (0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)
    open_circuit: tuple[float, ...] = (
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
    capacity: float = 2.022
    resistance: float = 0.146
    fast_resistance: float = 0.02
    fast_time: float = 30.0
    slow_resistance: float = 0.117
    slow_time: float = 880.0
    activation: float = 2000.0
    entropic: float = -2.5e-4
    fade: float = 5.5e-4
    growth: float = 1e-3
    start: float = 0.0


class Cell:
    """The equations of one cell; without a state of its own.

    Args:
        truth: what it is made of.
    """

    def __init__(self, truth: CellTruth) -> None:
        self._truth = truth
        self.table = OpenCircuit(truth.charge, truth.open_circuit)
        self.ageing = Ageing(capacity=truth.capacity * 3600, fade=truth.fade, growth=truth.growth)
        self._activation = truth.activation / (_REFERENCE + _ZERO_CELSIUS)
        self._entropic = truth.entropic
        self.span = lru_cache(maxsize=_KEPT_STEPS)(self._span)

    def _span(self, dt: float) -> Span:
        """Return what steps of `dt` seconds have in common."""
        truth = self._truth
        fast, slow = exp(-dt / truth.fast_time), exp(-dt / truth.slow_time)
        fast_gain, slow_gain = (1 - fast) * truth.fast_resistance, (1 - slow) * truth.slow_resistance
        return dt, fast, slow, fast_gain, slow_gain, truth.resistance + fast_gain + slow_gain

    def tabs(self, state: Vector, span: Span) -> Tabs:
        """Return what the tabs will have after a step with any one current, and what that follows from.

        Under constant current both links relax exactly, v' = v*a + (1 - a)*R*I with a = exp(-dt/tau), and charge grows
        by I*dt, so that the voltage at the end is affine in I. A step of 0 s tells the voltage of this instant.
        """
        charge, fast, slow, passed, celsius, _, _ = state
        dt, fast_decay, slow_decay, _, _, ohms = span
        capacity, grown = self.ageing.aged(passed)
        off = celsius - _REFERENCE
        factor = grown * exp(-self._activation * off / (celsius + _ZERO_CELSIUS))
        start, rise = self.table.line(charge)
        base = start + rise * charge + self._entropic * off + fast * fast_decay + slow * slow_decay
        return base, rise * dt / capacity + factor * ohms, capacity, factor

    def moved(self, state: Vector, span: Span, tabs: Tabs, current: float) -> tuple[float, float, float, float, float]:
        """Return charge, links and throughput after a step with a current into the cell [A], and the mean heat [W].

        Heat is that of the resistances, and I*T*dU/dT, the reversible part of Bernardi's balance (1985, equation 20).
        Links whose voltages have decayed below a nanovolt without current are at rest.
        """
        charge, fast, slow, passed, celsius, _, _ = state
        dt, fast_decay, slow_decay, fast_gain, slow_gain, _ = span
        _, _, capacity, factor = tabs
        truth = self._truth
        driven = factor * current
        fast_after = fast * fast_decay + fast_gain * driven
        slow_after = slow * slow_decay + slow_gain * driven
        fast_mean, slow_mean = fast + fast_after, slow + slow_after
        heat = (fast_mean * fast_mean / truth.fast_resistance + slow_mean * slow_mean / truth.slow_resistance) / (
            4 * factor
        )
        if not current:
            if abs(fast_after) + abs(slow_after) < _RESTING_VOLTS:
                return charge, 0.0, 0.0, passed, 0.0
            return charge, fast_after, slow_after, passed, heat
        heat += current * (truth.resistance * driven + (celsius + _ZERO_CELSIUS) * truth.entropic)
        moved = current * dt
        return charge + moved / capacity, fast_after, slow_after, passed + abs(moved), heat
