"""How far rows may go before a limit has to be looked at again: bounds of what is read, and an instant."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

__all__ = ["AHEAD_NS", "Room", "common_room", "flow_bounds"]

AHEAD_NS = 600_000_000_000
"""No room is longer than that: rows are counted at last then."""

Bounds = Mapping[str, tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Room:
    """While every row is within these bounds, and none is later than this instant, a limit is not passed.

    Attributes:
        until_ns: by the clock that stamps the rows.
        bounds: lowest and highest number by quantity; what is named must be a number.
    """

    until_ns: int
    bounds: Bounds = field(default_factory=dict)


def common_room(rooms: Iterable[Room | None]) -> Room | None:
    """Return the room that several limits leave together, None where one of them leaves none."""
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
    """Return between which numbers a current keeps its direction. See `hil.bench.derived.course.direction`."""
    if flow == 0:
        almost = math.nextafter(threshold, 0.0)
        return -almost, almost
    return (threshold, math.inf) if flow > 0 else (-math.inf, -threshold)
