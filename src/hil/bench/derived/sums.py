"""What adds up row by row: charge, energy and durations, and the time in which something does not change."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hil.bench.derived.course import NONE, Course, micro
from hil.bench.derived.derivation import UNITS, Watching
from hil.bench.derived.room import AHEAD_NS, Room, flow_bounds
from hil.clock.port import NANOSECONDS
from hil.model.envelope import MADE_OF, Derived, EnvelopeLimit

__all__ = ["Integral", "Unchanged"]

_HALF_NS = 2 * NANOSECONDS
_MICRO = 1_000_000
_MOST_VOLTS = 10.0
"""With a higher voltage, energies are looked at in every block."""

_WITHIN = 0.999
"""Rounding does not use up the rest."""


class Integral(Watching):
    """Charge, energy or duration of one direction of the current, since it last flowed the other way or since arm.

    By trapezoids between rows, of uA or uW and ns in whole numbers: the sum does not depend on how rows come.
    """

    def __init__(self, limit: EnvelopeLimit, how: Derived) -> None:
        super().__init__(limit, how, *MADE_OF[limit.quantity])
        self._quantity = limit.quantity
        self._timed = limit.quantity == "duration"
        self._per_unit = UNITS[limit.quantity][limit.unit] * _HALF_NS * (1 if self._timed else _MICRO)
        self._wanted = self._flows[0]
        self._phased = how.since == "phase"
        self._sum = 0
        self._at_ns: int | None = None
        self._weight = 0
        self._flow: int | None = None

    def row(self, at_ns: int, numbers: Sequence[float]) -> float:
        """See `Derivation`."""
        if not all(map(math.isfinite, numbers)):
            return math.nan
        flow = self.flow_of(numbers)
        weight = 0
        if flow == self._wanted:
            weight = 1 if self._timed else abs(micro(math.prod(numbers)))
        elif flow and self._phased:
            self._sum = self._weight = 0
        if self._at_ns is not None:
            self._sum += (self._weight + weight) * max(0, at_ns - self._at_ns)
        self._at_ns, self._weight, self._flow = at_ns, weight, flow
        return self._sum / self._per_unit

    def quiet(self, course: Course) -> bool:
        """See `Derivation`."""
        flow = course.flow(self._threshold)
        if flow is None or flow != self._flow or self._at_ns is None:
            return False
        if self._quantity == "energy" and course.extremes("voltage") is NONE:
            return False
        times = course.at_ns
        if flow == self._wanted:
            if self._timed:
                total = self._sum + 2 * max(0, times[0] - self._at_ns) + 2 * (times[-1] - times[0])
                weight = 1
            else:
                weights = course.weights(self._quantity)
                weight = weights[-1]
                step = (self._weight + weights[0]) * max(0, times[0] - self._at_ns)
                total = self._sum + step + course.sum(self._quantity)
            if total / self._per_unit > self._highest:
                return False
            self._sum, self._weight = total, weight
        self._at_ns = times[-1]
        return True

    def room(self) -> Room | None:
        """See `Derivation`: what is left of the most may not be used up until then, whatever the current does."""
        if self._at_ns is None or self._flow is None:
            return None
        low, high = flow_bounds(self._flow, self._threshold)
        left = max(0.0, self._highest * self._per_unit - self._sum) * _WITHIN
        bounds = {"voltage": (-_MOST_VOLTS, _MOST_VOLTS)} if self._quantity == "energy" else {}
        if self._timed or self._flow != self._wanted:
            left_ns = left / 2 if self._timed and self._flow == self._wanted else AHEAD_NS
            return Room(self._at_ns + min(AHEAD_NS, int(left_ns)), {**bounds, "current": (low, high)})
        weight = left / (2 * AHEAD_NS)
        if self._weight > weight:
            return None
        most = weight / _MICRO / (_MOST_VOLTS if bounds else 1.0)
        return Room(self._at_ns + AHEAD_NS, {**bounds, "current": (max(low, -most), min(high, most))})

    def pause(self) -> None:
        """See `Derivation`; what was counted stays."""
        self._at_ns = self._flow = None
        self._weight = 0

    def settle(self, now_ns: int) -> None:
        """See `Derivation`."""
        self._at_ns = None if self._at_ns is None else now_ns


class Unchanged(Watching):
    """For how long a quantity has not left its band around where it was; with a flow, the time of that flow counts."""

    def __init__(self, limit: EnvelopeLimit, how: Derived) -> None:
        super().__init__(limit, how, how.of)
        self._of = how.of
        self._per_unit = UNITS["unchanged"][limit.unit] * _HALF_NS
        self._band = how.band or 0.0
        self._from = math.nan
        self._sum = 0
        self._at_ns: int | None = None
        self._counts = 0
        self._flow: int | None = None

    def row(self, at_ns: int, numbers: Sequence[float]) -> float:
        """See `Derivation`."""
        if not all(map(math.isfinite, numbers)):
            return math.nan
        flow = self.flow_of(numbers)
        counts = 1 if flow in self._flows else 0
        if not abs(numbers[0] - self._from) <= self._band:
            self._from, self._sum = numbers[0], 0
        elif self._at_ns is not None:
            self._sum += (self._counts + counts) * max(0, at_ns - self._at_ns)
        self._at_ns, self._counts, self._flow = at_ns, counts, flow
        return self._sum / self._per_unit

    def quiet(self, course: Course) -> bool:
        """See `Derivation`."""
        low, high = course.extremes(self._of)
        flow = self.flow_through(course)
        if not low <= high or flow is None or flow != self._flow or self._at_ns is None:
            return False
        times, counts = course.at_ns, 2 * self._counts
        total = self._sum + counts * (max(0, times[0] - self._at_ns) + times[-1] - times[0])
        if total / self._per_unit > self._highest:
            return False
        if high - self._from <= self._band and self._from - low <= self._band:
            self._sum = total
        else:
            since, band = self._from, self._band
            left_ns = times[0]
            for at_ns, number in zip(times, course.column(self._of), strict=True):
                if not abs(number - since) <= band:
                    since, left_ns = number, at_ns
            self._from, self._sum = since, counts * (times[-1] - left_ns)
        self._at_ns = times[-1]
        return True

    def room(self) -> Room | None:
        """See `Derivation`."""
        if self._at_ns is None or self._flow is None:
            return None
        left = max(0.0, self._highest * self._per_unit - self._sum) * _WITHIN
        left_ns = int(left / 2) if self._counts else AHEAD_NS
        return Room(
            self._at_ns + min(AHEAD_NS, left_ns), {self._of: (-math.inf, math.inf), **self.flow_room(self._flow)}
        )

    def pause(self) -> None:
        """See `Derivation`; what was counted stays."""
        self._at_ns = self._flow = None

    def settle(self, now_ns: int) -> None:
        """See `Derivation`."""
        self._at_ns = None if self._at_ns is None else now_ns
