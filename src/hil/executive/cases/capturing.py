"""One capture: waits for an instrument's trigger, then reads block by block what it captured by itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from hil.evidence import events
from hil.executive.cases.facade import Facade
from hil.executive.journaling.row_store import RowStore
from hil.executive.watching.scheduler import Scheduler
from hil.instruments.sampled import Captured, Frame
from hil.model.errors import NotTriggered

__all__ = ["Capturing"]

_LOOK_NS = 20_000_000
"""Polling period for the instrument's trigger."""


class Capturing:
    """A recording that an instrument takes by itself.

    Args:
        name: of the recording.
        source: the role's façade.
        role: the role.
        scheduler: lets bench time pass, and monitors run, between polls and between blocks.
        store: opens row files.

    Attributes:
        facts: the facts of the recording, once the trigger has come.
    """

    facts: events.Recording

    def __init__(self, name: str, source: Facade, role: Captured, scheduler: Scheduler, store: RowStore) -> None:
        self._name = name
        self._source = source
        self._role = role
        self._scheduler = scheduler
        self._store = store

    def take(self, within: float, facts_of: Callable[[str, Facade, Frame], events.Recording]) -> Mapping[str, object]:
        """Wait for the trigger, read everything, and return the hash of the rows.

        Args:
            within: how long to wait [s].
            facts_of: returns the facts of the recording.

        Raises:
            NotTriggered: the trigger did not come in time; nothing is recorded.
            DeviceFault: the instrument falls silent; what was read is kept as incomplete.
        """
        self._wait(within)
        frame = self._source.guarded(self._role.frame)
        self.facts = facts_of(self._name, self._source, frame)
        recording = self._store.begin(self.facts)
        complete = False
        try:
            blocks = self._role.blocks(frame)
            while (block := self._source.guarded(lambda: next(blocks, None))) is not None:
                recording.rows.append_rows(block)
                self._scheduler.point()
            complete = recording.rows.rows == frame.rows
        finally:
            digest = recording.finish(complete=complete)
        return {"sha256": digest, "rows": frame.rows}

    def _wait(self, within: float) -> None:
        deadline_ns = self._scheduler.in_ns(within)
        while not self._source.guarded(self._role.complete):
            now_ns = self._scheduler.now_ns()
            if now_ns >= deadline_ns:
                raise NotTriggered(
                    self._source.instrument.name,
                    f"record '{self._name}': {self._source.wire.name} was not triggered within {within:g} s",
                    "check level and slope, its probe, and whether anything happened at the DUT",
                )
            self._scheduler.wait_until(min(now_ns + _LOOK_NS, deadline_ns))
