"""Voltage of a resting cell over its state of charge: straight lines between points of a table."""

from __future__ import annotations

from bisect import bisect_right
from itertools import pairwise

__all__ = ["OpenCircuit"]


class OpenCircuit:
    """A table of open-circuit voltages; beyond its ends the outermost lines go on.

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
