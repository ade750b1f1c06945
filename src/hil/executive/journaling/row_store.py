"""Store of the open row files of all recordings."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from hil.evidence import events
from hil.evidence.events import EventSink
from hil.evidence.folder import RECORDINGS, RESERVE
from hil.evidence.recordings.row_file import NUMBER, read_rows, table
from hil.evidence.recordings.rows import DiskFull, Rows
from hil.executive.ending.stop import Stopped
from hil.executive.journaling.events import DISK_FULL, Caller, Unheard
from hil.model.errors import Diverged, EvidenceError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["OpenRecording", "RowStore"]


class OpenRecording:
    """A growing recording. Finish it even after an error: what exists is kept as incomplete."""

    def __init__(
        self,
        facts: events.Recording,
        rows: Rows,
        journal: EventSink,
        forget: Callable[[OpenRecording], None],
    ) -> None:
        self.facts = facts
        self.rows = rows
        self._journal = journal
        self._forget = forget

    @property
    def append(self) -> Callable[[Sequence[float]], None]:
        """Takes one row: time in s, then the channels."""
        return self.rows.append

    def finish(self, *, complete: bool) -> str:
        """Record the end and return the hash of all rows; on a full disk there is no end, and the hash is empty.

        Raises:
            Stopped: on a full disk, if the recording is a case's.
        """
        self._forget(self)
        try:
            end = self.rows.finish()
        except DiskFull as error:
            self.rows.at_full(error)
            return ""
        ended = events.RecordingEnd(
            recording=self.facts.recording,
            rows=end.rows,
            sha256=end.sha256,
            complete=complete,
            gaps=round(end.largest_gap_s, 9),
        )
        self._journal.write(ended)
        return end.sha256


class RowStore:
    """Opens recordings in a run's folder and keeps the open ones synced to disk.

    Args:
        folder: the run's folder.
        journal: where events are written.
        again: whether rows that the folder already holds are repeated, see `Rows`.
        caller: is notified of rows that differ from those in the folder, before that is raised.
        full: is called when a full disk has no space for rows.
        frozen: whether rows are held back, see `Record`.

    Attributes:
        number: the number that the next recording gets.
    """

    def __init__(
        self,
        folder: Path,
        journal: EventSink,
        *,
        again: bool = False,
        caller: Caller | None = None,
        full: Callable[[], object] = lambda: None,
        frozen: Callable[[], bool] = lambda: False,
    ) -> None:
        self._full = full
        self._frozen = frozen
        self._folder = folder
        self._journal = journal
        self._again = again
        self._caller = caller or Unheard()
        self.number = 1
        self._open: list[OpenRecording] = []
        self._awaited: dict[str, events.Voided] = {}
        self._voids: dict[str, list[events.Voided]] = {}
        self._void_rows: Callable[[events.Voided], NDArray[np.float64]] | None = None

    @property
    def comes_again(self) -> bool:
        """Whether the folder holds rows of open recordings that have not been repeated yet."""
        return any(each.rows.comes_again for each in self._open)

    @property
    def recordings(self) -> Path:
        """Where the row files are."""
        return self._folder / RECORDINGS

    def begin(self, facts: events.Recording) -> OpenRecording:
        """Record the beginning and open the row file."""
        self._journal.write(facts)
        rows = self._rows_of(facts)
        recording = OpenRecording(facts, rows, self._journal, self._open.remove)
        self._open.append(recording)
        if (part := self._awaited.pop(facts.recording, None)) is not None:
            self._take_over(recording, msgspec.structs.replace(part, first=0))
            self._voids[facts.recording] = [part]
        return recording

    def _rows_of(self, facts: events.Recording) -> Rows:
        try:
            rows = Rows(
                self.recordings / f"{facts.recording}.rows",
                recording=facts.recording,
                channels=[(channel.name, channel.unit) for channel in facts.channels],
                on_block=lambda count, digest: self._journal.write(
                    events.Rows(recording=facts.recording, rows=count, sha256=digest)
                ),
                reserve=self._folder / RESERVE,
                again=self._again,
                write=self._write,
            )
        except DiskFull as error:
            self._hear_full(facts, error)
            raise
        except EvidenceError as error:
            if self._again:
                self._caller.diverged(Diverged(str(error)))
            raise
        rows.at_divergence = self._caller.diverged
        rows.at_full = partial(self._hear_full, facts)
        return rows

    def _hear_full(self, facts: events.Recording, error: DiskFull) -> None:
        """End the case whose rows found no space, as any other stop does; all other rows wait."""
        self._full()
        if facts.case is not None:
            raise Stopped(DISK_FULL) from error

    def _write(self, descriptor: int, data: memoryview) -> int:
        if self._frozen():
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return os.write(descriptor, data)

    def holds(self, recording: OpenRecording) -> bool:
        """Return whether a recording is still open."""
        return recording in self._open

    def held(self, kept: str, after_end: Iterable[str] = ()) -> list[events.Voided]:
        """Return the rows of every open recording that the folder holds and that have not been repeated.

        Args:
            kept: a recording of which nothing is void; empty for none.
            after_end: recordings that, if at all, are repeated as a whole, and of which everything is void.
        """
        void = [
            events.Voided(recording=each.facts.recording, first=each.rows.rows, end=max(each.rows.rows, each.rows.held))
            for each in self._open
        ]
        for name in filter(None, (kept, *after_end)):
            if (path := self.recordings / f"{name}.rows").exists():
                rows = read_rows(path).rows
                void.append(events.Voided(recording=name, first=rows if name == kept else 0, end=rows))
        return void

    def next_number(self) -> int:
        """Return the number of the next recording of a case."""
        self.number += 1
        return self.number - 1

    def pass_over(
        self, entry: events.Entry, void_rows: Callable[[events.Voided], NDArray[np.float64]] | None = None
    ) -> list[tuple[str, Callable[[], NDArray[np.float64]]]]:
        """Accept the rows that are not repeated; return each recording that has void rows, and what reads them.

        Args:
            entry: names the rows.
            void_rows: returns rows, shape (rows, 1 + channels), for a run that does not hold them.
        """
        self._void_rows = void_rows
        self.number = entry.number
        still_open = {each.facts.recording: each for each in self._open}
        void: list[events.Voided] = []
        for part in entry.rows:
            if part.recording in still_open:
                self._take_over(still_open[part.recording], part)
                void.append(part)
            else:
                self._awaited[part.recording] = part
                void.append(msgspec.structs.replace(part, first=0))
        read = void_rows or self._held_rows
        return [(part.recording, partial(read, part)) for part in void if part.first < part.end]

    def note_void(self, entry: events.Entry) -> None:
        """Keep which rows were void at an earlier entry of the run at the same place."""
        still_open = {each.facts.recording for each in self._open}
        for part in entry.rows:
            if part.recording in still_open:
                self._voids.setdefault(part.recording, []).append(part)

    def voids(self, recording: str) -> tuple[events.Voided, ...]:
        """Return the void rows of a recording."""
        return tuple(self._voids.get(recording, ()))

    def _take_over(self, recording: OpenRecording, part: events.Voided) -> None:
        if self._void_rows is None:
            recording.rows.skip(part.end)
        else:
            recording.rows.append_rows(self._void_rows(part))
        self._voids.setdefault(part.recording, []).append(part)

    def _held_rows(self, part: events.Voided) -> NDArray[np.float64]:
        found = read_rows(self.recordings / f"{part.recording}.rows")
        with found.path.open("rb") as stream:
            stream.seek(found.start + part.first * found.width * NUMBER)
            return table(stream.read((part.end - part.first) * found.width * NUMBER), found.width)

    def end_of_case(self, case: str) -> None:
        """Finish what a case left open, as incomplete."""
        for recording in [each for each in self._open if each.facts.case == case]:
            with suppress(Stopped):  # on a full disk it stays as it is
                recording.finish(complete=False)

    def tick(self) -> None:
        """Sync pending rows of every open recording."""
        for recording in self._open:
            recording.rows.tick()
