"""Writer of row files: samples as they come, packed, hashed, and on disk within a second."""

from __future__ import annotations

import hashlib
import os
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from hil.clock import wall
from hil.documents.canonical import canonical
from hil.evidence.durable import DISK_FULL, sync_folder, sync_open
from hil.evidence.folder import free_reserve
from hil.evidence.recordings.row_file import BLOCK, NUMBER, RowsFile, header_line, read_rows, row_blocks
from hil.model.errors import Diverged, EvidenceError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["DiskFull", "Rows", "RowsEnd"]

_FLUSH_ROWS = 4_096
_OLDEST_S = 0.5


class DiskFull(EvidenceError):
    """Rows found no space; they are kept in memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RowsEnd:
    """Summary of a finished row file; the largest gap is 0 with fewer than two rows."""

    rows: int
    sha256: str
    largest_gap_s: float


class Rows:
    """One recording's row file while it grows: a header line, then little-endian float64 rows of time and channels.

    Args:
        path: the file; an existing one is continued after its last complete row.
        recording: the recording's id.
        channels: name and unit of every channel.
        on_block: called with the number of rows so far and the hash over all their bytes, every `BLOCK` rows and at
            the end; those rows are on disk by then.
        reserve: a file whose space is released when the disk is full.
        again: whether the rows of an existing file are repeated: the first ones must equal those in the file, and
            are not written a second time.
        now: seconds on a monotonic clock.
        write: `os.write`, or a substitute for a disk in tests.

    Attributes:
        at_divergence: called when rows differ from those in the file, before that is raised.
        at_full: called when rows found no space, and wait; it may raise what ends their recording.
    """

    def __init__(
        self,
        path: Path,
        *,
        recording: str,
        channels: Sequence[tuple[str, str]],
        on_block: Callable[[int, str], None],
        reserve: Path | None = None,
        again: bool = False,
        now: Callable[[], float] = wall.monotonic,
        write: Callable[[int, memoryview], int] = os.write,
    ) -> None:
        self._path = path
        self._on_block = on_block
        self._reserve = reserve
        self._now = now
        self._os_write = write
        self.at_divergence: Callable[[Diverged], object] = lambda _: None
        self.at_full: Callable[[DiskFull], object] = _raised
        self._width = len(channels) + 1
        self._pack = struct.Struct(f"<{self._width}d").pack
        self._hash = hashlib.sha256()
        self._rows = self._reported = 0
        self._gap = 0.0
        self._first_time: float | None = None
        self._last_time: float | None = None
        self._buffer = bytearray()
        self._past: BufferedReader | None = None
        self._open(header_line(recording, channels), again=again)
        self._due = self._next_due()
        self._synced_at = now()

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return self._rows

    def append(self, row: Sequence[float]) -> None:
        """Take one row: time in seconds, then a number per channel, NaN if there is none."""
        self._buffer += self._pack(*row)
        self._rows += 1
        if self._rows >= self._due:
            self._flush_or_wait()

    def append_rows(self, rows: NDArray[np.float64]) -> None:
        """Take a block of rows, shape (n, 1 + channels); the file is the same as row by row."""
        if rows.ndim != 2 or rows.shape[1] != self._width:
            raise ValueError(f"a block of shape {rows.shape} has no rows of {self._width} numbers")
        done = 0
        while done < len(rows):
            piece = rows[done : done + self._due - self._rows]
            self._buffer += piece.astype("<f8").tobytes()
            self._rows += len(piece)
            done += len(piece)
            if self._rows >= self._due:
                self._flush_or_wait()

    def covers_s(self) -> float:
        """Return the time from the first row to the last one, 0 with fewer than two."""
        self._flush_or_wait()
        if self._first_time is None or self._last_time is None:
            return 0.0
        return self._last_time - self._first_time

    @property
    def held(self) -> int:
        """How many rows the file holds, including those that have not been repeated yet."""
        return read_rows(self._path).rows

    @property
    def comes_again(self) -> bool:
        """Whether the file holds rows that have not been repeated yet; the last one may be noticed a tick late."""
        return self._past is not None

    def skip(self, rows: int) -> None:
        """Accept the file's rows up to this number without their repetition."""
        self._flush()
        if self._past is None:  # all were repeated, and maybe more: a kill loses rows that were on their way to disk
            return
        left = (rows - self._rows) * self._width * NUMBER
        past = self._past
        while left > 0 and (block := past.read(min(left, BLOCK * self._width * NUMBER))):
            left -= len(block)
            self._rows += len(block) // (self._width * NUMBER)
            self._take(block)
        self._reported = self._rows - self._rows % BLOCK
        self._due = self._next_due()

    def tick(self) -> None:
        """Sync rows that have waited long enough; called at every scheduling point, at least twice a second."""
        now = self._now()
        if self._past is not None:
            self._flush()
        if not self._buffer and not self._unsynced:
            self._synced_at = now
        elif now - self._synced_at >= _OLDEST_S:
            self._flush()
            self._sync(now)

    def finish(self) -> RowsEnd:
        """Sync everything, report the last hash, close the file, and return its summary."""
        self._flush()
        self._sync(self._now())
        if self._reported != self._rows or not self._rows:
            self._on_block(self._rows, self._hash.hexdigest())
        os.close(self._descriptor)
        more = self._past.read(1) if self._past is not None else b""
        self._end_of_past()
        if more:
            self._diverge(f"it holds more than the {self._rows} rows that came again")
        return RowsEnd(rows=self._rows, sha256=self._hash.hexdigest(), largest_gap_s=self._gap)

    def _open(self, header: bytes, *, again: bool) -> None:
        continued = self._path.exists() and not self._is_torn(header)
        if continued:
            found = self._cut(header)
            if again:
                self._past = self._path.open("rb")
                self._past.seek(found.start)
            else:
                self._continue_file(found)
        self._descriptor = os.open(self._path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        self._unsynced = True
        if not continued:
            self._put(header)
            sync_open(self._descriptor)
            sync_folder(self._path.parent)

    def _is_torn(self, header: bytes) -> bool:
        """Return whether there is only an incomplete header, which is then cut off."""
        with self._path.open("rb") as stream:
            begun = stream.read(len(header))
        if len(begun) == len(header) or not header.startswith(begun):
            return False
        os.truncate(self._path, 0)
        return True

    def _cut(self, header: bytes) -> RowsFile:
        """Cut an incomplete row off an existing file."""
        found = read_rows(self._path)
        if canonical(found.header) + b"\n" != header:
            raise EvidenceError(f"{self._path}: the recording on the disk has other channels", "start a new run")
        os.truncate(self._path, found.start + found.rows * found.width * NUMBER)
        return found

    def _continue_file(self, found: RowsFile) -> None:
        for block in row_blocks(found):
            self._take(block)
        self._rows = found.rows
        self._reported = found.rows - found.rows % BLOCK

    def _next_due(self) -> int:
        return min(self._rows + _FLUSH_ROWS, (self._rows // BLOCK + 1) * BLOCK)

    def _flush_or_wait(self) -> None:
        """Flush; rows for which a full disk has no space are tried again with later ones."""
        try:
            self._flush()
        except DiskFull as error:
            self._due = self._next_due()
            self.at_full(error)

    def _flush(self) -> None:
        if self._past is not None:
            self._follow(self._past)
        if self._buffer:
            self._put(self._buffer)
            self._take(bytes(self._buffer))
            self._buffer.clear()
            self._unsynced = True
        self._due = self._next_due()
        if self._rows and self._rows % BLOCK == 0 and self._reported != self._rows:
            self._sync(self._now())
            self._reported = self._rows
            self._on_block(self._rows, self._hash.hexdigest())

    def _follow(self, past: BufferedReader) -> None:
        """Remove rows that the file already holds from the buffer, and require that they are the same."""
        held = past.read(len(self._buffer))
        if held != self._buffer[: len(held)]:
            self._end_of_past()
            self._diverge(f"other rows than those that were recorded, before row {self._rows}")
        if len(held) < len(self._buffer) or not past.peek(1):
            self._end_of_past()
        if held:
            self._take(held)
            del self._buffer[: len(held)]

    def _diverge(self, text: str) -> NoReturn:
        error = Diverged(f"{self._path.name}: {text}")
        self.at_divergence(error)
        raise error

    def _end_of_past(self) -> None:
        if self._past is not None:
            self._past.close()
            self._past = None

    def _take(self, block: bytes) -> None:
        import numpy as np  # noqa: PLC0415 - rows are packed without it

        self._hash.update(block)
        times = np.frombuffer(block, "<f8")[:: self._width]
        if self._first_time is None:
            self._first_time = float(times[0])
        if self._last_time is not None:
            times = np.concatenate(([self._last_time], times))
        if len(times) > 1:
            self._gap = max(self._gap, float(np.max(np.diff(times))))
        self._last_time = float(times[-1])

    def _put(self, data: bytes | bytearray) -> None:
        size = os.fstat(self._descriptor).st_size
        with memoryview(data) as whole:
            done = 0
            try:
                while done < len(whole):
                    done += self._put_some(whole[done:])
            except OSError as error:
                os.ftruncate(self._descriptor, size)  # the rows stay in the buffer, and may fit later
                raise self._failed(error) from error

    def _put_some(self, data: memoryview) -> int:
        try:
            return self._os_write(self._descriptor, data)
        except OSError as error:
            if error.errno not in DISK_FULL or not free_reserve(self._reserve):
                raise
            return self._os_write(self._descriptor, data)

    def _sync(self, now: float) -> None:
        try:
            sync_open(self._descriptor)
        except OSError as error:
            raise self._failed(error) from error
        self._unsynced = False
        self._synced_at = now

    def _failed(self, error: OSError) -> EvidenceError:
        hint = "free some space before the next run"
        if error.errno in DISK_FULL:
            return DiskFull(f"{self._path}: disk full", hint)
        return EvidenceError(f"{self._path}: cannot be written: {error.strerror}", hint)


def _raised(error: DiskFull) -> NoReturn:
    raise error
