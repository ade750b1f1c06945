"""Streaming beside a case: devices that are drained or sampled in turns, and the intake of their rows."""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, cast

from hil.clock.port import FOREVER_NS, NANOSECONDS
from hil.executive.cases.facade import Facade
from hil.executive.journaling.row_store import OpenRecording
from hil.executive.watching.feeding import Fed, Feed
from hil.executive.watching.ports import Beside
from hil.executive.watching.scheduler import Scheduler
from hil.executive.watching.sharing import Course, Share
from hil.instruments.sampled import Ending, Patient, Streamed, StreamReport
from hil.model.errors import DeviceFault, Refused

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from hil.clock.port import Clock
    from hil.evidence.recordings.rows import Rows

__all__ = ["Condition", "Intake", "SampledTurns", "StreamTurns", "Turns"]

_FEW = 64
"""Up to this many rows plain numbers are faster than arrays."""


@dataclass(frozen=True, slots=True)
class Condition:
    """A condition that a case waits for: the column of a row, the comparison, and the value."""

    column: int
    compare: str
    bound: float

    def first(self, rows: list[list[float]] | NDArray[np.float64]) -> int | None:
        """Return the index of the first row that fulfils it, None if none does; NaN fulfils nothing."""
        compare: Callable[..., object] = getattr(operator, _COMPARISONS[self.compare])
        if isinstance(rows, list):
            for place, row in enumerate(rows):
                if compare(row[self.column], self.bound):
                    return place
            return None
        fulfilled = compare(rows[:, self.column], self.bound)
        return int(fulfilled.argmax()) if fulfilled.any() else None  # type: ignore[attr-defined]  # a boolean array


_COMPARISONS = {"above": "gt", "below": "lt", "equals": "eq"}


