"""One port by its descriptor: bytes out and in, each with a deadline, and never an endless wait.

The executive shares the descriptor. What belongs to the open file (flags, a terminal's settings) stays as it is; a
call that could block is preceded by a poll, and asks for little.
"""

from __future__ import annotations

import os
import select
import socket
import stat
import time
from threading import Event

__all__ = ["Gone", "Interrupted", "Line"]

_SLICE_S = 0.02
_AT_ONCE = 4096
_DEAD = select.POLLHUP | select.POLLERR | select.POLLNVAL


class Gone(Exception):
    """This descriptor is dead for good."""


class Interrupted(Exception):
    """A wait was ended: the port is needed for something more urgent."""


class Line:
    """One open port.

    Args:
        descriptor: of a terminal, or of a connected socket.
        baud: of a serial device, 0 if unknown: bytes then count as sent once they are written.
        interrupt: ends any wait when it is set.

    Attributes:
        busy_until: when the last byte was sent or received, on the monotonic clock [s].
    """

    def __init__(self, descriptor: int, baud: int = 0, interrupt: Event | None = None) -> None:
        self.descriptor = descriptor
        self._byte_s = 10 / baud if baud else 0.0
        self._interrupt = interrupt or Event()
        is_socket = stat.S_ISSOCK(os.fstat(descriptor).st_mode)
        self._socket = socket.socket(fileno=os.dup(descriptor)) if is_socket else None
        self._waits = not is_socket and os.get_blocking(descriptor)
        self.busy_until = time.monotonic()

    def now(self) -> float:
        """Return the time on the clock used for deadlines [s]."""
        return time.monotonic()

    def hear(self, until: float) -> bytes:
        """Return the first bytes that come, empty if none come by the deadline.

        Raises:
            Gone: if none ever will.
        """
        while True:
            events = self._poll(select.POLLIN, until)
            data = self._read() if events else b""
            if data:
                self.busy_until = time.monotonic()
                return data
            if events & _DEAD or (events and self._socket):
                raise Gone("the other end hung up")
            if time.monotonic() >= until:
                return b""

    def say(self, data: bytes, until: float) -> int:
        """Write until all is out or the deadline has passed; return how many bytes were taken.

        Raises:
            Gone: if none ever will be.
        """
        done = 0
        while done < len(data):
            events = self._poll(select.POLLOUT, until)
            if events & (select.POLLERR | select.POLLNVAL) or (events & select.POLLHUP and not self._socket):
                raise Gone("the other end hung up")
            done += self._write(data[done:]) if events else 0
            if time.monotonic() >= until:
                break
        self.busy_until = time.monotonic() + done * self._byte_s
        return done

    def close(self) -> None:
        """Close the descriptor; the open file may live on in other processes."""
        if self._socket:
            self._socket.close()
        os.close(self.descriptor)

    def _poll(self, wanted: int, until: float) -> int:
        poll = select.poll()
        poll.register(self.descriptor, wanted)
        while True:
            if self._interrupt.is_set():
                raise Interrupted
            left = min(until - time.monotonic(), _SLICE_S)
            events = sum(event for _, event in poll.poll(max(left, 0) * 1000))
            if events or left <= 0:
                return events

    def _read(self) -> bytes:
        try:
            if self._socket:
                return self._socket.recv(_AT_ONCE, socket.MSG_DONTWAIT)
            return os.read(self.descriptor, _AT_ONCE)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise Gone(error.strerror) from error

    def _write(self, data: bytes) -> int:
        try:
            if self._socket:
                return self._socket.send(data, socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL)
            return os.write(self.descriptor, data[:1] if self._waits else data)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise Gone(error.strerror) from error
