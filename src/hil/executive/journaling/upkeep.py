"""Upkeep: what a run does beside its cases every fraction of a second, and what it does about a full disk."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from hil.clock import wall
from hil.evidence import events
from hil.evidence.events import EventSink
from hil.evidence.folder import RESERVE, free_reserve
from hil.evidence.inbox import Message, asks_for_end, poll, waiting
from hil.evidence.package.sealing import event_of
from hil.executive.ending.stop import StopFlags
from hil.executive.journaling.events import DISK_FULL, Events
from hil.executive.journaling.row_store import RowStore
from hil.executive.people.questions import Elsewhere
from hil.model.errors import EvidenceError
from hil.wire.transcript import Transcript

__all__ = ["Timekeeping", "Upkeep"]

_NOTICED_S = 1.0


class Timekeeping:
    """Compares three clocks: one that stands while the machine is suspended, one that does not, and the time of day.

    Args:
        journal: where events are written.
        clocks: tells what they say.
    """

    def __init__(self, journal: EventSink, clocks: Callable[[], wall.Clocks] = wall.clocks) -> None:
        self._journal = journal
        self._clocks = clocks
        self._before = clocks()

    def tick(self) -> None:
        """Look at the clocks and write down what one of them did alone since the last look."""
        before, now = self._before, self._clocks()
        self._before = now
        boot = now.boot - before.boot
        suspended = boot - (now.awake - before.awake)
        jumped = (now.day - before.day) - boot
        if suspended > _NOTICED_S:
            self._journal.write(events.Suspended(text="the machine was suspended", seconds=round(suspended, 1)))
        if abs(jumped) > _NOTICED_S:
            self._journal.write(events.ClockJump(text="the machine's time of day was set", seconds=round(jumped, 1)))


class RunProgress(Protocol):
    """How far a run is."""

    def note(self) -> None:
        """Write down where the bench is, if it is time."""
        ...

    def retraces(self) -> bool:
        """Return whether the run still comes to what it came to before; nothing from outside can be taken then."""
        ...


class KnowsCode(Protocol):
    """Whoever was sent a code."""

    def knows(self, code: str) -> bool:
        """Return whether this is the code that was sent last."""
        ...


class Upkeep:
    """Brings what waits to the disk and looks into the inbox.

    Args:
        folder: the run's folder.
        journal: where messages are written, and shown to whoever listens.
        store: the open recordings.
        transcript: what went over the wire.
        flags: asked to end the run when somebody says so, or the disk is full.
        progress: how far the run is.

    Attributes:
        elsewhere: takes answers to the question that waits.
    """

    def __init__(
        self,
        folder: Path,
        journal: Events,
        store: RowStore,
        transcript: Transcript,
        flags: StopFlags,
        progress: RunProgress,
    ) -> None:
        self.elsewhere = Elsewhere()
        self._progress = progress
        self._on_call: KnowsCode | None = None
        self._left = waiting(folder)
        self._timekeeping = Timekeeping(journal)
        self._folder = folder
        self._events = journal
        self._store = store
        self._transcript = transcript
        self._flags = flags

    def expect(self, on_call: KnowsCode) -> None:
        """Compare codes that come in with the one that this person was sent."""
        self._on_call = on_call

    def tick(self) -> None:
        """Do it all."""
        self.keep_time()
        self._flush(self._progress.note)
        if not (self._folder / RESERVE).exists():
            self._disk_is_full()
        if not self._progress.retraces():
            for message in poll(self._folder, self._left):
                self._take(message)
        elif asks_for_end(self._folder, self._left):
            self._flags.request("another terminal")

    def keep_time(self) -> None:
        """Write down what became of the machine's clocks, before anything is that was stamped by them."""
        self._timekeeping.tick()

    def _take(self, message: Message) -> None:
        if message.kind in {"interrupt", "stop"}:
            may_stay_open = self._flags.leave_open or not self._flags.reason
            self._flags.leave_open = message.kind == "interrupt" and may_stay_open
            self._flags.request(f"{message.by or 'another terminal'}: {message.text}".rstrip(": "))
        elif message.kind == "reached":
            known = self._on_call is not None and self._on_call.knows(message.text)
            self._events.write(events.Reached(by=message.by, ok=known))
        elif message.kind == "answer":
            if problem := self.elsewhere.take(message.name, message.text, message.by):
                text = f"inbox, answer by {message.by or 'nobody'}: {problem}"
                self._events.write(events.Anomaly(text=text))
        else:
            self._events.write(event_of(message), beside=message.beside)

    def flush(self) -> None:
        """Bring what waits to the disk."""
        self._flush(lambda: None)

    def _flush(self, then: Callable[[], None]) -> None:
        try:
            self._events.tick()
            self._transcript.flush()
            self._store.tick()
            then()
        except (OSError, EvidenceError):
            self._disk_is_full()
            if free_reserve(self._folder / RESERVE):
                self.flush()

    def _disk_is_full(self) -> None:
        """Ask for an end from which the run goes on once there is space again."""
        self._flags.leave_off(DISK_FULL)
