"""Supply, load and cell around the tester's terminals, solved in closed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

__all__ = ["Flow", "Network"]

Flow = tuple[float, float, float]
"""Out of the supply [A], at the tester's terminals [V], into the cell [A]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Network:
    """What is connected to the tester's terminals, apart from the cell.

    Attributes:
        volts: that the supply holds; 0 where its contact is open.
        limit: its current limit; 0 where its contact is open.
        path: resistance between supply and terminals [ohm], above 0.
        load: constant current that the load draws while there is a voltage [A].
        siemens: conductance of the resistor in parallel with the load.
    """

    volts: float
    limit: float
    path: float
    load: float
    siemens: float

    def solver(self, wires: float = 0.0) -> Callable[[float, float], Flow]:
        """Return a function of base [V] and resistance [ohm]: what flows into a cell.

        Its terminals have `base + (ohms + wires) * current`. With terminals at u, the supply gives s = (V - u)/path
        between 0 and its limit, and the cell takes i = s - load - siemens*u; with u = base + ohms*i every case is
        linear. Nothing flows back into the supply. A load that would turn the terminals around draws what brings them
        to 0 V.
        """
        # Nothing of an object is looked up when it is solved: that happens twice for every line of weeks.
        held, limit, path, drawn, siemens = self.volts, self.limit, self.path, self.load, self.siemens

        def solve(base: float, inside: float) -> Flow:
            ohms = inside + wires
            loaded = 1 + ohms * siemens
            supply, load = 0.0, drawn
            if limit > 0:
                supply = (held * loaded - base + ohms * load) / (path * loaded + ohms)
                if supply < 0:
                    supply = 0.0
                elif supply > limit:
                    supply = limit
            volts = (base + ohms * (supply - load)) / loaded
            if volts < 0:
                load = max(supply + base / ohms, 0.0)
                volts = (base + ohms * (supply - load)) / loaded
            return supply, volts, supply - load - siemens * volts

        return solve

    def idle(self, wires: float) -> Callable[[float, float], Flow]:
        """Return the same where nothing flows into the cell, whatever the meter draws through an open fuse."""
        solve = self.solver(wires)

        def rest(base: float, inside: float) -> Flow:
            supply, volts, _ = solve(base, inside)
            return supply, volts, 0.0

        return rest

    def at_supply(self, held: float, supply: float, volts: float) -> float:
        """Return the voltage of a supply that would hold `held`, gives `supply` [A], and sees `volts` at the terminals.

        The cell lifts the terminals of a supply that gives nothing.
        """
        return volts + self.path * supply if supply >= self.limit else max(held, volts)
