"""Stopping: signals only set flags, and the run ends at the next scheduling point."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

__all__ = ["StopFlags", "Stopped", "handle_signals"]

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class Stopped(BaseException):
    """The run is to end. Not an Exception, so that a case's `except Exception` does not catch it."""


class StopFlags:
    """Whether the run is to end, and why.

    The first request lets the present sample finish; a second one is urgent and ends the case at
    once, wherever Python is, unless a transaction is on the wire or the bench is being made safe.

    Args:
        busy: tells whether a transaction is on the wire.
    """

    def __init__(self, busy: Callable[[], bool] = lambda: False) -> None:
        self._busy = busy
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
        if self.urgent and not self._shielded and not self._busy():
            raise Stopped(self.reason)

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
