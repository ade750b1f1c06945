"""`record.during`: a recording in parallel with the case."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from types import TracebackType
from typing import TYPE_CHECKING, NoReturn, Protocol, Self

from hil.clock.port import NANOSECONDS
from hil.documents.suggest import did_you_mean
from hil.executive.cases.certificate import calibrated, uncovered
from hil.executive.cases.effects import Effects
from hil.executive.cases.streaming import Condition
from hil.executive.cases.taking import Taking
from hil.executive.watching.scheduler import Scheduler
from hil.model.errors import HilError, Misused, NotInTime
from hil.model.figure import Figure
from hil.model.provenance import Provenance

if TYPE_CHECKING:
    from hil.executive.cases.recording import Recording

__all__ = ["During", "KeepsRecordings"]

_HINT = "wait longer, or check what the device does"


class KeepsRecordings(Protocol):
    """The recorder that keeps what was recorded."""

    def keep(self, taking: Taking) -> Recording:
        """Keep a complete recording for the requirements that ask for it, and return it."""
        ...


class During:
    """One recording beside a case; a context manager.

    While the block runs, the scheduler fetches rows at every scheduling point at which they are due. The end of the
    block fetches the rest and finishes the recording; an exception ends it, too, and what was recorded is kept as
    incomplete.

    Args:
        taking: the recording.
        effects: where beginning, waits and end are recorded.
        scheduler: lets bench time pass.
        keeper: keeps complete recordings.
    """

    def __init__(self, taking: Taking, effects: Effects, scheduler: Scheduler, keeper: KeepsRecordings) -> None:
        self._taking = taking
        self._effects = effects
        self._scheduler = scheduler
        self._keeper = keeper
        self._name = taking.facts.name
        self._recording: Recording | None = None

    @property
    def recording(self) -> Recording:
        """The finished recording.

        Raises:
            Misused: within the block, or if the recording was not finished.
        """
        if self._recording is None:
            raise Misused(f"record '{self._name}' is not finished", "use its recording after the `with` block")
        return self._recording

    def __getitem__(self, channel: str) -> NoReturn:
        """Refuse, and point to where the values are.

        Raises:
            Misused: always.
        """
        hint = f"after the `with` block take its .recording[{channel!r}], or within it .latest({channel!r})"
        raise Misused(f"record '{self._name}' runs beside the case, and has no values of its own", hint)

    def __enter__(self) -> Self:
        facts = self._taking.facts
        if self._taking.begun:
            raise Misused(f"record '{self._name}' was already started", "call record.during for each recording")
        arguments = {"rate": facts.rate, "channels": [channel.name for channel in facts.channels]}
        self._scheduler.point()
        self._effects.perform(f"record.{self._name}.begin", "records", arguments, self._taking.begin)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self._end(complete=True)
            if self._taking.whole:
                self._recording = self._keeper.keep(self._taking)
            return
        with suppress(HilError):  # the case must see the exception that ended the block
            self._end(complete=False)

    def until(
        self,
        channel: str,
        *,
        within: float,
        equals: float | None = None,
        above: float | None = None,
        below: float | None = None,
    ) -> float:
        """Wait for a row in which a channel equals, or is above or below, a number; return that row's bench time in s.

        Every row is checked, from the newest one on; after another `until`, from the row that it found.

        Args:
            channel: the channel's name.
            within: how long to wait at most [s].
            equals: the value to wait for, or
            above: the value to exceed, or
            below: the value to fall below.

        Raises:
            NotInTime: no such row came in time.
            Misused: for an unknown channel, or not exactly one condition.
        """
        given = {"equals": equals, "above": above, "below": below}
        chosen = {name: float(bound) for name, bound in given.items() if bound is not None}
        if len(chosen) != 1 or not all(math.isfinite(bound) for bound in chosen.values()):
            raise Misused(f"record '{self._name}': until takes one of equals, above and below", "give it one number")
        ((compare, bound),) = chosen.items()
        condition = Condition(self._column(channel), compare, bound)
        arguments = {"channel": channel, compare: bound, "within": within}
        return self._wait(f"record.{self._name}.until", arguments, lambda: self._until(condition, channel, within))

    def until_over(self, *, within: float) -> float:
        """Wait until the device reports the end of its test, and return the bench time at which that was seen, in s.

        Raises:
            NotInTime: it did not in time.
            Misused: it never reports that.
        """
        self._require_running()
        if self._taking.turns.over is None:
            raise Misused(f"record '{self._name}': its device does not say when a test is over", "wait with until")
        return self._wait(f"record.{self._name}.until_over", {"within": within}, lambda: self._until_over(within))

    def latest(self, channel: str) -> Figure:
        """Return the newest value of a channel, with the uncertainty of the certificate.

        Raises:
            NotInTime: no row has come yet.
        """
        column = self._column(channel)
        self._scheduler.point()
        found = self._effects.perform(
            f"record.{self._name}.latest", "reads", {"channel": channel}, lambda: self._latest(column)
        )
        source, unit = self._taking.measures[column - 1]
        provenance = Provenance(
            instruments=(source.instrument.name,),
            sources=(f"recording {self._name}, {channel}",),
            uncovered=uncovered(source.instrument, unit, found.value),
        )
        self._effects.learnt(provenance)
        return found.with_provenance(provenance)

    def _end(self, *, complete: bool) -> None:
        name, arguments = f"record.{self._name}.end", {"complete": complete}
        try:
            self._effects.perform(name, "records", arguments, lambda: self._taking.end(complete=complete))
        finally:
            self._taking.end(complete=False)  # if the effect was not performed

    def _wait(self, name: str, arguments: Mapping[str, object], action: Callable[[], float]) -> float:
        self._require_running()
        if not arguments["within"] > 0:  # type: ignore[operator]  # a number
            raise ValueError(f"{name}: cannot wait for {arguments['within']} s")
        return self._effects.perform(name, "waits", arguments, action)

    def _until(self, condition: Condition, channel: str, within: float) -> float:
        intake, turns = self._taking.intake, self._taking.turns
        intake.await_row(condition)
        try:
            if intake.found is None:  # no row comes after the end of the device's own test
                self._wait_for(within, lambda: intake.found is not None or bool(turns.over))
        finally:
            intake.await_nothing()
        if intake.found is None:
            word = "equal to" if condition.compare == "equals" else condition.compare
            newest = f"the newest is {intake.last[condition.column] + 0.0:.6g}" if intake.last else "no row has come"
            when = "until its test was over" if turns.over else f"within {within:g} s"
            raise NotInTime(f"record '{self._name}': no {channel} {word} {condition.bound:g} {when}, {newest}", _HINT)
        return round(intake.found, 9)

    def _until_over(self, within: float) -> float:
        turns = self._taking.turns
        if not turns.over:
            self._wait_for(within, lambda: bool(turns.over))
        if not turns.over:
            last = self._taking.intake.last
            names = [channel.name for channel in self._taking.facts.channels]
            pairs = zip(names, (last or [])[1:], strict=False)
            newest = ", ".join(f"{name} {value + 0.0:.6g}" for name, value in pairs) or "no row has come"
            raise NotInTime(f"record '{self._name}': not over within {within:g} s, the newest row is: {newest}", _HINT)
        return self._scheduler.now_ns() / NANOSECONDS

    def _wait_for(self, within: float, done: Callable[[], bool]) -> None:
        """Wait until rows show it; rows that arrived in time but await their turn are fetched at the end."""
        self._scheduler.wait_until(self._scheduler.in_ns(within), done)
        if not done():
            self._taking.turns.take_early()

    def _latest(self, column: int) -> Figure:
        last = self._taking.intake.last
        if last is None:
            raise NotInTime(f"record '{self._name}': no row has come yet", "wait first, with until or clock.sleep")
        source, unit = self._taking.measures[column - 1]
        return calibrated(Figure(value=last[column], unit=unit), source.instrument.calibration)

    def _column(self, channel: str) -> int:
        self._require_running()
        names = [each.name for each in self._taking.facts.channels]
        if channel not in names:
            raise Misused(f"record '{self._name}' has no channel '{channel}'{did_you_mean(channel, names)}", "")
        return names.index(channel) + 1

    def _require_running(self) -> None:
        if not self._taking.running:
            raise Misused(f"record '{self._name}' is not running", "wait and read within its `with` block")
