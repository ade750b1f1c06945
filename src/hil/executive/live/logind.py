"""Asking logind to hold off sleep and shutdown, over the system's D-Bus."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from typing import Any

from hil.clock import wall
from hil.model.errors import HilError

__all__ = ["NotHeldOff", "hold_off"]

_LIMIT_S = 1.0
_BLOCK = 4096
_MOST_DESCRIPTORS = 16


class NotHeldOff(HilError):
    """Sleep and shutdown are not held off."""


def hold_off(why: str, limit_s: float = _LIMIT_S) -> int:
    """Return a descriptor that holds off sleep and shutdown of this machine until every copy of it is closed.

    This is `Inhibit` of `org.freedesktop.login1.Manager` with `what` "sleep:shutdown" and `mode` "block", see
    systemd's inhibitor locks (https://systemd.io/INHIBITOR_LOCKS). The bus is that of DBUS_SYSTEM_BUS_ADDRESS, or the
    system's own.

    Args:
        why: what the machine is busy with, for whoever asks it to sleep.
        limit_s: how long the connection, and each call, may take [s].

    Raises:
        NotHeldOff: with what logind, or the bus, said.
    """
    try:
        with socket.socket(socket.AF_UNIX) as connection:
            return _Bus(connection, limit_s).inhibit(why)
    except (OSError, RuntimeError, ValueError, StopIteration) as error:  # the last three: an address that is none
        said = "no answer in time" if isinstance(error, TimeoutError) else getattr(error, "strerror", None) or error
        raise NotHeldOff(f"logind cannot be asked over D-Bus: {said}") from error


class _Bus:
    """One connection to a bus, on which no step lasts longer than its limit."""

    def __init__(self, connection: socket.socket, limit_s: float) -> None:
        from jeepney import Parser  # noqa: PLC0415 - only where something holds off sleep

        self._connection = connection
        self._limit_s = limit_s
        self._serial = 0
        self._parser = Parser()
        connection.settimeout(limit_s)
        self._authenticate()

    def _authenticate(self) -> None:
        from jeepney.auth import BEGIN, Authenticator  # noqa: PLC0415 - as above
        from jeepney.bus import get_bus  # noqa: PLC0415 - as above

        self._connection.connect(get_bus("SYSTEM"))
        steps = Authenticator(enable_fds=True)
        within = self._deadline()
        for step in steps:
            self._connection.sendall(step)
            within()
            steps.feed(_some(self._connection.recv(_BLOCK)))
        self._connection.sendall(BEGIN)

    def inhibit(self, why: str) -> int:
        from jeepney import DBusAddress, message_bus, new_method_call  # noqa: PLC0415 - as above

        manager = DBusAddress("/org/freedesktop/login1", "org.freedesktop.login1", "org.freedesktop.login1.Manager")
        self._call(message_bus.Hello())
        wanted = ("sleep:shutdown", "hil", why, "block")
        held = self._call(new_method_call(manager, "Inhibit", "ssss", wanted))
        if len(held) != 1 or not hasattr(held[0], "to_raw_fd"):
            raise NotHeldOff("logind gave no descriptor")
        descriptor: int = held[0].to_raw_fd()
        os.set_inheritable(descriptor, False)
        return descriptor

    def _call(self, message: Any) -> tuple[Any, ...]:  # noqa: ANN401 - jeepney has no types
        from jeepney import DBusErrorResponse, HeaderFields  # noqa: PLC0415 - as above
        from jeepney.wrappers import unwrap_msg  # noqa: PLC0415 - as above

        self._serial += 1
        self._connection.sendall(message.serialise(serial=self._serial))
        within = self._deadline()
        while True:
            came = self._parser.get_next_message()
            if came is None:
                within()
                self._receive()
            elif came.header.fields.get(HeaderFields.reply_serial) == self._serial:
                try:
                    body: tuple[Any, ...] = unwrap_msg(came)
                except DBusErrorResponse as error:
                    raise NotHeldOff(f"logind refuses: {error}") from error
                return body

    def _receive(self) -> None:
        from jeepney import FileDescriptor  # noqa: PLC0415 - as above

        data, descriptors, _, _ = socket.recv_fds(self._connection, self._parser.bytes_desired(), _MOST_DESCRIPTORS)
        self._parser.add_data(_some(data), fds=[FileDescriptor(each) for each in descriptors])

    def _deadline(self) -> Callable[[], None]:
        """Return what leaves the connection as much patience as is left, and raises TimeoutError once none is."""
        end = wall.monotonic() + self._limit_s

        def within() -> None:
            left = end - wall.monotonic()
            if left <= 0:
                raise TimeoutError
            self._connection.settimeout(left)

        return within


def _some(data: bytes) -> bytes:
    if not data:
        raise ConnectionResetError("the bus hung up")
    return data
