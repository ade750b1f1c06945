"""Displays: text streams that isolate a run from its terminal, pipe or full disk, and the terminal from its texts.

What cases, instruments and files say reaches a terminal through here. What a terminal would obey in it, such as the
escape sequence that clears a screen, is written as a visible escape; the product's own colours and cursor movements go
through `drawn`.
"""

from __future__ import annotations

import errno
import io
import os
import select
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO, cast

from hil.documents.text import visible

__all__ = ["Display", "Edge", "Unwritten", "displays", "open_standard_streams", "shown_safely", "write_bytes"]

_MARK = "hil: "
_PIECE = 512  # a ready descriptor takes this much without blocking
_MOST_WAITING = 16_000_000


class Display(io.TextIOBase):
    """A text stream on a descriptor of its own that never raises, never waits, and cannot be closed.

    What its reader does not take is kept until it does, so that a paused terminal does not hold up a bench. A
    reader that went away is written to no more. Characters that the encoding does not have are written as escapes.

    Args:
        descriptor: where the text goes; it is duplicated.
        encoding: of the text.
        wraps: whether lines are wrapped at the width of a terminal.

    Attributes:
        lost: whether something could not be written.
    """

    def __init__(self, descriptor: int, encoding: str, *, wraps: bool = False) -> None:
        self._encoding = encoding
        self._wraps = wraps
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
        """How characters outside the encoding are written."""
        return "backslashreplace"

    def writable(self) -> bool:
        """Return True: text can be written."""
        return True

    def isatty(self) -> bool:
        """Return whether it is a terminal."""
        return os.isatty(self._descriptor)

    def fileno(self) -> int:
        """Return the descriptor."""
        return self._descriptor

    def close(self) -> None:
        """Stay open: a case cannot close the run's stream."""

    @property
    def drawn(self) -> TextIO:
        """The same stream for cursor movements and colours: every text was made visible before."""
        return cast("TextIO", _Drawn(self))

    def write(self, text: str) -> int:
        """Take a text and write as much as the reader takes now; terminal control sequences become visible."""
        self.draw(_wrapped(visible(text), self) if self._wraps else visible(text))
        return len(text)

    def draw(self, text: str) -> int:
        """Write likewise, including terminal control sequences."""
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


class _Drawn(io.TextIOBase):
    """A display that takes text unchanged."""

    def __init__(self, display: Display) -> None:
        self._display = display

    @property
    def encoding(self) -> str:  # type: ignore[override]  # a plain attribute in the base class
        """The encoding of the text."""
        return self._display.encoding

    def write(self, text: str) -> int:
        """Write a text, including terminal control sequences."""
        return self._display.draw(text)

    def flush(self) -> None:
        """Write as much as the reader takes now."""
        self._display.flush()

    def isatty(self) -> bool:
        """Return whether it is a terminal."""
        return self._display.isatty()

    def fileno(self) -> int:
        """Return the descriptor."""
        return self._display.fileno()


class Unwritten(BaseException):  # not an Exception: no command may catch it
    """Standard output takes no more: its reader has gone, or its disk is full."""


class Edge:
    """Where a command's output leaves it; a failed write ends the command, and is reported once, by its exit code.

    Args:
        stream: the standard stream.
        ends: whether a write that fails raises `Unwritten`; of standard error it does not.

    Attributes:
        error: why the stream takes no more, None while it does.
    """

    def __init__(self, stream: TextIO, *, ends: bool) -> None:
        self._stream = stream
        self._ends = ends
        self.error: OSError | None = None

    def write(self, text: str) -> int:
        """Write a text.

        Raises:
            Unwritten: if the stream takes no more.
        """
        self._try(lambda: self._stream.write(text))
        return len(text)

    def write_bytes(self, data: bytes) -> None:
        """Write bytes of a file as they are.

        Raises:
            Unwritten: if the stream takes no more.
        """
        self.flush()
        self._try(lambda: self._stream.buffer.write(data))

    def flush(self) -> None:
        """Flush the buffer.

        Raises:
            Unwritten: if the stream takes no more.
        """
        self._try(self._stream.flush)

    def finish(self) -> OSError | None:
        """Flush, and return why not all was written, None if it was; nothing is retried at exit."""
        with suppress(Unwritten):
            self.flush()
        if self.error is not None:
            with suppress(OSError, ValueError):
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, self._stream.fileno())
                os.close(nowhere)
        return self.error

    def _try(self, what: Callable[[], object]) -> None:
        if self.error is None:
            try:
                what()
            except OSError as error:
                self.error = error
            except ValueError as error:  # somebody closed it
                self.error = OSError(errno.EBADF, str(error))
        if self.error is not None and self._ends:
            raise Unwritten

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the stream has
        return getattr(self._stream, name)


