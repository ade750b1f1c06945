"""The end of a serial line that a server on the network owns, reached by RFC 2217."""

from __future__ import annotations

import errno
from collections.abc import Callable
from typing import TypeVar

from hil.clock import wall
from hil.guardian.ports.line import Gone
from hil.guardian.ports.opening import opened
from hil.guardian.ports.telnet import TelnetLine
from hil.model.errors import NoReply
from hil.model.safing import GuardedPort
from hil.model.serial_line import SerialLine
from hil.wire.tap import LONGEST_TRANSACTION

__all__ = ["TelnetStream"]

_DTR_LOW_S = 0.1
_Result = TypeVar("_Result")


class TelnetStream:
    """An open line of a server such as ser2net. See `hil.wire.exchange.FarEnd`.

    It reads in the thread of its caller only: pyserial's client has a thread that reads all the time, and would take
    the replies that the guardian waits for on the same connection.

    Args:
        device: the instrument's name.
        url: `rfc2217://host:port`.
        baud: 9600 where it is 0.
        line: how the line is set.

    Raises:
        NoReply: if there is no such server, or it does not set the line.
    """

    def __init__(self, device: str, url: str, baud: int = 0, line: SerialLine | None = None) -> None:
        port = GuardedPort(device=device, url=url, baud=baud or 9600, line=line or SerialLine(), telnet=True)
        self._ahead = b""
        try:
            self._line = opened(port)
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            hint = "check the server, its network, and who else has the line"
            raise NoReply(device, f"{url} cannot be opened: {why}", hint) from error

    def fileno(self) -> int:
        """Return the descriptor of the connection; who gets a copy of it has to speak Telnet, too."""
        return self._line.descriptor

    def opened(self) -> None:
        """Do nothing: it is open since it was made."""

    def closed(self) -> None:
        """Close it."""
        self._line.close()

    def dtr_rose(self) -> None:
        """Let DTR fall and rise at the server."""
        if isinstance(self._line, TelnetLine):
            self._line.pull_dtr(up=False)
            wall.pause(_DTR_LOW_S)
            self._line.pull_dtr(up=True)

    def write(self, data: bytes) -> None:
        """Write all bytes."""
        taken = _alive(lambda: self._line.say(data, wall.monotonic() + LONGEST_TRANSACTION))
        if taken < len(data):
            raise OSError(errno.ETIMEDOUT, "the server takes no bytes")

    def exchange(self, data: bytes, timeout: float) -> bytes:
        """Write all bytes, and give what is there once a byte has come, within `timeout` seconds of the wall."""
        end_s = wall.monotonic() + timeout
        self.write(data)
        first = self.read(1, max(0.0, end_s - wall.monotonic()))
        return first + self.read(self.waiting(), 0.0) if first else b""

    def read(self, size: int, timeout: float) -> bytes:
        """Give `size` bytes, or what came within `timeout` seconds of the wall."""
        end_s = wall.monotonic() + timeout
        while len(self._ahead) < size:
            came = _alive(lambda: self._line.hear(end_s))
            if not came:
                break
            self._ahead += came
        data, self._ahead = self._ahead[:size], self._ahead[size:]
        return data

    def waiting(self) -> int:
        """Return how many bytes can be read at once."""
        while came := _alive(lambda: self._line.hear(0.0)):
            self._ahead += came
        return len(self._ahead)

    def discard(self) -> None:
        """Throw received bytes away."""
        self.waiting()
        self._ahead = b""


def _alive(operation: Callable[[], _Result]) -> _Result:
    """Do something on the line; one that is gone is an OSError, as of every stream."""
    try:
        return operation()
    except Gone as error:
        raise OSError(errno.ECONNRESET, str(error)) from error
