"""How fast a quantity changes."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from hil.bench.derived.course import Course
from hil.bench.derived.derivation import TIMES, Watching
from hil.clock.port import NANOSECONDS
from hil.model.envelope import Derived, EnvelopeLimit

__all__ = ["Slope"]


class Slope(Watching):
    """Change of a quantity over a time: against the newest row that is as old at least; 0 until there is one."""

    def __init__(self, limit: EnvelopeLimit, how: Derived) -> None:
        super().__init__(limit, how, how.of)
        self._of = how.of
        self._over_ns = round((how.over_s or 0.0) * NANOSECONDS)
        self._unit_ns = TIMES[limit.unit.partition("/")[2]] * NANOSECONDS
        self._steepest = min(self._highest, -self._lowest)
        self._times: deque[int] = deque()
        self._numbers: deque[float] = deque()

    def row(self, at_ns: int, numbers: Sequence[float]) -> float:
        """See `Derivation`."""
        if not all(map(math.isfinite, numbers)):
            self.applies = True
            return math.nan
        self.applies = self.flow_of(numbers) in self._flows
        self._times.append(at_ns)
        self._numbers.append(numbers[0])
        self._forget(at_ns)
        if (passed_ns := at_ns - self._times[0]) < self._over_ns:
            return 0.0
        return (numbers[0] - self._numbers[0]) / (passed_ns / self._unit_ns)

    def quiet(self, course: Course) -> bool:
        """See `Derivation`."""
        low, high = course.extremes(self._of)
        if not self._numbers or self.flow_through(course) is None:
            return False
        spread = max(high, *self._numbers) - min(low, *self._numbers)
        if not spread / (self._over_ns / self._unit_ns) <= self._steepest:
            return False
        self._times.extend(course.at_ns)
        self._numbers.extend(course.column(self._of))
        self._forget(course.at_ns[-1])
        return True

    def pause(self) -> None:
        """See `Derivation`."""
        self._times.clear()
        self._numbers.clear()

    def settle(self, now_ns: int) -> None:
        """See `Derivation`."""
        later_ns = now_ns - self._times[-1] if self._times else 0
        self._times = deque(at_ns + later_ns for at_ns in self._times)

    def _forget(self, now_ns: int) -> None:
        while len(self._times) > 1 and self._times[1] <= now_ns - self._over_ns:
            self._times.popleft()
            self._numbers.popleft()
