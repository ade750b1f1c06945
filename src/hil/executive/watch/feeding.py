"""Limits of the envelope that a stream feeds: every row of it is judged, so that nobody has to ask."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from operator import itemgetter
from typing import TYPE_CHECKING

from hil.bench.envelope import Monitor, Trip
from hil.clock.port import NANOSECONDS
from hil.executive.watch.derived_feed import Columns, DerivedFeed, Fed
from hil.executive.watch.glance import Glance
from hil.instruments.registry import unit_of

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Feed", "Feeds", "monitors_of", "pause_allowed"]


def monitors_of(
    output: str, columns: Mapping[tuple[str, str], int], every_s: float, monitors: Sequence[Monitor]
) -> Fed:
    """Return the monitors that a stream can feed, each with the columns of a row that hold its quantity.

    Rows have to come often enough for the maximum age, with time left to take a reading where none do any more.

    Args:
        output: the role instance that streams.
        columns: which place of a row holds what, by quantity and unit.
        every_s: how far apart rows may come.
        monitors: those to choose from.
    """
    return [
        (found, monitor)
        for monitor in monitors
        if every_s <= monitor.limit.max_age_s - monitor.limit.period_s
        and (found := _columns_of(monitor, output, columns)) is not None
    ]


def _columns_of(monitor: Monitor, output: str, columns: Mapping[tuple[str, str], int]) -> Columns | None:
    limit, derivation = monitor.limit, monitor.derivation
    if derivation is None:
        return columns.get((limit.quantity, limit.unit)) if limit.output == output else None
    found = [columns.get((name, unit_of(at, name))) for at, name in derivation.sources if at == output]
    places = tuple(place for place in found if place is not None)
    return places if len(places) == len(derivation.sources) else None


def pause_allowed(monitors: Fed, row_s: float) -> float:
    """Return how long rows may wait in seconds: no limit is looked at more seldom than its period, and none trips.

    Args:
        monitors: those that a stream feeds.
        row_s: from row to row.
    """
    limits = [monitor.limit for _, monitor in monitors]
    return min(min(limit.period_s, limit.max_age_s - limit.period_s - row_s) for limit in limits)


class Feed:
    """The monitors that the rows of one stream feed.

    The age between two rows is that by the stream's own clock; the age of the last one counts from the moment at
    which it was fetched. So a clock that goes otherwise than the bench's makes no row older than it is.

    Args:
        monitors: each with the columns of a row that hold its quantity.
        every_s: how far apart rows may come.
        recording: the recording's id, for the words of a trip.
    """

    def __init__(self, monitors: Fed, every_s: float, recording: str) -> None:
        self._recording = recording
        self._fed = [(columns, monitor) for columns, monitor in monitors if isinstance(columns, int)]
        self._derived = DerivedFeed(monitors)
        self._monitors = [monitor for _, monitor in monitors]
        self._ahead_ns = 0
        places = {monitor.limit.quantity: column for column, monitor in self._fed} | self._derived.places
        self._glance = Glance(self._monitors, places, self._derived.count)
        for monitor in self._monitors:
            monitor.feed(every_s)
            monitor.catch_up = self._glance.catch_up

    def judge(self, rows: list[list[float]] | NDArray[np.float64], now_ns: int) -> Trip | None:
        """Judge rows that were fetched now, at least one; return the trip of the first one that trips, if any."""
        ahead_ns = now_ns - round(rows[-1][0] * NANOSECONDS)
        by_ns = ahead_ns - self._ahead_ns
        if self._derived.any:
            if isinstance(rows, list) and self._glance.passes(rows, self._ahead_ns, by_ns):
                self._ahead_ns = ahead_ns
                return None
            self._glance.catch_up()
        found = self._few(rows, by_ns) if isinstance(rows, list) else self._many(rows, by_ns)
        if self._derived.any:
            derived = self._derived.judge(rows, self._ahead_ns, by_ns)
            found = min((each for each in (found, derived) if each), key=itemgetter(0), default=None)
        self._ahead_ns = ahead_ns
        if found is None:
            return None
        place, trip = found
        return replace(trip, text=f"{trip.text}, at {rows[place][0]:.9g} s of recording {self._recording}")

    def count_void(self, rows: NDArray[np.float64]) -> None:
        """Count void rows for what adds up, and judge none: what flowed while they came has flowed."""
        self._glance.catch_up()
        self._derived.count_void(rows.tolist())

    def end(self, now_ns: int) -> None:
        """Let the monitors take readings again."""
        self._glance.catch_up()
        for monitor in self._monitors:
            monitor.catch_up = _nothing
            monitor.unfeed(now_ns)

    def _few(self, rows: list[list[float]], by_ns: int) -> tuple[int, Trip] | None:
        ahead_ns = self._ahead_ns
        when_ns = [round(row[0] * NANOSECONDS) + ahead_ns for row in rows]
        left = [each for each in self._fed if not each[1].all_good(when_ns, [row[each[0]] for row in rows], by_ns)]
        if not left:
            return None
        last = len(rows) - 1
        for place, row in enumerate(rows):
            then_ns = by_ns if place == last else 0
            for column, monitor in left:
                if trip := monitor.judge_row(when_ns[place], row[column], then_ns):
                    return place, trip
        return None

    def _many(self, rows: NDArray[np.float64], by_ns: int) -> tuple[int, Trip] | None:
        import numpy as np  # noqa: PLC0415 - slow to import

        when_ns = np.rint(rows[:, 0] * NANOSECONDS).astype(np.int64) + self._ahead_ns
        found = [monitor.judge_rows(when_ns, rows[:, column], by_ns) for column, monitor in self._fed]
        return min((each for each in found if each), key=itemgetter(0), default=None)


class Feeds:
    """The feeds of a run, each by the id of its recording."""

    def __init__(self) -> None:
        self._feeds: dict[str, Feed] = {}
        self._void: dict[str, Callable[[], NDArray[np.float64]]] = {}

    def begin(self, fed: Fed, every_s: float, recording: str) -> Feed:
        """Return what judges a recording's rows. See `Feed`."""
        feed = self._feeds[recording] = Feed(fed, every_s, recording)
        if (void_rows := self._void.pop(recording, None)) is not None:
            feed.count_void(void_rows())
        return feed

    def end(self, feed: Feed, now_ns: int) -> None:
        """Let the monitors of a feed take readings again."""
        feed.end(now_ns)
        self._feeds = {name: each for name, each in self._feeds.items() if each is not feed}

    def pass_over(self, recording: str, void_rows: Callable[[], NDArray[np.float64]]) -> None:
        """Count rows of a recording that are void for what adds up, now or when it begins again."""
        if feed := self._feeds.get(recording):
            feed.count_void(void_rows())
        else:
            self._void[recording] = void_rows


def _nothing() -> None:
    """No rows wait any more."""
