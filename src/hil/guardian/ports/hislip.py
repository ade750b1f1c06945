"""Network instruments by HiSLIP (IVI-6.1): two connections, messages with numbers, and replies that name theirs."""

from __future__ import annotations

import errno
import socket
import struct
import time

from hil.guardian.ports.connection import connected

__all__ = ["HISLIP_PORT", "HiSlip"]

HISLIP_PORT = 4880
"""The port on which servers listen by default."""

_HEADER = struct.Struct(">2sBBIQ")  # IVI-6.1, section 2.4: prologue, type, control code, parameter, length
_INITIALIZE, _INITIALIZED, _FATAL, _ERROR, _DATA, _DATA_END = 0, 1, 2, 3, 6, 7
_CLEAR_COMPLETE, _CLEAR_ACKNOWLEDGED, _INTERRUPTED = 8, 9, 13
_MOST_SIZE, _MOST_SIZE_TOLD = 15, 16
_ASYNC_INITIALIZE, _ASYNC_INITIALIZED, _ASYNC_CLEAR, _ASYNC_CLEARED = 17, 18, 19, 23
_FIRST = 0xFFFF_FF00
_VERSION_1, _VENDOR = 0x0100, 0x4849
_OURS = 65_536
_LONGEST = 1 << 20


class HiSlip:
    """One session with an instrument. See `hil.guardian.ports.messages.Messenger`.

    Args:
        host: of the instrument.
        port: of its HiSLIP server.
        name: of the instrument there, `hislip0` for most.
        seconds: how long each step of opening may take.

    Raises:
        OSError: if there is no such server, or it does not open a session.
    """

    def __init__(self, host: str, port: int = HISLIP_PORT, name: str = "hislip0", seconds: float = 0.5) -> None:
        self._sync = connected(host, port, seconds)
        self._async: socket.socket | None = None
        try:
            until = time.monotonic() + seconds
            _send(self._sync, _INITIALIZE, 0, _VERSION_1 << 16 | _VENDOR, name.encode("ascii"))
            _, parameter, _ = _expected(self._sync, _INITIALIZED, until)
            self._async = connected(host, port, seconds)
            _send(self._async, _ASYNC_INITIALIZE, 0, parameter & 0xFFFF)
            _expected(self._async, _ASYNC_INITIALIZED, until)
            _send(self._async, _MOST_SIZE, 0, 0, struct.pack(">Q", _OURS))
            _expected(self._async, _MOST_SIZE_TOLD, until)
        except BaseException:
            self.close()
            raise
        self.descriptor = self._sync.fileno()
        self._number = self._asked = _FIRST
        self._fetched = 0

    def send(self, message: bytes, seconds: float) -> None:
        """Send a message, whose number its reply must name."""
        self._sync.settimeout(seconds)
        _send(self._sync, _DATA_END, self._fetched, self._number, message)
        self._fetched, self._asked = 0, self._number
        self._number = (self._number + 2) & 0xFFFF_FFFF

    def receive(self, seconds: float) -> bytes:
        """Fetch the reply to the last message, empty if none comes in that time; older replies are skipped."""
        until, reply = time.monotonic() + seconds, b""
        while True:
            try:
                kind, _, number, payload = _message(self._sync, until)
            except TimeoutError:
                return b""
            if kind in {_DATA, _DATA_END} and number == self._asked:
                reply += payload
                if kind == _DATA_END:
                    self._fetched = 1
                    return reply
            elif kind == _FATAL:
                raise OSError(errno.EPROTO, payload.decode("ascii", "replace") or "a fatal error of HiSLIP")
            elif kind in {_INTERRUPTED, _ERROR}:
                reply = b""

    def clear(self, seconds: float) -> None:
        """Clear the instrument, and restart the message count; IVI-6.1, section 6.12."""
        until = time.monotonic() + seconds
        if self._async is None:
            raise OSError(errno.ENOTCONN, "it is closed")
        _send(self._async, _ASYNC_CLEAR, 0, 0)
        control, _, _ = _expected(self._async, _ASYNC_CLEARED, until)
        _send(self._sync, _CLEAR_COMPLETE, control & 1, 0)
        _expected(self._sync, _CLEAR_ACKNOWLEDGED, until)
        self._number, self._fetched = _FIRST, 0

    def close(self) -> None:
        """End the session."""
        for each in (self._sync, self._async):
            if each is not None:
                each.close()


def _send(connection: socket.socket, kind: int, control: int, parameter: int, payload: bytes = b"") -> None:
    connection.sendall(_HEADER.pack(b"HS", kind, control, parameter, len(payload)) + payload)


def _expected(connection: socket.socket, kind: int, until: float) -> tuple[int, int, bytes]:
    """Return control code, parameter and payload of the next message of a kind; others are skipped.

    Raises:
        OSError: if the server reports an error, or none comes in time.
    """
    while True:
        found, control, parameter, payload = _message(connection, until)
        if found == kind:
            return control, parameter, payload
        if found == _FATAL:
            raise OSError(errno.EPROTO, payload.decode("ascii", "replace") or "a fatal error of HiSLIP")


def _message(connection: socket.socket, until: float) -> tuple[int, int, int, bytes]:
    prologue, kind, control, parameter, length = _HEADER.unpack(_all(connection, _HEADER.size, until))
    if prologue != b"HS" or length > _LONGEST:
        raise OSError(errno.EPROTO, "it does not speak HiSLIP")
    return kind, control, parameter, _all(connection, length, until)


def _all(connection: socket.socket, size: int, until: float) -> bytes:
    data = b""
    while len(data) < size:
        connection.settimeout(max(until - time.monotonic(), 0.001))
        try:
            came = connection.recv(size - len(data))
        except TimeoutError:
            if data:
                raise OSError(errno.EPROTO, "half a message came") from None
            raise
        if not came:
            raise OSError(errno.ECONNRESET, "the other end hung up")
        data += came
    return data
