"""Sleep inhibitor: this machine neither sleeps nor shuts down while a live bench is driven."""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
from collections.abc import Callable, Sequence
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

from hil.clock import wall
from hil.model.errors import HilError, Refused

__all__ = ["Inhibitor", "NotHeldOff", "hold_off"]

_LIMIT_S = 1.0
_BLOCK = 4096
_MOST_DESCRIPTORS = 16


class NotHeldOff(HilError):
    """Sleep and shutdown are not inhibited."""


def hold_off(why: str, limit_s: float = _LIMIT_S) -> int:
    """Return a descriptor that inhibits sleep and shutdown of this machine until every copy of it is closed.

    This is `Inhibit` of `org.freedesktop.login1.Manager` with `what` "sleep:shutdown" and `mode` "block", see
    systemd's inhibitor locks (https://systemd.io/INHIBITOR_LOCKS). The bus is that of DBUS_SYSTEM_BUS_ADDRESS, or the
    system's own.

    Args:
        why: what the machine is busy with, for anyone who asks it to sleep.
        limit_s: timeout of the connection, and of each call [s].

    Raises:
        NotHeldOff: with what logind, or the bus, said.
    """
    try:
        with socket.socket(socket.AF_UNIX) as connection:
            return _Bus(connection, limit_s).inhibit(why)
    except (OSError, RuntimeError, ValueError, StopIteration) as error:  # the last three: an invalid address
        said = "no answer in time" if isinstance(error, TimeoutError) else getattr(error, "strerror", None) or error
        raise NotHeldOff(f"logind cannot be asked over D-Bus: {said}") from error


class _Bus:
    """One connection to a bus, with a timeout for every step."""

    def __init__(self, connection: socket.socket, limit_s: float) -> None:
        from jeepney import Parser  # noqa: PLC0415 - only where sleep is inhibited

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
        """Return a function that sets the connection's timeout to the time left, or raises TimeoutError if none is."""
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


_HINT = (
    "log in at this machine (logind refuses users from afar), or name a command that holds it awake in hil.toml: "
    '[hardware] inhibitor = ["command", "argument"]'
)
_COMMAND_HINT = (
    "the command of [hardware] inhibitor writes one line once it holds off sleep and shutdown, and holds until its "
    "standard input ends"
)
_LONGEST_LINE = 4096


class Inhibitor:
    """Inhibits sleep and shutdown from `take` on, until it is closed or the last copy of its descriptor is.

    Taking it twice has no further effect. It is released with its process, however that ends, unless another one, such
    as the guardian, was passed the descriptor.

    Args:
        why: what the machine is busy with, for anyone who asks it to sleep.
        command: inhibits in place of logind; it writes a line once it does, and stops when its standard input ends.
        limit_s: timeout of each answer [s].
    """

    def __init__(self, why: str, command: Sequence[str] = (), limit_s: float = _LIMIT_S) -> None:
        self._why = why
        self._command = tuple(command)
        self._limit_s = limit_s
        self._process: subprocess.Popen[bytes] | None = None
        self._descriptor: int | None = None

    def __enter__(self) -> Self:
        self.take()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def descriptor(self) -> int | None:
        """The descriptor that inhibits as long as any process has it open; None while nothing is inhibited."""
        return self._descriptor

    def take(self) -> None:
        """Inhibit sleep and shutdown, unless they already are.

        Raises:
            Refused: with why that is impossible here, and what to do.
        """
        if self._descriptor is not None and not self.lost():
            return
        self.close()
        try:
            self._descriptor = self._of_command() if self._command else hold_off(self._why, self._limit_s)
        except NotHeldOff as error:
            told = f"sleep and shutdown of this machine cannot be held off: {error}"
            raise Refused(told, _COMMAND_HINT if self._command else _HINT) from error

    def lost(self) -> str:
        """Return why sleep is no longer inhibited, empty while it is, and if it was never taken."""
        if self._process is not None and (code := self._process.poll()) is not None:
            return f"the command of [hardware] inhibitor ended with {code}"
        if self._descriptor is None:
            return ""
        looked = select.poll()
        looked.register(self._descriptor, 0)
        gone = any(events & (select.POLLERR | select.POLLHUP | select.POLLNVAL) for _, events in looked.poll(0))
        return "the inhibitor was released" if gone else ""

    def close(self) -> None:
        """Release it; closing twice is harmless."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            with suppress(OSError):
                os.close(descriptor)
        process, self._process = self._process, None
        if process is not None:
            _end(process, self._limit_s)

    def _of_command(self) -> int:
        reader, writer = os.pipe()
        try:
            self._process = subprocess.Popen(  # noqa: S603 - the workspace names it, and no shell reads it
                self._command,
                stdin=reader,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
            self._await_line(self._process)
        except (OSError, ValueError, NotHeldOff) as error:
            os.close(writer)
            self.close()
            raise NotHeldOff(f"{self._command[0]}: {getattr(error, 'strerror', None) or error}") from error
        finally:
            os.close(reader)
        return writer

    def _await_line(self, process: subprocess.Popen[bytes]) -> None:
        """Wait for the line by which the command reports that it inhibits."""
        if process.stdout is None:
            return
        end, heard = wall.monotonic() + self._limit_s, b""
        while b"\n" not in heard:
            left = end - wall.monotonic()
            if left <= 0 or not select.select([process.stdout], [], [], left)[0]:
                raise NotHeldOff(f"it wrote no line within {self._limit_s:g} s")
            if not (more := os.read(process.stdout.fileno(), _LONGEST_LINE)):
                raise NotHeldOff("it ended without a line")
            heard += more


def _end(process: subprocess.Popen[bytes], limit_s: float) -> None:
    """Wait for a command whose standard input has ended; if it does not end, kill it with its process group."""
    try:
        process.wait(limit_s)
    except subprocess.TimeoutExpired:
        with suppress(OSError):  # it may be ending by itself right now
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    if process.stdout is not None:
        process.stdout.close()
