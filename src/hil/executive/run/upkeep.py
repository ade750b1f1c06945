"""Upkeep: what a run does beside its cases every fraction of a second, and what it does about a full disk."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from hil.evidence.folder import RESERVE, free_reserve
from hil.evidence.inbox import Message, poll
from hil.evidence.journal.writer import Journal
from hil.evidence.package.sealing import write_message
from hil.executive.run.events import DISK_FULL
from hil.executive.run.row_store import RowStore
from hil.executive.run.stop import StopFlags
from hil.model.errors import EvidenceError
from hil.wire.transcript import Transcript

__all__ = ["Upkeep"]


class Upkeep:
    """Brings what waits to the disk and looks into the inbox.

    Args:
        folder: the run's folder.
        journal: where messages are written.
        store: the open recordings.
        transcript: what went over the wire.
        flags: asked to end the run when somebody says so, or the disk is full.

    Attributes:
        now: bench time in seconds.
    """

    def __init__(
        self, folder: Path, journal: Journal, store: RowStore, transcript: Transcript, flags: StopFlags
    ) -> None:
        self._folder = folder
        self._journal = journal
        self._store = store
        self._transcript = transcript
        self._flags = flags
        self.now: Callable[[], float] = float

    def tick(self) -> None:
        """Do it all."""
        self.flush()
        if not (self._folder / RESERVE).exists():
            self._disk_is_full()
        for message in poll(self._folder):
            if message.kind == "stop":
                self._flags.request(f"{message.by or 'another terminal'}: {message.text}".rstrip(": "))
            else:
                self._write_message(message)

    def flush(self) -> None:
        """Bring what waits to the disk."""
        try:
            self._transcript.flush()
            self._store.tick()
        except (OSError, EvidenceError):
            self._disk_is_full()
            if free_reserve(self._folder / RESERVE):
                self.flush()

    def _write_message(self, message: Message) -> None:
        try:
            write_message(self._journal, self.now(), message)
        except EvidenceError:
            self._disk_is_full()

    def _disk_is_full(self) -> None:
        """Ask for the run's end; asked again and again, it is no more urgent than a person's first word."""
        if not self._flags.reason:
            self._flags.request(DISK_FULL)
