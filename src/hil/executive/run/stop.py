"""Stopping: signals only set flags, and the run ends at the next scheduling point."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

__all__ = ["StopFlags", "Stopped", "handle_signals"]

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class Stopped(BaseException):
    """The run is to end. Not an Exception, so that a case's `except Exception` does not catch it."""


class StopFlags:
    """Whether the run is to end, and why.

    The first request lets the present sample finish. A second one is urgent and ends a case that
    computes at once, wherever in its own code it is. What the executive does for a case is never cut
    in two: no transaction on the wire, no line of the journal, and least of all the way to the safe state.
    """

    def __init__(self) -> None:
        self._in_case = 0
        self._undisturbed = 0
        self._shielded = 0
        self.reason = ""
        self.urgent = False

    def request(self, reason: str) -> None:
        """Ask the run to end; a second request is urgent. Safe to call from a signal handler."""
        self.urgent = bool(self.reason)
        self.reason = self.reason or reason

    def check(self) -> None:
        """Raise Stopped if the run is to end and nothing is shielded."""
        if self.reason and not self._shielded:
            raise Stopped(self.reason)

    def interrupt(self) -> None:
        """Raise Stopped for an urgent request if that can be done right here."""
        if self.urgent and self._in_case and not self._undisturbed and not self._shielded:
            raise Stopped(self.reason)

    @contextmanager
    def case_code(self) -> Iterator[None]:
        """Let an urgent request end what runs in here at once: a case's own code, and nothing else."""
        self._in_case += 1
        try:
            yield
        finally:
            self._in_case -= 1

    @contextmanager
    def undisturbed(self) -> Iterator[None]:
        """Let requests wait for the next scheduling point: used while a case is served by the executive."""
        self._undisturbed += 1
        try:
            yield
        finally:
            self._undisturbed -= 1

    @contextmanager
    def shielded(self) -> Iterator[None]:
        """Let nothing interrupt: used while the bench is made safe and the package is sealed."""
        self._shielded += 1
        try:
            yield
        finally:
            self._shielded -= 1


@contextmanager
def handle_signals(flags: StopFlags) -> Iterator[None]:
    """Turn SIGINT, SIGTERM and SIGHUP into requests to stop; the handlers before are put back."""

    def handler(number: int, _frame: FrameType | None) -> None:
        flags.request(signal.Signals(number).name)
        flags.interrupt()

    before = {number: signal.signal(number, handler) for number in _SIGNALS}
    try:
        yield
    finally:
        for number, action in before.items():
            signal.signal(number, action)
