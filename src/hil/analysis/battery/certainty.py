"""Measurement uncertainty of a battery tester: standard uncertainties of a cycle's results.

The errors of the tester's meters are taken as constant (the certificate does not separate a varying part), and the
error of its clock as the measured drift. Sources: JCGM 100:2008 (GUM), 4.3.7 and 5.1.2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from hil.analysis.battery.cycles import Cycle
from hil.analysis.battery.half_cycle import HalfCycle, end_uncertainty
from hil.analysis.battery.series import SECONDS_PER_HOUR
from hil.analysis.tracing import traced

__all__ = ["Certainty"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Certainty:
    """Standard uncertainties of one tester; None where neither certificate nor firmware states one.

    Attributes:
        interval: time between lines [s].
        voltage: uncertainty of its voltage [V].
        current: uncertainty of its current [A].
        temperature: uncertainty of its temperature [K].
        drift: relative drift of its clock.
        drift_uncertainty: uncertainty of that drift.
        current_gain: relative uncertainty of the gain of its current.
        voltage_gain: relative uncertainty of the gain of its voltage.
    """

    interval: float
    voltage: float | None = None
    current: float | None = None
    temperature: float | None = None
    drift: float | None = None
    drift_uncertainty: float | None = None
    current_gain: float = 0.0
    voltage_gain: float = 0.0

    @property
    @traced
    def clock(self) -> float | None:
        """Relative uncertainty of its clock: the drift and the drift's uncertainty combined."""
        return None if self.drift is None else math.hypot(self.drift, self.drift_uncertainty or 0.0)

    @traced
    def time(self, seconds: float) -> float | None:
        """Return the uncertainty of a time [s]: one line interval at each end, and the clock."""
        clock = self.clock
        return None if clock is None else math.hypot(self.interval / math.sqrt(6.0), clock * seconds)

    @traced
    def time_to(self, seconds: float, meter: float | None, sensitivity: float) -> float | None:
        """Return the uncertainty of a time [s] to a level, which a meter error shifts by `sensitivity` [s] per unit."""
        own = self.time(seconds)
        if own is None or meter is None or math.isnan(sensitivity):
            return None
        return math.hypot(own, meter * sensitivity)

    @traced
    def end_of(self, half: HalfCycle) -> float | None:
        """Return the uncertainty of the end voltage [V]: the end came after the last line."""
        if self.voltage is None or math.isnan(half.last_change):
            return None
        return end_uncertainty(self.voltage, half.last_change)

    @traced
    def charge(self, half: HalfCycle) -> float | None:
        """Return the uncertainty of a charge [Ah]: constant offset of the current over time, and gain of the whole."""
        offset = self._offset(half)
        return None if offset is None else math.hypot(offset, self.current_gain * half.charge)

    @traced
    def energy(self, half: HalfCycle) -> float | None:
        """Return the uncertainty of an energy [Wh]."""
        charge = self.charge(half)
        if charge is None or self.voltage is None:
            return None
        gain = self.voltage_gain * half.charge * half.mean_voltage
        return math.hypot(charge * half.mean_voltage, self.voltage * half.charge, gain)

    @traced
    def ratio(self, made: Cycle, value: float) -> float | None:
        """Return the uncertainty of an efficiency: a current offset acts oppositely in the halves, a gain cancels."""
        halves = [(each, self._offset(each)) for each in (made.charge, made.discharge) if each is not None]
        if any(offset is None for _, offset in halves):
            return None
        return value * sum(offset / each.charge for each, offset in halves if offset is not None)

    def _offset(self, half: HalfCycle) -> float | None:
        return None if self.current is None else self.current * half.duration / SECONDS_PER_HOUR

    @traced
    def flowed(self, half: HalfCycle) -> tuple[float, float]:
        """Return the uncertainties of charge [Ah] and energy [Wh]: meters and switching instants combined.

        The two are independent, and are combined by JCGM 100:2008, 5.1.2.
        """
        charge, energy = self.charge(half) or 0.0, self.energy(half) or 0.0
        return math.hypot(charge, half.open_charge), math.hypot(energy, half.open_energy)

    @traced
    def efficiencies(self, made: Cycle) -> tuple[float, float]:
        """Return the uncertainties of coulombic and energy efficiency; NaN where one half is missing.

        Only the part of the voltage offset that the halves do not share counts: their mean voltages are almost equal.
        """
        into, out = made.charge, made.discharge
        if into is None or out is None or not (into.charge > 0 and out.charge > 0):
            return math.nan, math.nan
        coulombic, energetic = made.coulombic_efficiency, made.energy_efficiency
        shared = (self.voltage or 0.0) * abs(1.0 / into.mean_voltage - 1.0 / out.mean_voltage)
        return (
            math.hypot(
                self.ratio(made, coulombic) or 0.0,
                coulombic * into.open_charge / into.charge,
                coulombic * out.open_charge / out.charge,
            ),
            math.hypot(
                self.ratio(made, energetic) or 0.0,
                energetic * shared,
                energetic * into.open_energy / into.energy,
                energetic * out.open_energy / out.energy,
            ),
        )

    @traced
    def resistance(self, change: float) -> float | None:
        """Return the uncertainty of a resistance [ohm] for a change of current [A]."""
        return None if self.voltage is None else math.sqrt(2.0) * self.voltage / abs(change)
