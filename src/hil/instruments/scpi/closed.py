"""A SCPI session for instruments that take one question in a line: every reply is closed by the identification.

A reply does not say which question it belongs to, and here the question cannot be asked together with `*IDN?`. So the
identification is asked for right after it. Instruments answer in order: if the next line is the identification, then
exactly one line came for the question. A line that nobody had asked for pushes the true reply to where the
identification should be.

After a fault identifications may be owed too, so that one of them would not show that the session is in step. The port
is listened to until it is silent for longer than the instrument takes to answer.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from hil.instruments.scpi.session import ScpiSession
from hil.model.errors import Garbled

__all__ = ["ClosedSession"]

_SILENCE_S = 0.1
_MOST_LISTENED = 5
_MOST_BYTES = 4096

_T = TypeVar("_T")


class ClosedSession(ScpiSession):
    """The host's end of one SCPI dialogue, one question in a line. See `hil.instruments.scpi.ScpiSession`."""

    def _ask(self, command: str, parse: Callable[[str], _T]) -> _T:
        reply = self._bare(command, parse)
        self._bare("*IDN?", self._closes)
        return reply

    def _closes(self, line: str) -> None:
        """Accept the identification that was learnt last, or learn it."""
        if self._frame and line != self._frame:
            raise ValueError(self._frame)
        self._identified(line)

    def _step_again(self) -> None:
        """Listen until there is silence; then the first line must be the identification."""
        for _ in range(_MOST_LISTENED):
            if not self._silence():
                break
        else:
            raise Garbled(self._device, "bytes come without an end that nobody asked for", "look who else talks to it")
        self._bare("*IDN?", self._identified)
        self._in_step = True

    def _silence(self) -> bytes:
        """Return what comes within a tenth of a second, and throw it away."""
        try:
            self._port.timeout = _SILENCE_S
            stray = self._port.read(_MOST_BYTES)
        except OSError as error:
            raise self._dead_port("*IDN?", error) from error
        self._discarded += len(stray)
        return stray
