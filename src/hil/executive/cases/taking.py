"""One recording from its first row to its last, however its rows are fetched."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict

from hil.bench.envelope import Monitor
from hil.evidence import events
from hil.executive.cases.facade import Facade
from hil.executive.cases.streaming import Intake, SampledTurns, StreamTurns
from hil.executive.journaling.row_store import OpenRecording, RowStore
from hil.executive.watching.feeding import OFTEN, Columns, Fed, monitors_of, pause_allowed
from hil.executive.watching.scheduler import Scheduler
from hil.instruments.registry import inputs_of
from hil.instruments.sampled import StreamReport
from hil.model.errors import Misused

__all__ = ["Taking", "fed_by"]


def fed_by(facts: events.Recording, sources: Sequence[Facade], scheduler: Scheduler) -> Fed:
    """Return the limits fed by the rows of sampled roles, which are then not read separately."""
    if not (scheduler.watching and scheduler.timeline.all_share):
        return ()
    every_s, place, found = 1 / facts.rate, 1, list[tuple[Columns, Monitor]]()
    free = [
        each
        for each in scheduler.monitoring.all
        if each.derivation is None and each.limit.period_s >= OFTEN * every_s and not scheduler.feeds.feeds(each)
    ]
    for source in sources:
        channels = source.sampled.channels()
        columns = {(channel.name, channel.unit): column for column, channel in enumerate(channels, place)}
        found += monitors_of(source.wire.name, columns, every_s, free)
        place += len(channels)
    return found


class Taking:
    """A recording whose rows are fetched in turns by the scheduler.

    Args:
        facts: the facts known before the first row.
        sources: the façades of the recorded roles.
        turns: fetches the rows.
        scheduler: schedules the turns.
        store: opens row files.

    Attributes:
        intake: takes the rows.
        report: the stream's statistics, once it has ended; None if there was no stream.
        whole: whether the recording ended as planned.
    """

    intake: Intake

    def __init__(
        self,
        facts: events.Recording,
        sources: Sequence[Facade],
        turns: StreamTurns | SampledTurns,
        scheduler: Scheduler,
        store: RowStore,
    ) -> None:
        self._fed: Fed = ()
        self.facts = facts
        self.sources = tuple(sources)
        self.turns = turns
        self.report: StreamReport | None = None
        self.whole = False
        self._scheduler = scheduler
        self._store = store
        self._recording: OpenRecording | None = None
        self._result: str | Mapping[str, object] | None = None

    @property
    def begun(self) -> bool:
        """Whether it has begun."""
        return self._recording is not None

    @property
    def running(self) -> bool:
        """Whether it has begun, and not ended."""
        return self._recording is not None and self._result is None

    @property
    def covers_s(self) -> float:
        """The time that its rows cover, including those from before its run was stopped; 0 without any."""
        rows = self._recording.rows if self._recording else None
        return rows.covers_s() + 1 / self.facts.rate if rows and rows.rows else 0.0

    @property
    def measures(self) -> list[tuple[Facade, str]]:
        """The façade and the unit of every channel."""
        return [(source, channel.unit) for source in self.sources for channel in source.sampled.channels()]

    def begin(self) -> None:
        """Open the row file and start the rows.

        Raises:
            DeviceFault: a device does not answer; the recording is ended as incomplete.
            Misused: rate, gap and maximum ages cannot all be met; nothing has begun then.
        """
        if isinstance(self.turns, SampledTurns):
            self._fed = fed_by(self.facts, self.sources, self._scheduler)
            self.turns.prepare(self._fed)
        self._recording = self._store.begin(self.facts)
        self.intake = Intake(self._recording, self._scheduler)
        try:
            self.turns.begin(self.intake)
            self._feed()
            if isinstance(self.turns, SampledTurns):
                self._scheduler.monitoring.bus.shares.append(self.turns.share)
            self._scheduler.begin_beside(self.turns)
        except BaseException:
            self.end(complete=False)
            raise

    def end(self, *, complete: bool) -> str | Mapping[str, object]:
        """End, and return the hash of all rows, for a stream also its statistics; a second call returns the same.

        Args:
            complete: whether to fetch the rest; otherwise what has arrived is kept as incomplete.

        Raises:
            DeviceFault: a device falls silent at the end; the recording is then incomplete.
            Tripped: one of the last rows is outside the envelope.
        """
        if self._result is not None or self._recording is None:
            return self._result or ""
        self._scheduler.end_beside(self.turns)
        if isinstance(self.turns, SampledTurns):
            self._scheduler.monitoring.bus.leave(self.turns.share)
        digest = ""
        try:
            if complete and not self.turns.failed:
                self.report = self.turns.end()
                self.whole = True
            else:
                self.turns.give_up()
        finally:
            if self.intake.feed:
                self._scheduler.unfeed(self.intake.feed)
            if self._store.holds(self._recording):
                digest = self._recording.finish(complete=self.whole)
            self._result = {"sha256": digest, **asdict(self.report)} if self.report else digest
        return self._result

    def _feed(self) -> None:
        """Have the rows feed the limits that watch them."""
        if self._fed:
            self.intake.feed = self._scheduler.feed(self._fed, self.turns.every_s, self.facts.recording)
        if isinstance(self.turns, StreamTurns):
            source = self.sources[0]
            columns = {
                (channel.name, channel.unit): place for place, channel in enumerate(source.sampled.channels(), 1)
            }
            timeline, monitors = self._scheduler.timeline, self._scheduler.monitoring.all
            if fed := monitors_of(source.wire.name, columns, self.turns.every_s, monitors):
                pause_s = pause_allowed(fed, 1 / self.facts.rate) if timeline.rows_wait else 0.0
                self.turns.may_pause(pause_s, together=timeline.rows_together)
                self.intake.feed = self._scheduler.feed(fed, self.turns.every_s, self.facts.recording)
            self._require_fed(source, [monitor for _, monitor in fed], monitors)

    def _require_fed(self, source: Facade, fed: Sequence[Monitor], monitors: Sequence[Monitor]) -> None:
        """Require that the rows feed every limit on an input of that wire: it cannot be read separately."""
        inputs = inputs_of(source.instrument.driver, source.wire)
        for monitor in monitors:
            limit = monitor.limit
            of_input = limit.quantity in inputs or limit.of in inputs
            if limit.output == source.wire.name and of_input and monitor not in fed:
                allowed_s = limit.max_age_s - limit.period_s
                raise Misused(
                    f"record '{self.facts.name}': rows of {source.wire.name} may come {self.turns.every_s:.3g} s apart,"
                    f" and the limit {limit.id} needs them within {allowed_s:.3g} s, its max_age less its period",
                    "record at a higher rate, or allow a longer max_age in the bench file",
                )
