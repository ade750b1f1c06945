"""What derived quantities have in common: sources, units, and how rows are counted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

from hil.bench.derived.course import Course, Room, direction, flow_bounds
from hil.model.envelope import EnvelopeLimit

__all__ = ["INTEGRALS", "TIMES", "UNITS", "Derivation", "Watching"]

_MINUTE_S, _HOUR_S = 60.0, 3600.0

INTEGRALS = ("charge", "energy", "duration")
"""Quantities that accumulate while a current flows in one direction."""

TIMES = {"s": 1.0, "min": _MINUTE_S, "h": _HOUR_S}
"""Units of time, in s."""

UNITS: dict[str, dict[str, float]] = {
    "charge": {"A.h": _HOUR_S, "mA.h": 0.001 * _HOUR_S},
    "energy": {"W.h": _HOUR_S, "mW.h": 0.001 * _HOUR_S},
    "duration": TIMES,
    "unchanged": TIMES,
}
"""Units of derived quantities, each in A.s, W.s or s. A slope has the unit of its quantity per unit of time."""


class Derivation(Protocol):
    """Computes one quantity row by row. Times are in ns, by the clock that stamps the rows.

    Attributes:
        applies: whether the limit applies at the newest row.
    """

    applies: bool

    @property
    def sources(self) -> tuple[tuple[str, str], ...]:
        """Output and quantity of each of its inputs, in order."""
        ...

    def row(self, at_ns: int, numbers: Sequence[float]) -> float:
        """Count one row and return the quantity in the limit's unit; NaN, and nothing counted, if an input is NaN."""
        ...

    def quiet(self, course: Course) -> bool:
        """Count rows as `row` would if each of them is known to stay within the limit; otherwise count none."""
        ...

    def room(self) -> Room | None:
        """Return the room in which all rows are `quiet`; None if that is not known."""
        ...

    def pause(self) -> None:
        """Count nothing between the newest row and the next: what happened in between is unknown."""
        ...

    def settle(self, now_ns: int) -> None:
        """Move the newest row to this instant: the next one is stamped by another clock."""
        ...


class Watching:
    """Base of all derivations: the limit, its sources, and the flow without which the limit does not apply."""

    def __init__(self, limit: EnvelopeLimit, *quantities: str) -> None:
        if limit.flow and "current" not in quantities:
            quantities = (*quantities, "current")
        self.sources = tuple((limit.output, quantity) for quantity in quantities)
        self.applies = True
        self._threshold = limit.threshold or 0.0
        self._flows = {"": (-1, 0, 1), "charging": (1,), "discharging": (-1,), "flowing": (-1, 1)}[limit.flow]
        self._gated = bool(limit.flow)
        self._current = quantities.index("current") if limit.flow else 0
        self._lowest = -math.inf if limit.minimum is None else limit.minimum
        self._highest = math.inf if limit.maximum is None else limit.maximum

    def flow_of(self, numbers: Sequence[float]) -> int:
        """Return the direction of a row's current; 0 if the limit always applies."""
        return direction(numbers[self._current], self._threshold) if self._gated else 0

    def flow_room(self, flow: int) -> dict[str, tuple[float, float]]:
        """Return the bounds of the current within which the flow stays as it is; empty if the limit always applies."""
        return {"current": flow_bounds(flow, self._threshold)} if self._gated else {}

    def flow_through(self, course: Course) -> int | None:
        """Return the common direction of all rows, None if there is none; 0 if the limit always applies."""
        return course.flow(self._threshold) if self._gated else 0

    def pause(self) -> None:
        """See `Derivation`; without state there is nothing to forget."""

    def settle(self, now_ns: int) -> None:
        """See `Derivation`; without state there is no instant to move."""
