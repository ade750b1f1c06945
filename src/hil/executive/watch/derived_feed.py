"""Limits on derived quantities that a stream feeds: computed and judged row by row, most blocks at a glance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hil.bench.derived.course import Course
from hil.bench.derived.derivation import Derivation
from hil.bench.envelope import Monitor, Trip
from hil.clock.port import NANOSECONDS

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Columns", "DerivedFeed", "Fed"]

Columns = int | tuple[int, ...]
"""Which column of a row holds a limit's quantity, or which ones hold what it is derived from."""

Fed = Sequence[tuple[Columns, Monitor]]
"""The monitors that a stream feeds."""


class DerivedFeed:
    """Those of the monitors that a stream feeds whose quantity is derived.

    Args:
        monitors: each with its columns; those with a single column are none of them.

    Attributes:
        any: whether there is one.
        places: which place of a row holds which of their quantities.
    """

    def __init__(self, monitors: Fed) -> None:
        self._fed: list[tuple[tuple[int, ...], Monitor, Derivation]] = [
            (columns, monitor, monitor.derivation)
            for columns, monitor in monitors
            if isinstance(columns, tuple) and monitor.derivation is not None
        ]
        self.places = {
            name: column
            for columns, _, derivation in self._fed
            for column, (_, name) in zip(columns, derivation.sources, strict=True)
        }
        self.any = bool(self._fed)

    def judge(
        self, rows: list[list[float]] | NDArray[np.float64], ahead_ns: int, by_ns: int
    ) -> tuple[int, Trip] | None:
        """Count rows, at least one; return the first that trips, and its trip.

        Args:
            rows: time in s by the stream's own clock, and the channels.
            ahead_ns: what the bench's time is ahead of that clock.
            by_ns: how much later the instant of the last row is set.
        """
        plain: list[list[float]] = rows if isinstance(rows, list) else rows.tolist()
        course = Course([round(row[0] * NANOSECONDS) for row in plain], plain, self.places)
        last_ns = (course.at_ns[-1] + ahead_ns,)
        found: tuple[int, Trip] | None = None
        for columns, monitor, derivation in self._fed:
            if derivation.quiet(course):
                if monitor.all_good(last_ns, (), by_ns):
                    continue
                values = [monitor.inside] * len(plain)
            else:
                values = _values(derivation, monitor.inside, course.at_ns, plain, columns)
            tripped = _tripped(monitor, course.at_ns, values, ahead_ns, by_ns)
            if tripped and (found is None or tripped[0] < found[0]):
                found = tripped
        return found

    def count(self, rows: list[list[float]]) -> None:
        """Count rows, at least one, of which none can trip."""
        course = Course([round(row[0] * NANOSECONDS) for row in rows], rows, self.places)
        for columns, monitor, derivation in self._fed:
            if not derivation.quiet(course):
                _values(derivation, monitor.inside, course.at_ns, rows, columns)

    def count_void(self, rows: list[list[float]]) -> None:
        """Count rows that are void, and judge nothing: what flowed then has flowed; around them nothing is known."""
        for columns, monitor, derivation in self._fed:
            derivation.pause()
            at_ns = [round(row[0] * NANOSECONDS) for row in rows]
            _values(derivation, monitor.inside, at_ns, rows, columns)
            derivation.pause()


def _values(
    derivation: Derivation, inside: float, at_ns: Sequence[int], rows: list[list[float]], columns: tuple[int, ...]
) -> list[float]:
    """Return the quantity at every row, a value within the limit where that does not count."""
    values = []
    for when_ns, row in zip(at_ns, rows, strict=True):
        value = derivation.row(when_ns, [row[column] for column in columns])
        values.append(value if derivation.applies else inside)
    return values


def _tripped(
    monitor: Monitor, at_ns: Sequence[int], values: list[float], ahead_ns: int, by_ns: int
) -> tuple[int, Trip] | None:
    last = len(values) - 1
    for place, (when_ns, value) in enumerate(zip(at_ns, values, strict=True)):
        if trip := monitor.judge_row(when_ns + ahead_ns, value, by_ns if place == last else 0):
            return place, trip
    return None
