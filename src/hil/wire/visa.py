"""Far end of a port opened by PyVISA, selected by `visa:` in a bench file."""

from __future__ import annotations

import errno
import socket
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar

from hil.clock import wall
from hil.guardian.ports.line import Line
from hil.guardian.ports.messages import MessageLine, tried
from hil.model.errors import NoReply
from hil.wire.line_stream import LineStream
from hil.wire.opening import PortKind, bare, kind_of

__all__ = ["VisaStream", "why_not_shared"]

_OPENED_MS = 2000
_LEAST_MS = 1
_DRAINED_MS = 1
_Result = TypeVar("_Result")


class VisaStream(LineStream):
    """A port opened by PyVISA and the VISA library it finds. See `hil.wire.exchange.FarEnd`.

    The library's session belongs to this process. So the descriptor carries no data: it only signals to others, by
    hanging up, that the session was lost.

    Args:
        device: the instrument's name.
        port: port as in the bench file, with `visa:`.
        baud: baud rate of a serial line, 9600 if 0.

    Raises:
        NoReply: if PyVISA or its library is missing, or it cannot open the port.
    """

    def __init__(self, device: str, port: str, baud: int = 0) -> None:
        self._ahead = b""
        session = _Session(lambda: _resource(device, port, baud))
        is_stream = port.upper().endswith("::SOCKET") or bare(port).upper().startswith("ASRL")
        self._line = _ByteLine(session) if is_stream else MessageLine(session)


def why_not_shared(port: str) -> str:
    """Return why the guardian cannot reach a port that PyVISA opened for the run; empty if it can."""
    name = bare(port)
    if name == port:
        return ""
    kind = kind_of(name)
    if kind is PortKind.USBTMC:
        return f"is at {port}, which PyVISA keeps for the run alone: write its port without 'visa:'"
    if kind is PortKind.OTHER or (kind is PortKind.SERIAL and not name.upper().startswith("ASRL/")):
        return (
            f"is at {port}, where only PyVISA in the process of the run can reach it; a gateway is TCPIP::HOST::gpib0,5"
        )
    return ""


def _resource(device: str, port: str, baud: int) -> Any:  # noqa: ANN401 - PyVISA's resources
    try:
        import pyvisa  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise NoReply(device, f"{port} needs PyVISA, which is not installed", "pip install 'hil[visa]'") from error
    try:
        manager = pyvisa.ResourceManager()
    except (OSError, ValueError) as error:
        hint = "pip install 'hil[visa]', or install the VISA library of your interface's maker"
        raise NoReply(device, f"{port}: PyVISA finds no VISA library ({_line(error)})", hint) from error
    try:
        resource: Any = manager.open_resource(bare(port), open_timeout=_OPENED_MS)
        if bare(port).upper().startswith("ASRL"):
            resource.baud_rate = baud or 9600
    except Exception as error:  # libraries raise arbitrary exceptions
        hint = "check the name with 'pyvisa-info' and 'pyvisa-shell', its cable and its power"
        raise NoReply(device, f"{port} cannot be opened by PyVISA ({_line(error)})", hint) from error
    return resource


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


class _Session:
    """PyVISA session as a carrier of whole messages. See `hil.guardian.ports.messages.Messenger`.

    Attributes:
        descriptor: hangs up once the session is lost.
    """

    def __init__(self, opened: Callable[[], Any]) -> None:
        self._opened = opened
        self._resource = opened()
        self._owes = False
        self._near, self._far = socket.socketpair()
        self.descriptor = self._near.fileno()

    def send(self, message: bytes, seconds: float) -> None:
        """Send a message."""
        self._limit(seconds)
        self._alive(lambda: self._resource.write_raw(message))
        self._owes = b"?" in message

    def receive(self, seconds: float) -> bytes:
        """Fetch the reply, empty if none comes in that time."""
        self._limit(seconds)
        data = self._alive(self._resource.read_raw) or b""
        self._owes = self._owes and not data
        return data

    def some(self, milliseconds: float) -> bytes:
        """Fetch one byte, empty if none comes in that time."""
        self._limit(milliseconds / 1000)
        return self._alive(lambda: self._resource.read_bytes(1)) or b""

    def clear(self, seconds: float) -> None:
        """Clear the instrument's input and output buffers.

        PyVISA-py loses synchronisation if a late reply comes instead of the acknowledgement. So a reply already here is
        fetched first. If one comes meanwhile, a new session is opened, which takes a few tenths of a second.
        """
        if self._owes:
            self.receive(_DRAINED_MS / 1000)
        self._limit(seconds)
        try:
            self._alive(self._resource.clear, at_risk=True)
        except OSError as error:
            if error.errno == errno.EOPNOTSUPP:
                raise
            self._end()
            self._owes, self._resource = False, self._alive(self._opened)

    def close(self) -> None:
        """Close it."""
        self._end()
        self._near.close()
        self._far.close()

    def _end(self) -> None:
        with suppress(Exception):  # already gone, as intended
            self._resource.close()

    def _limit(self, seconds: float) -> None:
        self._alive(lambda: setattr(self._resource, "timeout", max(round(seconds * 1000), _LEAST_MS)))

    def _alive(self, operation: Callable[[], _Result], *, at_risk: bool = False) -> _Result | None:
        """Run an operation; None on timeout. A lost session hangs up, unless `at_risk`.

        Raises:
            OSError: if it is lost, or with EOPNOTSUPP if the operation is not supported.
        """
        from pyvisa.constants import StatusCode  # noqa: PLC0415 - an extra

        try:
            return operation()
        except Exception as error:
            code = getattr(error, "error_code", None)
            if code == StatusCode.error_timeout:
                return None
            if code in {StatusCode.error_nonsupported_operation, StatusCode.error_nonimplemented_operation}:
                raise OSError(errno.EOPNOTSUPP, "it cannot do that") from error
            if not at_risk:
                self._far.close()
            raise OSError(errno.ECONNRESET, f"its VISA session was lost ({_line(error)})") from error


class _ByteLine(Line):
    """A serial line or socket opened by PyVISA, with the interface of a byte line."""

    def __init__(self, session: _Session) -> None:  # no descriptor is needed
        self.descriptor = session.descriptor
        self.busy_until = wall.monotonic()
        self._session = session

    def hear(self, until: float) -> bytes:
        """Return the first bytes received, empty if none arrive by the deadline. See `Line.hear`."""
        data = tried(lambda: self._session.some(max((until - wall.monotonic()) * 1000, _DRAINED_MS)))
        while data and (more := tried(lambda: self._session.some(_DRAINED_MS))):
            data += more
        return data

    def say(self, data: bytes, until: float) -> int:
        """Write all bytes; return the number accepted. See `Line.say`."""
        tried(lambda: self._session.send(data, max(until - wall.monotonic(), _DRAINED_MS / 1000)))
        return len(data)

    def close(self) -> None:
        """Close the port."""
        self._session.close()