class Intake:
    """Takes the rows of one recording.

    Args:
        recording: stores them.
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
        """Look for a row that fulfils a condition: from the newest one on, or from the last one found."""
        self.found = None
        self._condition = condition
        if len(self._unseen):
            self._search(self._unseen)

    def await_nothing(self) -> None:
        """Stop looking."""
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


class Turns(Beside, Protocol):
    """Fetches the rows of one recording, turn by turn.

    Attributes:
        every_s: the longest interval between rows.
        failed: whether a device fell silent; nothing more is fetched then.
    """

    every_s: float
    failed: bool

    def begin(self, intake: Intake) -> None:
        """Begin; rows go to `intake` from now on.

        Raises:
            DeviceFault: the device, or one on the way to it, does not answer.
        """
        ...

    def take_early(self) -> None:
        """Fetch any waiting rows before their turn."""
        ...

    def end(self) -> StreamReport | None:
        """Fetch the rest, end, and return the stream's statistics, None if there was no stream.

        Raises:
            DeviceFault: as above; whatever can be ended is.
        """
        ...

    def give_up(self) -> None:
        """End as far as possible, and fetch nothing more."""
        ...


class StreamTurns:
    """A role that samples by itself, drained at least every `longest_pause`, or as often as its limits are read.

    The time of a row is the bench time at the beginning plus the time that the device has counted since. Any drift
    of the device's clock against the bench's is shown in the report, and changes no row.

    Args:
        source: the role's façade.
        role: the role.
        clock: the bench's clock.
        rate: samples per second.
        enough: seconds after the first row after which no row is wanted, None if the case ends the stream.

    Attributes:
        full: whether a row came that was no longer wanted.
        late: a sentence, if rows were fetched so late that some may have been lost; empty if they never were.
    """

    def __init__(self, source: Facade, role: Streamed, clock: Clock, rate: float, enough: float | None = None) -> None:
        self.what = f"the stream of {source.wire.name}"
        self.late = ""
        self._fetched_ns = FOREVER_NS
        self._source = source
        self._role = role
        self._tells_of_its_end = hasattr(role, "over")
        self._clock = clock
        self._rate = rate
        self._enough = enough
        self._first: float | None = None
        self._allowed_s = 0.0
        self._together = False
        self.every_s = 1 / rate
        self.due_ns = FOREVER_NS
        self.failed = False
        self.full = False

    def begin(self, intake: Intake) -> None:
        """Start the device's sampling. See `Turns`."""
        try:
            self._source.guarded(lambda: self._role.begin(self._rate))
        except BaseException:
            self.failed = True
            raise
        self._intake = intake
        self._start_ns = self._fetched_ns = self._clock.now_ns()
        self._start_s = self._start_ns / NANOSECONDS
        self._keep_time()

    def may_pause(self, seconds: float, *, together: bool = True) -> None:
        """Fetch rows this seldom, if that is longer than `longest_pause`, as far as the role's buffer allows.

        Args:
            seconds: how long rows may wait.
            together: whether to do so at whole multiples of that, together with the limits that are read.
        """
        self._allowed_s, self._together = seconds, together
        self._keep_time()

    def have(self, seconds: float) -> None:
        """Want this many seconds of rows less: they exist from before the run was stopped."""
        if self._enough is not None:
            self._enough -= seconds

    def begin_again(self) -> None:
        """Restart the device's sampling; its time counts from now."""
        self.give_up()
        self.begin(self._intake)

    def take(self) -> None:
        """Fetch what has come."""
        self.due_ns += self._pause_ns
        self._fetch()
        if self.due_ns <= (now_ns := self._clock.now_ns()):
            self.due_ns += ((now_ns - self.due_ns) // self._pause_ns + 1) * self._pause_ns

    def take_early(self) -> None:
        """Fetch what has come; the next rows stay due as scheduled."""
        if not self.failed:
            self._fetch()

    def _keep_time(self) -> None:
        """Set when rows are to be fetched from now on."""
        pause_s = self._role.longest_pause
        if self._allowed_s > pause_s and hasattr(self._role, "patience"):
            pause_s = max(pause_s, min(self._allowed_s, cast("Patient", self._role).patience))
        self._pause_ns = max(1, round(pause_s * NANOSECONDS))
        self.every_s = pause_s + 1 / self._rate
        self.due_ns = self._start_ns + self._pause_ns
        if self._together:
            self.due_ns -= self.due_ns % self._pause_ns

    def _fetch(self) -> None:
        before_ns, self._fetched_ns = self._fetched_ns, self._clock.now_ns()
        if (apart_ns := self._fetched_ns - before_ns) > 2 * self._pause_ns and not self.late:
            self.late = (
                f"rows were fetched after {apart_ns / NANOSECONDS:.4g} s, where {self._pause_ns / NANOSECONDS:.4g} s"
                " are planned: the case, another instrument or the computer held that up"
            )
        try:
            block = self._source.guarded(self._role.drain)
        except BaseException:
            self.failed = True
            self.due_ns = FOREVER_NS
            raise
        if self._source.instrument.dut:
            self._fetched_ns = self._clock.now_ns()  # the time that it takes to answer does not count
        if self._enough is not None and len(block):
            self._first = float(block[0, 0]) if self._first is None else self._first
            wanted = block[block[:, 0] - self._first <= self._enough]
            self.full = len(wanted) < len(block)
            block = wanted
        if len(block):
            self._intake.take(block, self._start_s)

    def end(self) -> StreamReport:
        """Fetch the rest, and stop the device. See `Turns`."""
        try:
            if not self.full:
                self.take()
        except BaseException:
            self.give_up()
            raise
        return self._source.guarded(self._role.end)

    def give_up(self) -> None:
        """Stop the device, if it responds, and if it started: one that refused to start has nothing to end."""
        with suppress(DeviceFault, Refused):
            self._role.end()

    @property
    def over(self) -> bool | None:
        """Whether the device reports that its test has ended; None if it does not report that."""
        return cast("Ending", self._role).over if self._tells_of_its_end else None


class SampledTurns:
    """Roles that are sampled one by one, k / rate after the first sample; a missed turn is a gap.

    Args:
        sources: the roles' façades.
        clock: the bench's clock.
        rate: samples per second.
        course: records how it goes.
        shares: returns what they leave of the bus, given the limits that they feed.

    Attributes:
        share: what they leave of the bus, once they are prepared.
    """

    share: Share

    def __init__(
        self, sources: Sequence[Facade], clock: Clock, rate: float, course: Course, shares: Callable[[Fed], Share]
    ) -> None:
        self._shares = shares
        self.what = f"the recording of {' and '.join(source.wire.name for source in sources)}"
        self._sources = sources
        self.course = course
        self._clock = clock
        self._rate = rate
        self._turn = 0
        self.every_s = 1 / rate
        self.due_ns = FOREVER_NS
        self.failed = False

    def prepare(self, fed: Fed) -> None:
        """Work out the share of the bus, and have limits read that would find no room later.

        Raises:
            Misused: rate, gap and maximum ages cannot all be met.
        """
        self.share = self._shares(fed)

    def begin(self, intake: Intake) -> None:
        """Take the first sample. See `Turns`."""
        self._intake = intake
        self._start_ns = self._clock.now_ns()
        self.share.restart(self._start_ns)
        self.take()

    def begin_again(self) -> None:
        """Take a sample now, and continue at the next turn."""
        self.course.begin_again(self._clock.now_ns())
        self.take()

    def take(self) -> None:
        """Take a sample."""
        began_ns = self._clock.now_ns()
        try:
            row = [number for source in self._sources for number in source.sample()]
        except BaseException:
            self.failed = True
            self.due_ns = FOREVER_NS
            raise
        now_ns = self._clock.now_ns()
        due_ns = self._start_ns + round(self._turn * NANOSECONDS / self._rate)
        self.course.sampled(self._turn, min(due_ns, began_ns), began_ns, now_ns)
        self._turn = max(self._turn + 1, int((now_ns - self._start_ns) * self._rate / NANOSECONDS) + 1)
        self.due_ns = self._start_ns + round(self._turn * NANOSECONDS / self._rate)
        self.share.sampled(self._turn - 1, began_ns, now_ns)
        self._intake.take_row([now_ns / NANOSECONDS, *row])

    def end(self) -> None:
        """Do nothing: nothing runs by itself."""

    def take_early(self) -> None:
        """Do nothing: nothing waits."""

    def give_up(self) -> None:
        """Do nothing, as above."""

    @property
    def over(self) -> None:
        """None: a sampled role has no test of its own."""
        return None
