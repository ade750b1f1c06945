"""Network instruments by VXI-11: calls of ONC RPC (RFC 5531) over TCP, found by the portmapper (RFC 1833)."""

from __future__ import annotations

import errno
import struct
import time
from contextlib import suppress
from typing import Self

from hil.guardian.ports.connection import connected

__all__ = ["Vxi11"]

_PORTMAPPER, _PORTMAPPER_PORT, _GET_PORT, _TCP = (100_000, 2), 111, 3, 6
_CORE = (0x0607AF, 1)  # VXI-11, appendix B
_CREATE_LINK, _WRITE, _READ, _CLEAR, _DESTROY_LINK = 10, 11, 12, 15, 23
_END = 1 << 3  # VXI-11, B.5.3: the last byte is sent with END
_REASON_END = 1 << 2  # B.6.4: the last byte came with END
_IO_TIMEOUT, _NOT_SUPPORTED = 15, 8
_ERRORS = {
    0: "",
    1: "syntax error",
    3: "the device is not accessible",
    4: "no such link",
    5: "a parameter is wrong",
    6: "the channel is not established",
    8: "it cannot do that",
    9: "it is out of resources",
    11: "another session has locked it",
    12: "no session has locked it",
    15: "it gave up waiting",
    17: "an error of its own",
    21: "its address is wrong",
    23: "it was aborted",
    29: "the channel is open already",
}
_MORE_S = 0.2  # beyond the instrument's own limit
_LONGEST = 65_536
_LAST = 1 << 31


class Vxi11:
    """One link to an instrument. See `hil.guardian.ports.messages.Messenger`.

    Args:
        host: of the instrument.
        name: of the instrument there, `inst0` for most.
        port: of its core channel, 0 to ask the portmapper.
        seconds: how long each step of opening may take.

    Raises:
        OSError: if there is no such instrument, or it grants no link.
    """

    def __init__(self, host: str, name: str = "inst0", port: int = 0, seconds: float = 0.5) -> None:
        if not port:
            with _Calls(host, _PORTMAPPER_PORT, seconds) as portmapper:
                asked = struct.pack(">IIII", *_CORE, _TCP, 0)
                (port,) = struct.unpack(">I", portmapper.call(_PORTMAPPER, _GET_PORT, asked, seconds)[:4])
            if not port:
                raise OSError(errno.ENOENT, "its portmapper knows no VXI-11 instrument")
        self._calls = _Calls(host, port, seconds)
        try:
            wanted = struct.pack(">III", 0x48494C, 0, 0) + _opaque(name.encode("ascii"))
            error, self._link, _, longest = struct.unpack(">IIII", self._call(_CREATE_LINK, wanted, seconds)[:16])
            _require_success(error)
        except BaseException:
            self._calls.close()
            raise
        self._most = min(max(longest, 1), _LONGEST)
        self.descriptor = self._calls.descriptor

    def send(self, message: bytes, seconds: float) -> None:
        """Send a message, in as many calls as the instrument needs."""
        for begin in range(0, len(message), self._most):
            piece = message[begin : begin + self._most]
            flags = _END if begin + len(piece) == len(message) else 0
            arguments = struct.pack(">IIII", self._link, round(seconds * 1000), 0, flags) + _opaque(piece)
            error, size = struct.unpack(">II", self._call(_WRITE, arguments, seconds)[:8])
            _require_success(error)
            if size != len(piece):
                raise OSError(errno.EPROTO, f"it took {size} of {len(piece)} bytes")

    def receive(self, seconds: float) -> bytes:
        """Fetch the reply, empty if none comes in that time."""
        until, reply = time.monotonic() + seconds, b""
        while True:
            left_ms = max(round((until - time.monotonic()) * 1000), 1)
            asked = struct.pack(">IIIIII", self._link, _LONGEST, left_ms, 0, 0, 0)
            answer = self._call(_READ, asked, left_ms / 1000)
            error, reason, size = struct.unpack(">III", answer[:12])
            if error == _IO_TIMEOUT:
                return b""
            _require_success(error)
            reply += answer[12 : 12 + size]
            if reason & _REASON_END:
                return reply
            if time.monotonic() >= until:
                return b""

    def clear(self, seconds: float) -> None:
        """Clear the instrument's buffers.

        Raises:
            OSError: with EOPNOTSUPP if it cannot do that, any other if it is gone, or locked by another session.
        """
        answer = self._call(_CLEAR, struct.pack(">IIII", self._link, 0, 0, round(seconds * 1000)), seconds)
        (error,) = struct.unpack(">I", answer[:4])
        if error == _NOT_SUPPORTED:
            raise OSError(errno.EOPNOTSUPP, _ERRORS[error])
        _require_success(error)

    def close(self) -> None:
        """Destroy the link, and end the connection."""
        with suppress(OSError):
            self._call(_DESTROY_LINK, struct.pack(">I", self._link), _MORE_S)
        self._calls.close()

    def _call(self, procedure: int, arguments: bytes, seconds: float) -> bytes:
        return self._calls.call(_CORE, procedure, arguments, seconds + _MORE_S)


class _Calls:
    """Remote calls over one connection, one at a time."""

    def __init__(self, host: str, port: int, seconds: float) -> None:
        self._connection = connected(host, port, seconds)
        self.descriptor = self._connection.fileno()
        self._number = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the connection."""
        self._connection.close()

    def call(self, program: tuple[int, int], procedure: int, arguments: bytes, seconds: float) -> bytes:
        """Call a procedure and return its results; replies to older calls are skipped.

        Raises:
            OSError: if it is refused, or no reply comes in time.
        """
        until = time.monotonic() + seconds
        self._number = (self._number + 1) & 0xFFFF_FFFF
        head = struct.pack(">IIIIII", self._number, 0, 2, *program, procedure) + bytes(16)  # no credentials
        self._connection.settimeout(seconds)
        self._connection.sendall(struct.pack(">I", _LAST | len(head) + len(arguments)) + head + arguments)
        while True:
            reply = self._record(until)
            if len(reply) < 24 or reply[4:8] != b"\0\0\0\1":
                raise OSError(errno.EPROTO, "it does not speak ONC RPC")
            number, _, denied, _, verifier = struct.unpack(">IIIII", reply[:20])
            if number != self._number:
                continue
            accepted = 20 + verifier + 4
            if denied or reply[20 + verifier : accepted] != bytes(4):
                raise OSError(errno.EPROTO, "it refuses the call")
            return reply[accepted:]

    def _record(self, until: float) -> bytes:
        record, last = b"", False
        while not last:
            (mark,) = struct.unpack(">I", self._all(4, until))
            last, size = bool(mark & _LAST), mark & ~_LAST
            if size > 2 * _LONGEST:
                raise OSError(errno.EPROTO, "it does not speak ONC RPC")
            record += self._all(size, until)
        return record

    def _all(self, size: int, until: float) -> bytes:
        data = b""
        while len(data) < size:
            self._connection.settimeout(max(until - time.monotonic(), 0.001))
            came = self._connection.recv(size - len(data))
            if not came:
                raise OSError(errno.ECONNRESET, "the other end hung up")
            data += came
        return data


def _opaque(data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + data + bytes(-len(data) % 4)


def _require_success(error: int) -> None:
    if error:
        raise OSError(errno.EPROTO, _ERRORS.get(error, f"error {error} of VXI-11"))
