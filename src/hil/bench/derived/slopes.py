"""How fast a quantity changes."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

from hil.bench.derived.course import Course
from hil.bench.derived.derivation import TIMES, Watching
from hil.bench.derived.room import AHEAD_NS, Room
from hil.clock.port import NANOSECONDS
from hil.model.envelope import Derived, EnvelopeLimit

__all__ = ["Slope"]

_WITHIN = 0.999
"""Rounding makes no slope too steep."""


class Slope(Watching):
    """Change of a quantity over a time: against the newest row that is as old at least; 0 until there is one."""

    def __init__(self, limit: EnvelopeLimit, how: Derived) -> None:
        super().__init__(limit, how, how.of)
        self._of = how.of
        self._over_ns = round((how.over_s or 0.0) * NANOSECONDS)
        self._unit_ns = TIMES[limit.unit.partition("/")[2]] * NANOSECONDS
        self._steepest = min(self._highest, -self._lowest)
        self._flow = 0
        self._times: list[int] = []
        self._numbers: list[float] = []

    def row(self, at_ns: int, numbers: Sequence[float]) -> float:
        """See `Derivation`."""
        if not all(map(math.isfinite, numbers)):
            self.applies = True
            return math.nan
        self._flow = self.flow_of(numbers)
        self.applies = self._flow in self._flows
        self._times.append(at_ns)
        self._numbers.append(numbers[0])
        self._forget(at_ns)
        if (passed_ns := at_ns - self._times[0]) < self._over_ns:
            return 0.0
        return (numbers[0] - self._numbers[0]) / (passed_ns / self._unit_ns)

    def quiet(self, course: Course) -> bool:
        """See `Derivation`."""
        low, high = course.extremes(self._of)
        flow = self.flow_through(course)
        if not self._numbers or flow is None:
            return False
        spread = max(high, *self._numbers) - min(low, *self._numbers)
        steep = not spread / (self._over_ns / self._unit_ns) <= self._steepest
        if not math.isfinite(spread) or (steep and flow in self._flows):
            return False
        self._flow = flow
        self._times.extend(course.at_ns)
        self._numbers.extend(course.column(self._of))
        self._forget(course.at_ns[-1])
        return True

    def room(self) -> Room | None:
        """See `Derivation`: no two numbers may lie further apart than the steepest slope makes in its time."""
        if not self._numbers:
            return None
        until_ns, bounds = self._times[-1] + AHEAD_NS, self.flow_room(self._flow)
        if self._flow not in self._flows:
            return Room(until_ns, {**bounds, self._of: (-math.inf, math.inf)})
        low, high = min(self._numbers), max(self._numbers)
        apart = _WITHIN * self._steepest * (self._over_ns / self._unit_ns)
        if not high - low < apart:
            return None
        middle = (low + high) / 2
        return Room(until_ns, {**bounds, self._of: (middle - apart / 2, middle + apart / 2)})

    def pause(self) -> None:
        """See `Derivation`."""
        self._times.clear()
        self._numbers.clear()

    def settle(self, now_ns: int) -> None:
        """See `Derivation`."""
        later_ns = now_ns - self._times[-1] if self._times else 0
        self._times = [at_ns + later_ns for at_ns in self._times]

    def _forget(self, now_ns: int) -> None:
        if (place := bisect_right(self._times, now_ns - self._over_ns) - 1) > 0:
            del self._times[:place], self._numbers[:place]
