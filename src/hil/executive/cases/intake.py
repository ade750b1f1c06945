"""What becomes of rows that were fetched beside a case: stored, judged by the envelope, and looked at by the case."""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hil.executive.journaling.row_store import OpenRecording
from hil.executive.watching.feeding import Feed
from hil.executive.watching.scheduler import Scheduler

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from hil.evidence.recordings.rows import Rows

__all__ = ["Condition", "Intake"]

_FEW = 64
"""Up to this many rows plain numbers are quicker than arrays."""


@dataclass(frozen=True, slots=True)
class Condition:
    """What a case waits for: the column of a row, how it is compared, and with what."""

    column: int
    compare: str
    bound: float

    def first(self, rows: list[list[float]] | NDArray[np.float64]) -> int | None:
        """Return the place of the first row that fulfils it, None where none does; NaN fulfils nothing."""
        compare: Callable[..., object] = getattr(operator, _COMPARISONS[self.compare])
        if isinstance(rows, list):
            for place, row in enumerate(rows):
                if compare(row[self.column], self.bound):
                    return place
            return None
        fulfilled = compare(rows[:, self.column], self.bound)
        return int(fulfilled.argmax()) if fulfilled.any() else None  # type: ignore[attr-defined]  # an array of flags


_COMPARISONS = {"above": "gt", "below": "lt", "equals": "eq"}


class Intake:
    """Takes the rows of one recording.

    Args:
        recording: where they are stored.
        scheduler: judges them by the envelope.

    Attributes:
        feed: the limits that they feed, if any.
        last: the newest row, time in s and the channels; None before the first.
    """

    def __init__(self, recording: OpenRecording, scheduler: Scheduler) -> None:
        self._rows: Rows = recording.rows
        self._scheduler = scheduler
        self._condition: Condition | None = None
        self._unseen: list[list[float]] | NDArray[np.float64] = []
        self.feed: Feed | None = None
        self.last: list[float] | None = None
        self.found: float | None = None

    def take(self, block: NDArray[np.float64], start_s: float) -> None:
        """Take rows, shape (n, 1 + channels), at least one; `start_s` is added to their times."""
        if len(block) > _FEW:
            block = block.copy()
            block[:, 0] += start_s
            self._rows.append_rows(block)
            self._pass_on(block, block[-1].tolist())
            return
        rows: list[list[float]] = block.tolist()
        append = self._rows.append
        for row in rows:
            row[0] += start_s
            append(row)
        self._pass_on(rows, rows[-1])

    def take_row(self, row: list[float]) -> None:
        """Take one row: bench time in s, and the channels."""
        self._rows.append(row)
        self._pass_on([row], row)

    def await_row(self, condition: Condition) -> None:
        """Look for a row that fulfils a condition: from the newest one on, or from the one that was found last."""
        self.found = None
        self._condition = condition
        if len(self._unseen):
            self._search(self._unseen)

    def await_nothing(self) -> None:
        """Look for nothing any more."""
        self._condition = None

    def _pass_on(self, rows: list[list[float]] | NDArray[np.float64], last: list[float]) -> None:
        self.last = last
        self._unseen = [last]
        if self.feed is not None:
            self._scheduler.judge(self.feed, rows)
        if self._condition is not None and self.found is None:
            self._search(rows)

    def _search(self, rows: list[list[float]] | NDArray[np.float64]) -> None:
        place = self._condition.first(rows) if self._condition else None
        if place is not None:
            self._unseen = rows[place:]
            self.found = float(rows[place][0])
