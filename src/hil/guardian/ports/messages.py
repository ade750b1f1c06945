"""Message-based ports (USBTMC, HiSLIP, VXI-11) as lines: a reply is fetched only after a question was sent."""

from __future__ import annotations

import errno
import time
from collections.abc import Callable
from typing import Protocol, TypeVar

from hil.guardian.ports.line import Gone, Line

__all__ = ["MessageLine", "Messenger", "tried"]

_LEAST_S = 0.05
_Result = TypeVar("_Result")


class Messenger(Protocol):
    """One way to pass whole messages. A permanent failure is an OSError.

    Attributes:
        descriptor: of the file or connection that shows whether the port is there.
    """

    descriptor: int

    def send(self, message: bytes, seconds: float) -> None:
        """Send a message."""
        ...

    def receive(self, seconds: float) -> bytes:
        """Fetch the reply, empty if none comes in that time."""
        ...

    def clear(self, seconds: float) -> None:
        """Clear the instrument's input and output buffers.

        Raises:
            OSError: with EOPNOTSUPP if it cannot do that.
        """
        ...

    def close(self) -> None:
        """Close it."""
        ...


class MessageLine(Line):
    """A port that carries messages, with the interface of a line.

    An instrument may be read only after a question; reading it otherwise is an error in itself, which some do not
    survive. So waiting for silence reads nothing. A reply that was late is never taken for that to the next
    question: the instrument is cleared first. It is also cleared before the first message, because another process
    may have been in the middle of something.
    """

    def __init__(self, messenger: Messenger) -> None:  # nothing of a line of bytes is needed
        self.descriptor = messenger.descriptor
        self.busy_until = time.monotonic()
        self._messenger = messenger
        self._owes = False
        self._stale = True

    def hear(self, until: float) -> bytes:
        """Return the reply to the question that was sent, empty if none comes by the deadline. See `Line.hear`."""
        left = until - time.monotonic()
        if left <= 0:
            return b""
        if not self._owes:
            time.sleep(left)
            return b""
        data = tried(lambda: self._messenger.receive(left))
        if data:
            self._owes, self.busy_until = False, time.monotonic()
        return data

    def say(self, data: bytes, until: float) -> int:
        """Send a message; return its size. See `Line.say`."""
        if self._owes or self._stale:
            tried(lambda: self._forget(max(until - time.monotonic(), _LEAST_S)))
        self._stale = False
        tried(lambda: self._messenger.send(data, max(until - time.monotonic(), _LEAST_S)))
        self._owes, self.busy_until = b"?" in data, time.monotonic()
        return len(data)

    def _forget(self, seconds: float) -> None:
        """Clear the instrument; from one that cannot be cleared, fetch the outstanding reply instead."""
        try:
            self._messenger.clear(seconds)
        except OSError as error:
            if error.errno != errno.EOPNOTSUPP:
                raise
            if self._owes:
                self._messenger.receive(seconds)

    def close(self) -> None:
        """Close the port."""
        self._messenger.close()


def tried(operation: Callable[[], _Result]) -> _Result:
    """Do an operation of a session.

    Raises:
        Gone: if it fails.
    """
    try:
        return operation()
    except OSError as error:
        raise Gone(error.strerror or str(error)) from error
