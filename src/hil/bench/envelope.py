"""The envelope: one monitor per quantity, and when its readings trip the bench."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hil.bench.derived.derivation import Derivation
from hil.clock.port import NANOSECONDS
from hil.model.envelope import EnvelopeLimit
from hil.model.figure import Figure

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Monitor", "Trip", "all_fresh"]


_TOGETHER_NS = 10_000_000_000
"""Periods this long share one grid. Shorter ones keep their phase, so that they do not meet rows of recordings."""

_UNKNOWN_NS = 40_000_000
"""Assumed duration of a first reading."""

_ENOUGH = 3
"""Readings observed before a recording may be refused for their duration."""

_SOONER = 10
"""After a reading outside, the next one is due this many times sooner, so that a short excursion is confirmed too."""


@dataclass(frozen=True, slots=True)
class Trip:
    """Why the bench must be made safe: the limit, the last reading (None if there was none), and a sentence."""

    limit: str
    value: float | None
    unit: str
    text: str


class Monitor:
    """Watches one limit.

    A reading outside, or one that is not a number, counts towards the debounce, and the next is due after
    a tenth of the period; a good one clears the count. The absence of good readings for longer than the
    maximum age is a trip of its own, even if the next one is good: what happened in between is unknown.

    Args:
        limit: the limit of the bench file.
        read: takes a reading through the driver.
        start_ns: the bench time at which watching begins.
        derivation: computes the limit's quantity, None if that is read directly.

    Attributes:
        limit: as given.
        derivation: as given.
        inside: a value that is within the limit.
        catch_up: counts pending rows before anything else is counted.
        due_ns: when the next reading is due.
        good_ns: when the last good one was taken.
    """

    def __init__(
        self,
        limit: EnvelopeLimit,
        read: Callable[[], Figure],
        start_ns: int,
        derivation: Derivation | None = None,
    ) -> None:
        self.limit = limit
        self.derivation = derivation
        self._read = read
        self._period_ns = round(limit.period_s * NANOSECONDS)
        self._max_age_ns = round(limit.max_age_s * NANOSECONDS)
        self._lowest = limit.minimum if limit.minimum is not None else -sys.float_info.max
        self._highest = limit.maximum if limit.maximum is not None else sys.float_info.max
        self.catch_up: Callable[[], None] = lambda: None
        self.inside = min(max(0.0, self._lowest), self._highest)
        self._start_ns = _grid_ns(start_ns, self._period_ns)
        self._outside = 0
        self._lasts_ns = _UNKNOWN_NS
        self._least_ns = self._seen = 0
        self._hold_ns = self._period_ns
        self.due_ns = start_ns
        self.good_ns = start_ns

    @property
    def room_ns(self) -> int:
        """Time that a reading needs: the duration of the last one plus a quarter."""
        return self._lasts_ns + self._lasts_ns // 4

    @property
    def least_room_ns(self) -> int:
        """The same for the shortest reading so far; 0 before the third, since the computer may stall during one."""
        return self._least_ns + self._least_ns // 4 if self._seen >= _ENOUGH else 0

    @property
    def allowed_ns(self) -> int:
        """The time after a good reading within which the next one has to begin."""
        return self._max_age_ns - self._period_ns

    @property
    def latest_ns(self) -> int:
        """When it is read whatever that disturbs: the last good reading is about to be too old."""
        return self.good_ns + self.allowed_ns

    @property
    def doubtful(self) -> bool:
        """Whether the last reading was outside, and has to be confirmed."""
        return self._outside > 0

    @property
    def overdue_ns(self) -> int:
        """When it is read wherever the case is: a period late, or about to be too old."""
        return min(self.due_ns + self._period_ns, self.latest_ns)

    @property
    def good_until_ns(self) -> int:
        """When the last good reading becomes too old."""
        return self.good_ns + self._max_age_ns

    def late_s(self, now_ns: int) -> float:
        """Return how late a reading taken now would be, 0 until a period after it was overdue."""
        late = now_ns > self.overdue_ns + self._period_ns
        return (now_ns - self.due_ns) / NANOSECONDS if late else 0.0

    def restart(self, now_ns: int) -> None:
        """Start again after a time in which nothing could be read, such as a safe-off."""
        self.catch_up()
        self._start_ns = _grid_ns(now_ns, self._period_ns)
        self.due_ns = self.good_ns = now_ns
        self._outside = 0
        if self.derivation:
            self.derivation.pause()

    def take(self, now: Callable[[], int]) -> tuple[Figure, Trip | None]:
        """Take a reading and judge it; the next is due on the period's grid, or soon after one outside."""
        began_ns = now()
        elapsed = max(0, began_ns - self._start_ns) // self._period_ns
        self.due_ns = self._start_ns + (elapsed + 1) * self._period_ns
        unwatched = self.stale(began_ns)
        self.catch_up()
        figure = self._read()
        self.lasted(now() - began_ns)
        trip = self.judge(self.counted(figure), now()) or unwatched
        if self._outside:
            self.due_ns = min(self.due_ns, began_ns + self._period_ns // _SOONER)
        return figure, trip

    def read_once(self) -> None:
        """Take a reading without judging it, to measure its duration."""
        self._read()

    def lasted(self, duration_ns: int) -> None:
        """Note how long a reading took."""
        self._lasts_ns = duration_ns
        self._least_ns = min(duration_ns, self._least_ns or duration_ns)
        self._seen += 1

    def counted(self, figure: Figure) -> Figure:
        """Return the value that counts for a new reading: one within the limit if that does not apply now."""
        if self.derivation is None or self.derivation.applies:
            return figure
        return Figure(value=self.inside, unit=figure.unit)

    def judge(self, figure: Figure, now_ns: int) -> Trip | None:
        """Count a reading and return the trip that it causes, if any."""
        problem = _problem(self.limit, figure.value)
        if not problem:
            self._outside = 0
            self.good_ns = now_ns
            return None
        self._outside += 1
        if self._outside < self.limit.debounce:
            return self.stale(now_ns)
        return Trip(self.limit.id, _or_none(figure.value), self.limit.unit, f"{self.limit.output}: {problem}")

    def judge_row(self, when_ns: int, value: float, by_ns: int = 0) -> Trip | None:
        """Count one row of a stream as a reading taken at `when_ns`; then shift its instant by `by_ns`.

        The clock of the rows may drift against the bench's; from row to row it is the one that counts.
        """
        if self._lowest <= value <= self._highest and when_ns - self.good_ns <= self._max_age_ns:
            self._outside = 0
            self.good_ns = good_ns = when_ns + by_ns
            self.due_ns = good_ns + self._hold_ns
            return None
        unwatched = self.stale(when_ns)
        trip = self.judge(Figure(value=value, unit=self.limit.unit), when_ns) or unwatched
        self.good_ns += by_ns
        return trip

    def all_good(self, when_ns: Sequence[int], values: Sequence[float], by_ns: int) -> bool:
        """Count a few rows as `judge_row` would one by one if all of them are good and new; otherwise count none.

        Args:
            when_ns: the instants of the rows in ns of the bench's time, in order, at least one.
            values: the rows' values in the limit's unit, one each.
            by_ns: by how much the instant of the last one is shifted.
        """
        lowest, highest = self._lowest, self._highest
        last_ns = when_ns[-1]
        if last_ns - self.good_ns > self._max_age_ns:
            return False
        for value in values:
            if not lowest <= value <= highest:
                return False
        self._outside = 0
        self.good_ns = good_ns = last_ns + by_ns
        self.due_ns = good_ns + self._hold_ns
        return True

    def judge_rows(
        self, when_ns: NDArray[np.int64], values: NDArray[np.float64], by_ns: int = 0
    ) -> tuple[int, Trip] | None:
        """Count a block of rows as `judge_row` would one by one; return the first that trips, and its trip.

        Args:
            when_ns: the instants of the rows in ns of the bench's time, shape (n,), in order.
            values: the rows' values in the limit's unit, shape (n,).
            by_ns: by how much the instant of the last good row is shifted when all are counted.
        """
        import numpy as np  # noqa: PLC0415 - slow to import

        good = (values >= self._lowest) & (values <= self._highest)
        places = np.arange(len(values))
        last = np.maximum.accumulate(np.where(good, places, -1))
        before = np.concatenate(([-1], last[:-1]))
        outside = places - last + np.where(last < 0, self._outside, 0)
        late = when_ns - np.where(before < 0, self.good_ns, when_ns[before]) > self._max_age_ns
        trips = late | (~good & (outside >= self.limit.debounce))
        found = int(trips.argmax()) if trips.any() else None
        seen = int(last[-1] if found is None else before[found])
        self.good_ns = int(when_ns[seen]) if seen >= 0 else self.good_ns
        if found is None:
            self._outside = int(outside[-1])
            self.good_ns += by_ns
            self.due_ns = self.good_ns + self._hold_ns
            return None
        self._outside = int(outside[found - 1]) if found else self._outside
        trip = self.judge_row(int(when_ns[found]), float(values[found]))
        return (found, trip) if trip else None

    def feed(self, every_s: float) -> None:
        """Take rows in place of readings: a reading is due only if no good row came for longer than their interval."""
        most_ns = self._max_age_ns - self._period_ns
        self._hold_ns = min(self._period_ns + round(every_s * NANOSECONDS), most_ns)
        self.due_ns = max(self.due_ns, self.good_ns + self._hold_ns)

    def unfeed(self, now_ns: int) -> None:
        """Take readings again: no more rows will come."""
        self.due_ns = min(self.due_ns, max(now_ns, self.good_ns + self._period_ns))
        if self.derivation:
            self.derivation.settle(now_ns)

    def stale(self, now_ns: int) -> Trip | None:
        """Return a trip if the last good reading is older than allowed."""
        age_ns = now_ns - self.good_ns
        if age_ns <= self._max_age_ns:
            return None
        text = (
            f"{self.limit.output}: no good {self.limit.words} for {age_ns / NANOSECONDS:.3g} s,"
            f" {self.limit.max_age_s:g} s allowed"
        )
        return Trip(self.limit.id, None, self.limit.unit, text)


def all_fresh(monitors: Sequence[Monitor], when_ns: int, by_ns: int) -> bool:
    """Note for several monitors that all rows up to this instant were good; for none if one's last row is too old.

    Args:
        monitors: those that the rows feed.
        when_ns: the instant of the last row in ns of the bench's time.
        by_ns: by how much it is shifted.
    """
    for monitor in monitors:
        if when_ns - monitor.good_ns > monitor._max_age_ns:  # noqa: SLF001 - it is one of them
            return False
    good_ns = when_ns + by_ns
    for monitor in monitors:
        monitor._outside = 0  # noqa: SLF001
        monitor.good_ns = good_ns
        monitor.due_ns = good_ns + monitor._hold_ns  # noqa: SLF001
    return True


def _grid_ns(from_ns: int, period_ns: int) -> int:
    """Return the origin of the grid of readings: long periods share one, short ones keep their phase."""
    return from_ns - from_ns % period_ns if period_ns >= _TOGETHER_NS else from_ns


def _problem(limit: EnvelopeLimit, value: float) -> str:
    if not math.isfinite(value):
        return f"{limit.words} is not a number"
    if limit.maximum is not None and value > limit.maximum:
        return f"{limit.words} {value + 0.0:.6g} {limit.unit} is above {limit.maximum:g} {limit.unit}"
    if limit.minimum is not None and value < limit.minimum:
        return f"{limit.words} {value + 0.0:.6g} {limit.unit} is below {limit.minimum:g} {limit.unit}"
    return ""


def _or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None
