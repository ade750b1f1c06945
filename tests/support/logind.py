"""A private D-Bus and a small logind on it, which hands out descriptors and tells when they were let go."""

from __future__ import annotations

import os
import select
import shutil
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from jeepney import DBusAddress, message_bus, new_error, new_method_call, new_method_return
from jeepney.io.blocking import Proxy, open_dbus_connection

__all__ = ["ANSWERS", "Logind", "private_bus", "serving_logind"]

ANSWERS = ("hold", "refuse", "silence", "nonsense")

_CONFIGURATION = """\
<!DOCTYPE busconfig PUBLIC "-//freedesktop//DTD D-Bus Bus Configuration 1.0//EN"
 "http://www.freedesktop.org/standards/dbus/1.0/busconfig.dtd">
<busconfig>
  <type>system</type>
  <listen>unix:path={socket}</listen>
  <auth>EXTERNAL</auth>
  <policy context="default"><allow send_destination="*"/><allow receive_sender="*"/><allow own="*"/></policy>
</busconfig>
"""
_PATIENCE_S = 20


class Logind:
    """What the small logind was asked for, and which of its holds somebody still has."""

    def __init__(self, answer: str) -> None:
        self.answer = answer
        self.asked: list[tuple[str, ...]] = []
        self._held: list[int] = []

    def holds(self) -> int:
        """Return how many of the descriptors it gave are open somewhere."""
        return sum(not select.select([reader], [], [], 0)[0] for reader in self._held)

    def let_go(self, seconds: float = _PATIENCE_S) -> bool:
        """Return whether the newest descriptor is closed everywhere within this time."""
        return bool(select.select([self._held[-1]], [], [], seconds)[0])

    def drop(self) -> None:
        """End every hold from this side, as a logind that is started over without its memory."""
        while self._held:
            os.close(self._held.pop())

    def reply(self, message):
        """Return what is answered to one call, None for nothing."""
        self.asked.append(message.body)
        if self.answer == "silence":
            return None
        if self.answer == "refuse":
            return new_error(message, "org.freedesktop.DBus.Error.AccessDenied", "s", ("Permission denied",))
        if self.answer == "nonsense":
            return new_method_return(message, "s", ("held",))
        reader, writer = os.pipe()
        self._held.append(reader)
        return new_method_return(message, "h", (os.fdopen(writer, "wb", buffering=0),))


@contextmanager
def private_bus(folder: Path) -> Iterator[str]:
    """Give the address of a D-Bus of our own."""
    program = shutil.which("dbus-daemon")
    if program is None:
        pytest.skip("there is no dbus-daemon here: the Debian package of this name has it")
    (folder / "bus.conf").write_text(_CONFIGURATION.format(socket=folder / "bus"), encoding="ascii")
    daemon = subprocess.Popen(
        [program, f"--config-file={folder / 'bus.conf'}", "--nofork", "--nopidfile", "--print-address"],
        stdout=subprocess.PIPE,
    )
    try:
        yield daemon.stdout.readline().decode().strip()
    finally:
        daemon.terminate()
        daemon.wait()
        daemon.stdout.close()


@contextmanager
def serving_logind(address: str, answer: str = "hold") -> Iterator[Logind]:
    """Serve `Inhibit` on a bus until the context is left."""
    logind = Logind(answer)
    with open_dbus_connection(address, enable_fds=True) as connection:
        Proxy(message_bus, connection, timeout=_PATIENCE_S).RequestName("org.freedesktop.login1")
        turns = threading.Thread(target=_serve, args=(connection, logind))
        turns.start()
        try:
            yield logind
        finally:
            _end(address)
            turns.join()
            logind.drop()


def _serve(connection, logind: Logind) -> None:
    while True:
        message = connection.receive(timeout=_PATIENCE_S)
        if message.header.message_type.name != "method_call":
            continue
        if message.body == ():
            return
        answer = logind.reply(message)
        if answer is not None:
            connection.send(answer)
            for given in answer.body:
                if hasattr(given, "close"):
                    given.close()


def _end(address: str) -> None:
    """Call something without arguments, which ends the turns."""
    here = DBusAddress("/org/freedesktop/login1", "org.freedesktop.login1", "org.freedesktop.login1.Manager")
    with open_dbus_connection(address) as connection:
        connection.send(new_method_call(here, "End"))
