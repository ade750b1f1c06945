"""The line at the foot of a terminal that is written again and again; elsewhere a line now and then."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from typing import TextIO

from hil.clock import wall

__all__ = ["StatusLine"]

_CLEAR = "\r\x1b[2K"
_REFRESH_S = 1.0
_MILESTONE_S = 3600.0
_WIDTH = 80


class StatusLine:
    """Keeps one line below everything else on a terminal; on anything else it is a line of its own every hour.

    Args:
        stream: where the line goes.
        text: gives the line's text.
        now: seconds on a wall clock that only goes forward.
    """

    def __init__(self, stream: TextIO, text: Callable[[], str], now: Callable[[], float] = wall.monotonic) -> None:
        self._stream = stream
        self._text = text
        self._now = now
        self._terminal = _is_terminal(stream)
        self._written = now()
        self._shown = False
        self.quiet = False

    def tick(self) -> None:
        """Write the line, if that is due; what becomes of it changes nothing."""
        due = self._written + (_REFRESH_S if self._terminal else _MILESTONE_S)
        if self.quiet or self._now() < due:
            return
        self._written = self._now()
        with suppress(OSError, ValueError):
            if self._terminal:
                self._stream.write(f"{_CLEAR}{self._text()[: self._width() - 1]}")
                self._shown = True
            else:
                self._stream.write(f"  still running: {self._text()}\n")
            self._stream.flush()

    def clear(self) -> None:
        """Take the line away, because something else is written there."""
        if self._shown:
            self._shown = False
            with suppress(OSError, ValueError):
                self._stream.write(_CLEAR)

    def _width(self) -> int:
        try:
            return os.get_terminal_size(self._stream.fileno()).columns or _WIDTH
        except (OSError, ValueError):
            return _WIDTH


def _is_terminal(stream: TextIO) -> bool:
    try:
        return stream.isatty() and os.environ.get("TERM") != "dumb"
    except (OSError, ValueError):
        return False
