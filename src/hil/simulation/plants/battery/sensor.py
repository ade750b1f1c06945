"""The thermistor taped to the cell: its resistance, and what can be wrong with it."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import exp, log

from hil.model.notation import Positive

__all__ = ["HEALTHY", "STATES", "Thermistor"]

HEALTHY = "healthy"
STATES = (HEALTHY, "open", "shorted", "detached")
"""What can be with the thermistor; a detached one hangs in the box."""

_ZERO_CELSIUS = 273.15
_PER_REFERENCE = 1 / (25.0 + _ZERO_CELSIUS)
_OPEN_OHMS = 1e9
_SHORTED_OHMS = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Thermistor:
    """A thermistor with negative temperature coefficient, R = nominal*exp(beta*(1/T - 1/298.15 K)).

    Attributes:
        nominal: resistance at 25 degC [ohm].
        beta: [K].
    """

    nominal: Positive = field(default=10_000.0, metadata={"alias": "ntc_nominal"})
    beta: Positive = field(default=3950.0, metadata={"alias": "ntc_beta"})

    def ohms(self, celsius: float) -> float:
        """Return the resistance at a temperature."""
        kelvin = celsius + _ZERO_CELSIUS
        return self.nominal * exp(self.beta * (1 / kelvin - _PER_REFERENCE))

    def seen(self, state: str, cell: float, box: float) -> float:
        """Return the resistance between its wires, with cell and box at these temperatures [degC]."""
        if state == "open":
            return _OPEN_OHMS
        if state == "shorted":
            return _SHORTED_OHMS
        return self.ohms(box if state == "detached" else cell)

    def read(self, state: str, cell: float, box: float) -> float:
        """Return the temperature that the resistance stands for; far beyond any range where it is open or shorted."""
        if state == HEALTHY:
            return cell
        ratio = self.seen(state, cell, box) / self.nominal
        return 1 / (_PER_REFERENCE + log(ratio) / self.beta) - _ZERO_CELSIUS
