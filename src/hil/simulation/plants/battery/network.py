"""Supply, load and cell around the tester's terminals, solved in closed form."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Flow", "Network"]

Flow = tuple[float, float, float]
"""Out of the supply [A], at the tester's terminals [V], into the cell [A]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Network:
    """What hangs on the tester's terminals besides the cell.

    Attributes:
        volts: that the supply holds; 0 where its contact is open.
        limit: its current limit; 0 where its contact is open.
        path: resistance between supply and terminals [ohm], above 0.
        load: constant current that the load draws while there is a voltage [A].
        siemens: conductance of the load besides.
    """

    volts: float
    limit: float
    path: float
    load: float
    siemens: float

    def solve(self, base: float, ohms: float) -> Flow:
        """Return what flows into a cell whose terminals have `base + ohms * current`.

        With terminals at u, the supply gives s = (V - u)/path between 0 and its limit, and the cell takes
        i = s - load - siemens*u; with u = base + ohms*i every case is linear. Nothing flows back into the supply. A
        load that would turn the terminals around draws what brings them to 0 V.
        """
        loaded = 1 + ohms * self.siemens
        supply = 0.0
        if self.limit > 0:
            supply = (self.volts * loaded - base + ohms * self.load) / (self.path * loaded + ohms)
            supply = 0.0 if supply < 0 else min(supply, self.limit)
        load = self.load
        volts = (base + ohms * (supply - load)) / loaded
        if volts < 0:
            load = max(supply + base / ohms, 0.0)
            volts = (base + ohms * (supply - load)) / loaded
        return supply, volts, supply - load - self.siemens * volts
