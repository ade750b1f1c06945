"""Derived quantities, computed row by row: integrals, times without change, slopes, and gated readings."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

from hil.bench.derived.course import AHEAD_NS, NONE, Course, Room, flow_bounds, micro
from hil.bench.derived.derivation import INTEGRALS, TIMES, UNITS, Derivation, Watching
from hil.clock.port import NANOSECONDS
from hil.model.envelope import MADE_OF, EnvelopeLimit

__all__ = ["Gated", "Integral", "Slope", "Unchanged", "derivation_of"]

_HALF_NS = 2 * NANOSECONDS
_MICRO = 1_000_000
_MOST_VOLTS = 10.0
"""Above this voltage, energies are evaluated in every block."""

_WITHIN = 0.999
"""Share of what is left; rounding does not use up the rest."""


class _Counting(Watching):
    """A quantity that accumulates from row to row, with the instant and the flow of the last one."""

    def __init__(self, limit: EnvelopeLimit, *quantities: str) -> None:
        super().__init__(limit, *quantities)
        self._at_ns: int | None = None
        self._flow: int | None = None

    def pause(self) -> None:
        """See `Derivation`; what was counted stays."""
        self._at_ns = self._flow = None

    def settle(self, now_ns: int) -> None:
        """See `Derivation`."""
        self._at_ns = None if self._at_ns is None else now_ns


class Integral(_Counting):
    """Charge, energy or duration of one direction of the current, since it last flowed the other way or since arm.

    Trapezoidal, in integers (uA or uW, and ns), so that the sum does not depend on how rows are split into blocks.
    """

    def __init__(self, limit: EnvelopeLimit) -> None:
        super().__init__(limit, *MADE_OF[limit.quantity])
        self._quantity = limit.quantity
        self._timed = limit.quantity == "duration"
        self._per_unit = UNITS[limit.quantity][limit.unit] * _HALF_NS * (1 if self._timed else _MICRO)
        self._wanted = self._flows[0]
        self._phased = limit.since == "phase"
        self._sum = 0
        self._weight = 0

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
        """See `Derivation`: what is left up to the limit must last until then, whatever the current does."""
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
        super().pause()
        self._weight = 0


class Unchanged(_Counting):
    """Time for which a quantity has stayed within its band; with a flow, only the time of that flow counts."""

    def __init__(self, limit: EnvelopeLimit) -> None:
        super().__init__(limit, limit.of)
        self._of = limit.of
        self._per_unit = UNITS["unchanged"][limit.unit] * _HALF_NS
        self._band = limit.band or 0.0
        self._from = math.nan
        self._sum = 0
        self._counts = 0

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


class Slope(Watching):
    """Change of a quantity over a time window: against the newest row at least that old; 0 until there is one."""

    def __init__(self, limit: EnvelopeLimit) -> None:
        super().__init__(limit, limit.of)
        self._of = limit.of
        self._over_ns = round((limit.over_s or 0.0) * NANOSECONDS)
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
        """See `Derivation`: no two values may lie further apart than the steepest slope allows in its window."""
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


class Gated(Watching):
    """A reading that counts only while a current flows, minus that of another output if it is compared against one."""

    def __init__(self, limit: EnvelopeLimit) -> None:
        super().__init__(limit, limit.quantity)
        self._quantity = limit.quantity
        self._against = bool(limit.against)
        if limit.against:
            self.sources = (*self.sources, (limit.against, limit.quantity))

    def row(self, at_ns: int, numbers: Sequence[float]) -> float:
        """See `Derivation`."""
        del at_ns
        if not all(map(math.isfinite, numbers)):
            self.applies = True
            return math.nan
        self.applies = self.flow_of(numbers) in self._flows
        return numbers[0] - numbers[-1] if self._against else numbers[0]

    def quiet(self, course: Course) -> bool:
        """See `Derivation`; a quantity compared against another output is not fed."""
        low, high = course.extremes(self._quantity)
        if not (low <= high and math.isfinite(course.extremes("current")[0])):
            return False
        flow = course.flow(self._threshold)
        return (self._lowest <= low and high <= self._highest) or (flow is not None and flow not in self._flows)

    def room(self) -> Room | None:
        """See `Derivation`."""
        bounds = {self._quantity: (self._lowest, self._highest), "current": (-math.inf, math.inf)}
        return None if self._against else Room(2**62, bounds)


def derivation_of(limit: EnvelopeLimit) -> Derivation:
    """Return the derivation of a limit's quantity."""
    if limit.quantity in INTEGRALS:
        return Integral(limit)
    if limit.quantity == "unchanged":
        return Unchanged(limit)
    return Slope(limit) if limit.quantity == "slope" else Gated(limit)
