"""What is read, where it counts under a condition only, or is held against another output."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hil.bench.derived.course import Course
from hil.bench.derived.derivation import Watching
from hil.bench.derived.room import Room
from hil.model.envelope import Derived, EnvelopeLimit

__all__ = ["Gated"]


class Gated(Watching):
    """What is read, counted only while a current flows, and less what another output reads where it is held against."""

    def __init__(self, limit: EnvelopeLimit, how: Derived) -> None:
        super().__init__(limit, how, limit.quantity)
        self._quantity = limit.quantity
        self._against = bool(how.against)
        if how.against:
            self.sources = (*self.sources, (how.against, limit.quantity))

    def row(self, at_ns: int, numbers: Sequence[float]) -> float:
        """See `Derivation`."""
        del at_ns
        if not all(map(math.isfinite, numbers)):
            self.applies = True
            return math.nan
        self.applies = self.flow_of(numbers) in self._flows
        return numbers[0] - numbers[-1] if self._against else numbers[0]

    def quiet(self, course: Course) -> bool:
        """See `Derivation`; what is held against another output is not fed."""
        low, high = course.extremes(self._quantity)
        if not (low <= high and math.isfinite(course.extremes("current")[0])):
            return False
        flow = course.flow(self._threshold)
        return (self._lowest <= low and high <= self._highest) or (flow is not None and flow not in self._flows)

    def room(self) -> Room | None:
        """See `Derivation`."""
        bounds = {self._quantity: (self._lowest, self._highest), "current": (-math.inf, math.inf)}
        return None if self._against else Room(2**62, bounds)

    def pause(self) -> None:
        """See `Derivation`; it remembers nothing."""

    def settle(self, now_ns: int) -> None:
        """See `Derivation`; it remembers nothing."""
        del now_ns
