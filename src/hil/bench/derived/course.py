"""The rows by which a limit is judged, and the room that they leave before it is passed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from operator import add, mul

__all__ = ["AHEAD_NS", "NONE", "Course", "Room", "common_room", "direction", "flow_bounds", "micro"]

NONE = (math.nan, math.nan)
"""The extremes of a column with a value that is not finite: nothing is within any bounds then."""

_MICRO = 1_000_000


def direction(current: float, threshold: float) -> int:
    """Return 1 for a current into the cell, -1 for one out of it, 0 for one below the threshold."""
    return 1 if current >= threshold else -1 if current <= -threshold else 0


def micro(number: float) -> int:
    """Return a number in millionths, rounded to an integer: integers add up to the same in any order."""
    return round(number * _MICRO)


class Course:
    """Rows in time order.

    Args:
        at_ns: their timestamps in ns, at least one.
        rows: the rows.
        places: the column of each quantity.

    Attributes:
        at_ns: as given.
    """

    def __init__(self, at_ns: Sequence[int], rows: Sequence[Sequence[float]], places: Mapping[str, int]) -> None:
        self.at_ns = at_ns
        self._rows = rows
        self._places = places
        self._columns: dict[str, list[float]] = {}
        self._extremes: dict[str, tuple[float, float]] = {}
        self._weights: dict[str, list[int]] = {}
        self._sums: dict[str, int] = {}
        self._between: list[int] | None = None

    def column(self, quantity: str) -> list[float]:
        """Return the values of a quantity."""
        if (found := self._columns.get(quantity)) is None:
            place = self._places[quantity]
            found = self._columns[quantity] = [row[place] for row in self._rows]
        return found

    def extremes(self, quantity: str) -> tuple[float, float]:
        """Return the lowest and the highest value of a quantity; `NONE` if one is not finite."""
        if (found := self._extremes.get(quantity)) is None:
            numbers = self.column(quantity)
            found = (min(numbers), max(numbers)) if math.isfinite(sum(numbers)) else NONE
            self._extremes[quantity] = found
        return found

    def flow(self, threshold: float) -> int | None:
        """Return the common direction of the current of all rows, None if it changes or is unknown. See `direction`."""
        low, high = self.extremes("current")
        if low >= threshold:
            return 1
        if high <= -threshold:
            return -1
        return 0 if -threshold < low and high < threshold else None

    def weights(self, quantity: str) -> list[int]:
        """Return current in uA or power in uW of every row, regardless of direction; they must be finite."""
        if (found := self._weights.get(quantity)) is None:
            numbers = self.column("current")
            if quantity == "energy":
                numbers = list(map(mul, self.column("voltage"), numbers))
            found = self._weights[quantity] = [abs(round(number * _MICRO)) for number in numbers]
        return found

    def sum(self, quantity: str) -> int:
        """Return twice the integral of the weights from the first row to the last, in uA.ns or uW.ns."""
        if (found := self._sums.get(quantity)) is None:
            weights = self.weights(quantity)
            found = sum(map(mul, map(add, weights, weights[1:]), self._steps()))
            self._sums[quantity] = found
        return found

    def _steps(self) -> list[int]:
        """Return the intervals between rows in ns."""
        if self._between is None:
            self._between = [max(0, ended - began) for began, ended in pairwise(self.at_ns)]
        return self._between


AHEAD_NS = 600_000_000_000
"""The longest room: rows are counted after this time at the latest."""

Bounds = Mapping[str, tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Room:
    """Bounds and a deadline: while every row is within the bounds and none is later, a limit is not passed.

    Attributes:
        until_ns: by the clock that stamps the rows.
        bounds: lowest and highest value by quantity; NaN is outside.
    """

    until_ns: int
    bounds: Bounds = field(default_factory=dict)


def common_room(rooms: Iterable[Room | None]) -> Room | None:
    """Return the room that several limits leave in common, None if one of them leaves none."""
    until_ns, bounds = 2**62, dict[str, tuple[float, float]]()
    for room in rooms:
        if room is None:
            return None
        until_ns = min(until_ns, room.until_ns)
        for name, (low, high) in room.bounds.items():
            lowest, highest = bounds.get(name, (-math.inf, math.inf))
            bounds[name] = (max(low, lowest), min(high, highest))
    return Room(until_ns, bounds)


def flow_bounds(flow: int, threshold: float) -> tuple[float, float]:
    """Return the bounds within which a current keeps its direction. See `hil.bench.derived.course.direction`."""
    if flow == 0:
        almost = math.nextafter(threshold, 0.0)
        return -almost, almost
    return (threshold, math.inf) if flow > 0 else (-math.inf, -threshold)
