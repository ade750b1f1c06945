"""Writer of the journal: one flushed line per event, chained by SHA-256, never torn by a full disk."""

from __future__ import annotations

import hashlib
import os
import re
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from hil.clock import wall
from hil.evidence.durable import DISK_FULL, sync_folder, sync_open
from hil.evidence.events import NOTHING, Anomaly, CaseEnd, Event, Results
from hil.evidence.events.codec import encode, quick_canonical, stamped
from hil.evidence.folder import free_reserve
from hil.evidence.journal.clocks import SUPERVISOR
from hil.evidence.journal.reader import FIRST, read_journal
from hil.model.errors import EvidenceError, Refused

__all__ = ["UNRECORDED", "Journal", "is_gap"]

UNRECORDED = "disk full: operations before this event could not be written"
"""What an anomaly says where the journal goes on, and the transcript does not."""

_LOST = "disk full: {} events before this one could not be written"
_GAP = re.compile(f"{_LOST.format('[0-9]+')}|{UNRECORDED}")
_OLDEST_S = 0.5
_SUPERVISED_S = 60.0
"""Interval between the lines that carry the supervisor's stamp; the last ones carry it in any case."""


class Journal:
    """An append-only journal; an existing file is continued.

    Args:
        path: the journal's file.
        reserve: a file whose space is released when the disk is full.
        stamp: the source of wall time.
        write: `os.write`, or a substitute for a disk in tests.
        sync: syncs an open file to disk.
        now: seconds on a monotonic clock.
        supervisor: the latest stamp of the process that supervises the run.

    Raises:
        EvidenceError: if the existing journal is torn or its chain is broken.
    """

    def __init__(
        self,
        path: Path,
        *,
        reserve: Path | None = None,
        stamp: Callable[[], wall.WallStamp] = wall.stamp,
        write: Callable[[int, memoryview], int] = os.write,
        sync: Callable[[int], None] = sync_open,
        now: Callable[[], float] = wall.monotonic,
        supervisor: Callable[[], wall.WallStamp | None] = wall.supervisor_stamp,
    ) -> None:
        self._path = path
        self._reserve = reserve
        self._stamp = stamp
        self._os_write = write
        self._os_sync = sync
        self._now = now
        self._supervisor = supervisor
        self._supervised = -_SUPERVISED_S
        self._waits_since: float | None = None
        self._content = hashlib.sha256()
        self._head = FIRST.encode()
        self._sequence = 0
        self._size = 0
        self._last_t = 0.0
        self._lost = 0
        self._full = self._reported = False
        self._writer = os.getpid(), threading.get_ident()
        if path.exists():
            self._continue_journal()
        self._descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        sync_folder(path.parent)

    @property
    def content_digest(self) -> str:
        """SHA-256 over the bodies so far, each with a newline; equal runs have equal ones."""
        return self._content.hexdigest()

    @property
    def lost(self) -> int:
        """Number of events for which there was no space; an anomaly before the next one that fits reports them."""
        return self._lost

    @property
    def count(self) -> int:
        """How many events it holds."""
        return self._sequence

    @property
    def head(self) -> str:
        """The SHA-256 of its last line, which the next one will name."""
        return self._head.decode()

    @property
    def last_t(self) -> float:
        """Bench time of the newest event."""
        return self._last_t

    def write(self, event: Event, t: float, *, beside: Mapping[str, object] = NOTHING) -> int:
        """Write one event and return its sequence number.

        On a full disk the reserve is released and the event still written; this is reported once, by an error. From
        then on events are written as far as space allows, so that making the bench safe is not disturbed again.

        Args:
            event: the event, not stamped yet; a `synced` one is on disk when this returns.
            t: bench time in seconds.
            beside: facts of this place and moment only; they go into the line's wall half, beside the stamp.

        Raises:
            JsonError: for values that have no canonical JSON; nothing is written.
            Refused: in a thread or process other than the one that opened the journal; nothing is written.
            EvidenceError: "disk full", once, or another error of the file system.
        """
        if (os.getpid(), threading.get_ident()) != self._writer:
            raise Refused(f"{self._path.name} has one writer", "write from the process and thread that opened it")
        try:
            if self._lost:
                self._record_lost(t)
            number = self._append(event, t, beside)
        except OSError as error:
            if error.errno not in DISK_FULL:
                raise EvidenceError(f"{self._path}: cannot be written: {error.strerror}", "check the disk") from error
            self._lost += 1
            self._full = True
            number = -1
        if self._full and not self._reported:
            self._reported = True
            raise EvidenceError(f"{self._path}: disk full", "free some space before the next run")
        return number

    def tick(self) -> None:
        """Sync events that have waited long enough; called at every scheduling point, at least twice a second.

        Events that found no space are counted as soon as there is some.

        Raises:
            OSError: if the disk is full, and there is no reserve to release.
        """
        if self._lost:
            self._record_lost(self._last_t)
        if self._waits_since is not None and self._now() - self._waits_since >= _OLDEST_S:
            self._sync()

    def sync(self) -> None:
        """Sync every event that is not on disk yet.

        Raises:
            OSError: as `tick`.
        """
        if self._waits_since is not None:
            self._sync()

    def close(self) -> None:
        """Sync everything and close the file; closing twice is allowed."""
        if self._descriptor >= 0:
            self._os_sync(self._descriptor)
            os.close(self._descriptor)
            self._descriptor = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _record_lost(self, t: float) -> None:
        """Record how many events found no space."""
        self._append(Anomaly(text=_LOST.format(self._lost)), t, NOTHING)
        self._lost = 0

    def _continue_journal(self) -> None:
        reading = read_journal(self._path)
        if reading.torn or reading.findings:
            first = reading.findings[0] if reading.findings else f"{self._path}: the last line is torn"
            raise EvidenceError(str(first), "check it with hil verify; a torn tail is cut when the run is recovered")
        for line in reading.lines:
            self._content.update(line.raw + b"\n")
        self._head = reading.head.encode()
        self._sequence = len(reading.lines)
        self._size = self._path.stat().st_size
        self._last_t = reading.lines[-1].event.t if reading.lines else 0.0

    def _append(self, event: Event, t: float, beside: Mapping[str, object]) -> int:
        number = self._sequence
        body = encode(stamped(event, number, t))
        line = b'{"body":%b,"prev":"%b","wall":%b}' % (
            body,
            self._head,
            self._wall(beside, last=isinstance(event, CaseEnd | Results)),
        )
        self._put(line + b"\n")
        self._head = hashlib.sha256(line).hexdigest().encode()
        self._content.update(body + b"\n")
        self._sequence += 1
        self._last_t = t
        if event.synced:
            self._sync()
        elif self._waits_since is None:
            self._waits_since = self._now()
        return number

    def _wall(self, beside: Mapping[str, object], *, last: bool) -> bytes:
        now = self._stamp()
        fields = {**beside, "boot": now.boot, "boot_id": now.boot_id, "utc": now.utc}
        due = last or not 0 <= now.boot - self._supervised < _SUPERVISED_S
        if due and (said := self._supervisor()):
            self._supervised = now.boot
            fields[SUPERVISOR] = {"boot": said.boot, "boot_id": said.boot_id, "utc": said.utc}
        return quick_canonical(fields)

    def _put(self, data: bytes) -> None:
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[self._put_some(rest) :]
        except OSError:
            os.ftruncate(self._descriptor, self._size)  # an incomplete line would break the chain of the following ones
            raise
        self._size += len(data)

    def _put_some(self, data: memoryview) -> int:
        try:
            return self._os_write(self._descriptor, data)
        except OSError as error:
            self._make_room(error)
            return self._os_write(self._descriptor, data)

    def _sync(self) -> None:
        try:
            self._os_sync(self._descriptor)
        except OSError as error:
            self._make_room(error)
            self._os_sync(self._descriptor)
        self._waits_since = None

    def _make_room(self, error: OSError) -> None:
        if error.errno not in DISK_FULL or not free_reserve(self._reserve):
            raise error
        self._full = True


def is_gap(event: Event) -> bool:
    """Return whether a full disk left something out before this event: no run can retrace its record past it."""
    return isinstance(event, Anomaly) and _GAP.fullmatch(event.text) is not None