class _Shown:
    """A wrapped text stream, through which texts reach a terminal only in visible form.

    Args:
        drawn: the stream, on which colours and cursor movements are drawn.
        wraps: whether lines are wrapped at the width of a terminal.
    """

    def __init__(self, drawn: TextIO, *, wraps: bool) -> None:
        self.drawn = drawn
        self._wraps = wraps

    def write(self, text: str) -> int:
        """Write a text; terminal control sequences become visible."""
        self.drawn.write(_wrapped(visible(text), self.drawn) if self._wraps else visible(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write several texts."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the stream has
        if name == "buffer":  # bytes would go past
            raise AttributeError(name)
        return getattr(self.drawn, name)


def write_bytes(data: bytes) -> None:
    """Write bytes of a file to standard output as they are; somebody sent it into a file or a pipe.

    Raises:
        Unwritten: if the stream takes no more.
    """
    stream = sys.stdout
    if isinstance(stream, _Shown):
        cast("Edge", stream.drawn).write_bytes(data)
    else:
        stream.buffer.write(data)


@contextmanager
def shown_safely() -> Iterator[Edge]:
    """Put streams that show every text safely in the place of standard output, which is given, and standard error."""
    before = sys.stdout, sys.stderr
    edges = Edge(before[0], ends=True), Edge(before[1], ends=False)
    sys.stdout, sys.stderr = (cast("TextIO", _Shown(cast("TextIO", edge), wraps=edge is edges[1])) for edge in edges)
    try:
        yield edges[0]
    finally:
        edges[1].finish()
        sys.stdout, sys.stderr = before


@contextmanager
def displays() -> Iterator[tuple[Display, Display]]:
    """Put displays in the place of standard output and standard error."""
    before = sys.stdout, sys.stderr
    pair = (_on(1, before[0]), _on(2, before[1], wraps=True))
    sys.stdout, sys.stderr = pair
    try:
        yield pair
    finally:
        for display in pair:
            display.finish()
        sys.stdout, sys.stderr = before


def open_standard_streams() -> None:
    """Open closed standard streams on the null device.

    The next file that is opened would get their numbers, and what is printed would be written into it.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    sys.stdout = sys.stdout or os.fdopen(1, "w", closefd=False)  # Python has none where the descriptor was closed
    sys.stderr = sys.stderr or os.fdopen(2, "w", closefd=False)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _on(descriptor: int, stream: object, *, wraps: bool = False) -> Display:
    return Display(descriptor, getattr(stream, "encoding", None) or "utf-8", wraps=wraps)


def _wrapped(text: str, stream: object) -> str:
    """Return whole lines wrapped between words if the stream is a terminal; a file or a pipe has them as they are."""
    width = _width(cast("TextIO", stream)) if text.endswith("\n") else 0  # a question waits for its answer on its line
    if width <= 0 or all(len(line) <= width for line in text.splitlines()):
        return text
    from hil.documents.text import fitting  # noqa: PLC0415 - only for lines that are too long

    found: list[str] = []
    for line in text.splitlines():
        lead = _MARK if line.startswith(_MARK) and len(line) > width else ""
        pieces = fitting([" " * len(lead) + line[len(lead) :]], width) if len(line) > width else [line]
        found += [lead + pieces[0][len(lead) :], *pieces[1:]]
    return "".join(f"{line}\n" for line in found)


def _width(stream: TextIO) -> int:
    """Return how many columns a terminal has, 0 for anything else."""
    with suppress(OSError, ValueError, AttributeError):
        if stream.isatty():
            return int(os.environ.get("COLUMNS") or os.get_terminal_size(stream.fileno()).columns)
    return 0
