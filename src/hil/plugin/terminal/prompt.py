"""The terminal at which a person answers questions."""

from __future__ import annotations

import os
import select
import signal
import sys
from contextlib import suppress

from hil.clock import wall

__all__ = ["NoTerminal", "Terminal"]

_PATIENCE_S = 0.1
_BLOCK = 4096


class Terminal:
    """Standard input and standard error; polling for input never waits for long.

    Lines typed ahead answer ordinary questions, as at any prompt; before a safety confirmation they are discarded,
    because a question that was not asked yet cannot have been answered.
    """

    def __init__(self) -> None:
        self._typed = b""

    def show(self, text: str) -> None:
        """Show a line where standard output stays clean."""
        _say(f"  ? {text} ")

    def discard(self) -> None:
        """Discard what was typed so far, and say so if there were lines.

        A line that was begun and not entered is discarded, too; the terminal does not report that there was one.
        """
        waited = bool(self._typed) or _waits()
        self._typed = b""
        _flush()
        if waited:
            _say("  ! input typed before this question was asked is discarded\n")

    def line(self) -> str | None:
        """Return a line with its newline if one was entered, None if not yet, an empty string once input has ended.

        Lines typed ahead are kept here, where `select` no longer sees them.
        """
        if b"\n" not in self._typed:
            if not _ready():
                return None
            if not (more := _read()):
                return ""
            self._typed += more
            if b"\n" not in self._typed:
                return None
        line, _, self._typed = self._typed.partition(b"\n")
        return line.decode(errors="replace") + "\n"


class NoTerminal:
    """The log of an unattended run, in place of a terminal; nobody types here."""

    def show(self, text: str) -> None:
        """Show a line, and where to answer it."""
        _say(f"  ? {text}  answer it with hil answer\n")

    def discard(self) -> None:
        """Do nothing: nobody has typed."""

    def line(self) -> None:
        """Return None after a moment: nothing was entered yet."""
        wall.pause(_PATIENCE_S)


def _say(text: str) -> None:
    with suppress(OSError, ValueError):  # the next poll for input shows whether anybody is left
        sys.stderr.write(text)
        sys.stderr.flush()


def _waits() -> bool:
    """Return whether a line was entered that has not been read yet."""
    try:
        return bool(select.select([sys.stdin], [], [], 0.0)[0])
    except (OSError, ValueError, TypeError):
        return False


def _flush() -> None:
    """Flush the terminal's input; a run in the background is not stopped by that."""
    import termios  # noqa: PLC0415 - not there on every system that simulates

    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTTOU})
    try:
        with suppress(termios.error, OSError, ValueError, TypeError):  # it may be gone: the next poll shows that
            termios.tcflush(sys.stdin, termios.TCIFLUSH)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _ready() -> bool:
    """Return whether there is something to read, including the end of input; closed input has ended."""
    try:
        return bool(select.select([sys.stdin], [], [], _PATIENCE_S)[0])
    except (OSError, ValueError, TypeError):
        return True


def _read() -> bytes:
    """Return what was typed, empty at the end of input and once the terminal is gone."""
    try:
        return os.read(sys.stdin.fileno(), _BLOCK)
    except (OSError, ValueError, AttributeError):
        return b""
