"""Displays: text streams that nobody's terminal, pipe or full disk can turn against a run."""

from __future__ import annotations

import io
import os
import select
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["Display", "displays", "open_standard_streams"]

_PIECE = 512  # a descriptor that is ready takes so much without waiting
_MOST_WAITING = 16_000_000


class Display(io.TextIOBase):
    """A text stream on a descriptor of its own that never raises, never waits, and cannot be closed.

    What its reader does not take is kept until it does, so that a paused terminal does not hold up a bench. A
    reader that went away is written to no more. Characters that the encoding does not have are written as escapes.

    Args:
        descriptor: where the text goes; it is duplicated.
        encoding: of the text.

    Attributes:
        lost: whether something could not be written.
    """

    def __init__(self, descriptor: int, encoding: str) -> None:
        self._encoding = encoding
        self._waiting = bytearray()
        self._lock = threading.RLock()
        self._descriptor = os.dup(descriptor)
        self.lost = False

    @property
    def encoding(self) -> str:  # type: ignore[override]  # a plain attribute in the base class
        """The encoding of the text."""
        return self._encoding

    @property
    def errors(self) -> str:  # type: ignore[override]  # as above
        """How characters are written that the encoding does not have."""
        return "backslashreplace"

    def writable(self) -> bool:
        """Return that text can be written."""
        return True

    def isatty(self) -> bool:
        """Return whether a person looks at it."""
        return os.isatty(self._descriptor)

    def fileno(self) -> int:
        """Return the descriptor."""
        return self._descriptor

    def close(self) -> None:
        """Stay open: what a case closes is not the run's."""

    def write(self, text: str) -> int:
        """Take a text and write as much as the reader takes now."""
        data = text.encode(self._encoding, "backslashreplace")
        with self._lock:
            if not self.lost:
                self._waiting += data
                self._pass_on(0)
            if len(self._waiting) > _MOST_WAITING:
                self._lose()
        return len(text)

    def flush(self) -> None:
        """Write as much as the reader takes now."""
        with self._lock:
            self._pass_on(0)

    def finish(self) -> bool:
        """Wait for the reader and return whether everything was written; Ctrl-C ends the wait."""
        try:
            with self._lock:
                self._pass_on(None)
        except KeyboardInterrupt:
            self._lose()
        return not self.lost

    def _pass_on(self, patience_s: float | None) -> None:
        try:
            while self._waiting and select.select([], [self._descriptor], [], patience_s)[1]:
                del self._waiting[: os.write(self._descriptor, self._waiting[:_PIECE])]
        except BlockingIOError:
            pass
        except (OSError, ValueError):
            self._lose()

    def _lose(self) -> None:
        self.lost = True
        self._waiting.clear()


@contextmanager
def displays() -> Iterator[tuple[Display, Display]]:
    """Put displays in the place of standard output and standard error."""
    before = sys.stdout, sys.stderr
    pair = (_on(1, before[0]), _on(2, before[1]))
    sys.stdout, sys.stderr = pair
    try:
        yield pair
    finally:
        for display in pair:
            display.finish()
        sys.stdout, sys.stderr = before


def open_standard_streams() -> None:
    """Open the standard streams that were closed from outside on nothing.

    The next file that is opened would get their numbers, and what is printed would be written into it.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _on(descriptor: int, stream: object) -> Display:
    return Display(descriptor, getattr(stream, "encoding", None) or "utf-8")
