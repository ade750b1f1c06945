"""Limits of the envelope fed by a stream: every row is judged, so that no separate readings are needed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from operator import itemgetter
from typing import TYPE_CHECKING

from hil.bench.derived.course import Course, Room, common_room
from hil.bench.derived.derivation import Derivation
from hil.bench.envelope import Monitor, Trip, all_fresh
from hil.clock.port import NANOSECONDS
from hil.instruments.registry import unit_of

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["OFTEN", "Columns", "DerivedFeed", "Fed", "Feed", "Feeds", "Glance", "monitors_of", "pause_allowed"]

_MOST_ROWS = 240

OFTEN = 10
"""Rows needed per period of a limit to replace its readings: an excursion is confirmed as soon as by readings."""

_Look = tuple[int, list[tuple[int, float, float]]]


class Glance:
    """Fast path for rows within the room of all limits: they are queued, and counted together.

    Args:
        monitors: all that the stream feeds.
        places: the column of each quantity.
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
        """Return whether rows are good at a glance, and queue them if so; see `Feed.judge`."""
        look = self._look or self._new_look()
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
        """Count the queued rows."""
        waiting, self._waiting, self._look = self._waiting, [], None
        if waiting:
            self._count(waiting)

    def _new_look(self) -> _Look | None:
        """Work out the room for further rows after those counted last."""
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


Columns = int | tuple[int, ...]
"""The column of a limit's quantity, or the columns that it is derived from."""

Fed = Sequence[tuple[Columns, Monitor]]
"""The monitors that a stream feeds."""


class DerivedFeed:
    """The monitors on derived quantities among those that a stream feeds.

    Args:
        monitors: each with its columns; those with a single column are left out.

    Attributes:
        any: whether there is one.
        places: the column of each of their quantities.
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
            ahead_ns: how far the bench's time is ahead of that clock.
            by_ns: by how much the instant of the last row is shifted.
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
        """Count rows, at least one, none of which can trip."""
        course = Course([round(row[0] * NANOSECONDS) for row in rows], rows, self.places)
        for columns, monitor, derivation in self._fed:
            if not derivation.quiet(course):
                _values(derivation, monitor.inside, course.at_ns, rows, columns)

    def count_void(self, rows: list[list[float]]) -> None:
        """Count void rows without judging them: what flowed then has flowed; around them nothing is known."""
        for columns, monitor, derivation in self._fed:
            derivation.pause()
            at_ns = [round(row[0] * NANOSECONDS) for row in rows]
            _values(derivation, monitor.inside, at_ns, rows, columns)
            derivation.pause()


def _values(
    derivation: Derivation, inside: float, at_ns: Sequence[int], rows: list[list[float]], columns: tuple[int, ...]
) -> list[float]:
    """Return the quantity at every row, with a value within the limit where it does not apply."""
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


def monitors_of(
    output: str, columns: Mapping[tuple[str, str], int], every_s: float, monitors: Sequence[Monitor]
) -> Fed:
    """Return the monitors that a stream can feed, each with the columns of its quantity.

    Rows must come often enough for the maximum age, with time left to take a reading if they stop.

    Args:
        output: the role instance that streams.
        columns: the column of each quantity and unit.
        every_s: the longest interval between rows.
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
    found = [_column_of(name, unit_of(at, name), columns) for at, name in derivation.sources if at == output]
    places = tuple(place for place in found if place is not None)
    return places if len(places) == len(derivation.sources) else None


def _column_of(name: str, unit: str, columns: Mapping[tuple[str, str], int]) -> int | None:
    """Return the column of a quantity in its role's unit; an input named by the wire only has the wire's unit."""
    if unit:
        return columns.get((name, unit))
    return next((column for (each, _), column in columns.items() if each == name), None)


def pause_allowed(monitors: Fed, row_s: float) -> float:
    """Return how long rows may wait in s so that every limit is read at least once per period, and none trips.

    Args:
        monitors: those that a stream feeds.
        row_s: interval between rows.
    """
    limits = [monitor.limit for _, monitor in monitors]
    return min(min(limit.period_s, limit.max_age_s - limit.period_s - row_s) for limit in limits)


class Feed:
    """The monitors that the rows of one stream feed.

    The age between two rows is by the stream's own clock; the age of the last one counts from when it was fetched. So
    a clock that drifts against the bench's makes no row older than it is.

    Args:
        monitors: each with the columns of its quantity.
        every_s: the longest interval between rows.
        recording: the recording's id, for the text of a trip.

    Attributes:
        monitors: those that it feeds.
    """

    def __init__(self, monitors: Fed, every_s: float, recording: str) -> None:
        self._recording = recording
        self._fed = [(columns, monitor) for columns, monitor in monitors if isinstance(columns, int)]
        self._derived = DerivedFeed(monitors)
        self.monitors = [monitor for _, monitor in monitors]
        self._ahead_ns = 0
        places = {monitor.limit.quantity: column for column, monitor in self._fed} | self._derived.places
        self._glance = Glance(self.monitors, places, self._derived.count)
        for monitor in self.monitors:
            monitor.feed(every_s)
            monitor.catch_up = self._glance.catch_up

    def judge(self, rows: list[list[float]] | NDArray[np.float64], now_ns: int) -> Trip | None:
        """Judge rows that were just fetched, at least one; return the trip of the first one that trips, if any."""
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
        """Count void rows for integrals without judging them: what flowed while they came has flowed."""
        self._glance.catch_up()
        self._derived.count_void(rows.tolist())

    def end(self, now_ns: int) -> None:
        """Have the monitors take readings again."""
        self._glance.catch_up()
        for monitor in self.monitors:
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
    """The feeds of a run, by the id of their recording."""

    def __init__(self) -> None:
        self._feeds: dict[str, Feed] = {}
        self._void: dict[str, Callable[[], NDArray[np.float64]]] = {}

    def begin(self, fed: Fed, every_s: float, recording: str) -> Feed:
        """Return the feed that judges a recording's rows. See `Feed`."""
        feed = self._feeds[recording] = Feed(fed, every_s, recording)
        if (void_rows := self._void.pop(recording, None)) is not None:
            feed.count_void(void_rows())
        return feed

    def feeds(self, monitor: Monitor) -> bool:
        """Return whether rows feed a monitor."""
        return any(monitor in each.monitors for each in self._feeds.values())

    def end(self, feed: Feed, now_ns: int) -> None:
        """Have the monitors of a feed take readings again."""
        feed.end(now_ns)
        self._feeds = {name: each for name, each in self._feeds.items() if each is not feed}

    def pass_over(self, recording: str, void_rows: Callable[[], NDArray[np.float64]]) -> None:
        """Count a recording's void rows for integrals, now or when it restarts."""
        if feed := self._feeds.get(recording):
            feed.count_void(void_rows())
        else:
            self._void[recording] = void_rows


def _nothing() -> None:
    """Do nothing: no rows are queued any more."""
