"""Files that are read once: every later read gets the same bytes, whatever is on disk by then."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

__all__ = ["Snapshot", "current_snapshot", "read_once"]

_CURRENT: ContextVar[Snapshot | None] = ContextVar("snapshot", default=None)


def current_snapshot() -> Snapshot | None:
    """Return the snapshot that files of configuration are read through, None if they are read from the disk."""
    return _CURRENT.get()


def read_once(path: Path) -> bytes:
    """Return a file's content, through the snapshot where there is one.

    Raises:
        OSError: if it cannot be read.
    """
    snapshot = _CURRENT.get()
    return path.read_bytes() if snapshot is None else snapshot.take(path)


class Snapshot:
    """The contents of files, by absolute path, each as it was when it was first read."""

    def __init__(self) -> None:
        self._held: dict[Path, bytes] = {}

    def __contains__(self, path: Path) -> bool:
        return path in self._held

    def __iter__(self) -> Iterator[Path]:
        return iter(tuple(self._held))

    def take(self, path: Path) -> bytes:
        """Return a file's content: from the disk the first time, from memory after that.

        Raises:
            OSError: if it cannot be read.
        """
        held = self._held.get(path)
        return self.keep(path, path.read_bytes()) if held is None else held

    def keep(self, path: Path, data: bytes) -> bytes:
        """Keep the content of a file, unless it is kept already; return what is kept."""
        return self._held.setdefault(path, data)

    def is_as_on_disk(self, path: Path) -> bool:
        """Return whether a kept file still has the same content on disk."""
        try:
            return path.read_bytes() == self._held[path]
        except OSError:
            return False

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Let every file of configuration be read through this snapshot."""
        before = _CURRENT.set(self)
        try:
            yield
        finally:
            _CURRENT.reset(before)
