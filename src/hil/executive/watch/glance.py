"""A look at a few rows that shows that none of them concerns any limit, so that they can be counted later."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from hil.bench.derived.room import Room, common_room
from hil.bench.envelope import Monitor, all_fresh
from hil.clock.port import NANOSECONDS

__all__ = ["Glance"]

_MOST_ROWS = 240

_Look = tuple[int, list[tuple[int, float, float]]]


class Glance:
    """Lets rows pass that all limits have room for. They wait, and are counted together.

    Args:
        monitors: all that the stream feeds.
        places: which place of a row holds which quantity.
        count: counts rows for the limits on derived quantities.
    """

    def __init__(
        self, monitors: Sequence[Monitor], places: Mapping[str, int], count: Callable[[list[list[float]]], None]
    ) -> None:
        self._monitors = monitors
        self._places = places
        self._count = count
        self._look: _Look | None = None
        self._waiting: list[list[float]] = []

    def passes(self, rows: list[list[float]], ahead_ns: int, by_ns: int) -> bool:
        """Return whether rows are good at a glance, and note that they are; see `Feed.judge`."""
        look = self._look or self._anew()
        last_ns = round(rows[-1][0] * NANOSECONDS)
        if look is None or last_ns > look[0]:
            return False
        for place, low, high in look[1]:
            numbers = [row[place] for row in rows]
            if not (low <= min(numbers) and max(numbers) <= high and math.isfinite(sum(numbers))):
                return False
        if not all_fresh(self._monitors, last_ns + ahead_ns, by_ns):
            return False
        self._waiting += rows
        if len(self._waiting) >= _MOST_ROWS:
            self.catch_up()
        return True

    def catch_up(self) -> None:
        """Count the rows that wait."""
        waiting, self._waiting, self._look = self._waiting, [], None
        if waiting:
            self._count(waiting)

    def _anew(self) -> _Look | None:
        """Work out how far rows may go from what was counted last."""
        if (room := common_room(map(_room_of, self._monitors))) is not None:
            self._look = room.until_ns, [(self._places[name], *bounds) for name, bounds in room.bounds.items()]
        return self._look


def _room_of(monitor: Monitor) -> Room | None:
    if monitor.derivation is not None:
        return monitor.derivation.room()
    limit = monitor.limit
    lowest = -math.inf if limit.minimum is None else limit.minimum
    highest = math.inf if limit.maximum is None else limit.maximum
    return Room(2**62, {limit.quantity: (lowest, highest)})
