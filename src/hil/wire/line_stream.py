"""Far end of a port that is not a plain stream: a serial server's line, or a message-based instrument."""

from __future__ import annotations

import errno
from collections.abc import Callable
from typing import Literal, TypeVar

from hil.clock import wall
from hil.guardian.ports.line import Gone
from hil.guardian.ports.opening import opened
from hil.guardian.ports.telnet import TelnetLine
from hil.model.errors import NoReply
from hil.model.safing import GuardedPort
from hil.model.serial_line import SerialLine
from hil.wire.obstacles import obstacle
from hil.wire.opening import VISA_LAN, VISA_USB, PortKind, bare, kind_of, url_of_resource
from hil.wire.tap import LONGEST_TRANSACTION

__all__ = ["LineStream", "port_of"]

_DTR_LOW_S = 0.1
_SPEAKS: dict[PortKind, Literal["", "telnet", "usbtmc", "hislip", "vxi11"]] = {
    PortKind.SERIAL: "",
    PortKind.SOCKET: "",
    PortKind.OTHER: "",
    PortKind.RFC2217: "telnet",
    PortKind.USBTMC: "usbtmc",
    PortKind.HISLIP: "hislip",
    PortKind.VXI11: "vxi11",
}
_Result = TypeVar("_Result")


class LineStream:
    """An open port that shares its code with the guardian. See `hil.wire.exchange.FarEnd`.

    It reads only in its caller's thread. pyserial's RFC 2217 client has a thread that reads continuously, and would
    consume replies that the guardian awaits on the same connection.

    Args:
        port: the port as the guardian would open it.

    Raises:
        NoReply: if it cannot be opened.
    """

    def __init__(self, port: GuardedPort) -> None:
        self._ahead = b""
        try:
            self._line = opened(port)
        except (OSError, ValueError) as error:
            why, hint = obstacle(getattr(error, "filename", None) or port.url, error)
            raise NoReply(port.device, f"{port.url} cannot be opened: {why}", hint) from error

    def fileno(self) -> int:
        """Return the descriptor; the receiver of a copy must speak the same protocol."""
        return self._line.descriptor

    def opened(self) -> None:
        """Do nothing: it has been open since its creation."""

    def closed(self) -> None:
        """Close it."""
        self._line.close()

    def dtr_rose(self) -> None:
        """Pulse DTR at the server; message-based instruments have none."""
        if isinstance(self._line, TelnetLine):
            self._line.pull_dtr(up=False)
            wall.pause(_DTR_LOW_S)
            self._line.pull_dtr(up=True)

    def write(self, data: bytes) -> None:
        """Write all bytes."""
        taken = _alive(lambda: self._line.say(data, wall.monotonic() + LONGEST_TRANSACTION))
        if taken < len(data):
            raise OSError(errno.ETIMEDOUT, "it takes no bytes")

    def exchange(self, data: bytes, timeout: float) -> bytes:
        """Write all bytes, and return what has arrived once the first byte came, within `timeout` s of wall time."""
        end_s = wall.monotonic() + timeout
        self.write(data)
        first = self.read(1, max(0.0, end_s - wall.monotonic()))
        return first + self.read(self.waiting(), 0.0) if first else b""

    def read(self, size: int, timeout: float) -> bytes:
        """Return `size` bytes, or fewer after `timeout` s of wall time."""
        end_s = wall.monotonic() + timeout
        while len(self._ahead) < size:
            came = _alive(lambda: self._line.hear(end_s))
            if not came:
                break
            self._ahead += came
        data, self._ahead = self._ahead[:size], self._ahead[size:]
        return data

    def waiting(self) -> int:
        """Return the number of bytes that can be read without waiting."""
        while came := _alive(lambda: self._line.hear(0.0)):
            self._ahead += came
        return len(self._ahead)

    def discard(self) -> None:
        """Discard received bytes."""
        self.waiting()
        self._ahead = b""


def port_of(device: str, port: str, baud: int = 0, line: SerialLine | None = None) -> GuardedPort:
    """Return how to open a bench file's port without a driver.

    Args:
        device: the instrument's name.
        port: a path, a URL, or a VISA resource name; a port opened by PyVISA has a session that cannot be shared.
        baud: baud rate of a serial line.
        line: settings of a serial line.
    """
    name = bare(port)
    speaks, url = _SPEAKS[kind_of(name)], url_of_resource(port)
    if match := VISA_USB.match(name):
        url = f"usbtmc://{match['vendor']}:{match['product']}:{match['serial']}"
    elif match := VISA_LAN.match(name):
        there, _, number = (match["name"] or "inst0").partition("," if speaks == "hislip" else "\0")
        url = f"{speaks}://{match['host']}{f':{number}' if number else ''}/{there}"
    return GuardedPort(device=device, url=url, baud=baud, line=line or SerialLine(), speaks=speaks, apart=name != port)


def _alive(operation: Callable[[], _Result]) -> _Result:
    """Run an operation on the line; a lost line becomes an OSError, as for any stream."""
    try:
        return operation()
    except Gone as error:
        raise OSError(errno.ECONNRESET, str(error)) from error
