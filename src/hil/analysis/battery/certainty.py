"""How well a battery tester knows what it reports: standard uncertainties of the numbers of a cycle.

The tester's meters are taken to be off by the same amount all the time (their certificate does not say what part of it
changes), and its clock by the drift that was found. Sources: JCGM 100:2008 (GUM), 4.3.7 and 5.1.2.
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
    """Standard uncertainties of one tester, None if its certificate or its firmware does not tell.

    Attributes:
        interval: from line to line [s].
        voltage: of its voltage [V].
        current: of its current [A].
        temperature: of its temperature [K].
        drift: of its clock, as a ratio.
        drift_uncertainty: of that.
    """

    interval: float
    voltage: float | None = None
    current: float | None = None
    temperature: float | None = None
    drift: float | None = None
    drift_uncertainty: float | None = None

    @property
    @traced
    def clock(self) -> float | None:
        """Of its clock, as a ratio: what it is off, and how well that is known."""
        return None if self.drift is None else math.hypot(self.drift, self.drift_uncertainty or 0.0)

    @traced
    def time(self, seconds: float) -> float | None:
        """Of a time [s]: a line at each end, anywhere within its interval, and the clock."""
        clock = self.clock
        return None if clock is None else math.hypot(self.interval / math.sqrt(6.0), clock * seconds)

    @traced
    def time_to(self, seconds: float, meter: float | None, sensitivity: float) -> float | None:
        """Of a time [s] to a level: what the meter has too much moves it, by `sensitivity` [s] per unit."""
        own = self.time(seconds)
        if own is None or meter is None or math.isnan(sensitivity):
            return None
        return math.hypot(own, meter * sensitivity)

    @traced
    def end_of(self, half: HalfCycle) -> float | None:
        """Of the last voltage [V]: the end came after the last line."""
        if self.voltage is None or math.isnan(half.last_change):
            return None
        return end_uncertainty(self.voltage, half.last_change)

    @traced
    def charge(self, half: HalfCycle) -> float | None:
        """Of a charge [Ah]: what the tester's current has too much, it has all the time."""
        return None if self.current is None else self.current * half.duration / SECONDS_PER_HOUR

    @traced
    def energy(self, half: HalfCycle) -> float | None:
        """Of an energy [Wh]."""
        charge = self.charge(half)
        if charge is None or self.voltage is None:
            return None
        return math.hypot(charge * half.mean_voltage, self.voltage * half.charge)

    @traced
    def ratio(self, made: Cycle, value: float) -> float | None:
        """Of an efficiency: an offset of the current adds to one half-cycle what it takes from the other."""
        halves = [(each, self.charge(each)) for each in (made.charge, made.discharge) if each is not None]
        if any(charge is None for _, charge in halves):
            return None
        return value * sum(charge / each.charge for each, charge in halves if charge is not None)

    @traced
    def resistance(self, change: float) -> float | None:
        """Of a resistance [ohm] over a change of current [A]."""
        return None if self.voltage is None else math.sqrt(2.0) * self.voltage / abs(change)
