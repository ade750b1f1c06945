"""What charge that passed through a cell leaves behind: less capacity, more resistance."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp

__all__ = ["Ageing"]


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
