"""Vendors' drivers, each in a process of its own: one line of JSON calls an operation, another returns its result.

Like an instrument, the process outlives whoever started it, and listens as long as anyone has the other end of its
connection: the run, and the guardian with a copy of it. So the guardian's commands are executed even if the run hangs
or is dead, and neither of them has to load the vendor's code. This file is also the program.

It writes the files from which its code was executed into a file that only the run reads: what is asked over the
connection is recorded, and a replay would have to ask it again.
"""

from __future__ import annotations

import contextlib
import errno
import importlib
import json
import math
import os
import signal
import socket
import sys
from collections.abc import Callable, Iterator
from types import CodeType
from typing import Any

__all__ = ["connected_to", "files_executed"]

_SCHEME = "hosted://"
_STARTS_S = 10.0
_AT_ONCE = 65_536
_FILES = 3
"""The descriptor to which the process writes each file that it has executed code from, a line of JSON each."""

_written: list[int] = []
"""Descriptors of the files written by the processes that were started here."""


def files_executed() -> list[str]:
    """Return the files from which the processes that were started here have executed code, sorted."""
    found: set[str] = set()
    for descriptor in _written:
        text = os.pread(descriptor, os.fstat(descriptor).st_size, 0)
        found.update(json.loads(line) for line in text.split(b"\n")[:-1])
    return sorted(found)


def connected_to(url: str) -> int:
    """Start the process of a vendor's driver, and return the descriptor of its connection.

    Args:
        url: `hosted://module:name/place`: what makes the object, and its argument.

    Raises:
        OSError: if it does not start, or the vendor's driver cannot open the instrument.
    """
    made_by, _, place = url.removeprefix(_SCHEME).partition("/")
    mine, its = socket.socketpair()
    files = os.memfd_create("files executed")
    _written.append(files)
    with its:
        os.posix_spawn(  # nobody waits for its end
            sys.executable,
            [sys.executable, "-P", os.path.realpath(__file__), made_by, place],
            os.environ,
            file_actions=[
                (os.POSIX_SPAWN_DUP2, its.fileno(), 0),
                (os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0),
                (os.POSIX_SPAWN_DUP2, files, _FILES),
            ],
            setsid=True,
        )
    mine.settimeout(_STARTS_S)
    said = b""
    try:
        while not said.endswith(b"\n"):
            came = mine.recv(_AT_ONCE)
            if not came:
                break
            said += came
        outcome = json.loads(said or b'{"error":"its process ended"}')
    except OSError as error:
        mine.close()
        raise OSError(errno.ETIMEDOUT, f"{made_by} has not opened it after {_STARTS_S:g} s") from error
    if "error" in outcome:
        mine.close()
        raise OSError(errno.EIO, f"{made_by}: {outcome['error']}")
    mine.settimeout(None)
    return mine.detach()


def main(made_by: str, place: str) -> None:
    """Make the object and serve it until nobody has the other end any more; the outputs then stay as they are."""
    report_files = _file_reporter()
    descriptor = os.dup(0)
    os.dup2(1, 0)  # keep what the vendor's code reads or prints off the connection
    for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(each, signal.SIG_IGN)  # it ends with its clients
    with socket.socket(fileno=descriptor) as connection, contextlib.suppress(OSError):
        module, _, name = made_by.partition(":")
        try:
            made = getattr(importlib.import_module(module), name)(place)
            report_files()
        except Exception as error:  # noqa: BLE001 - whatever the vendor's driver raises is reported
            connection.sendall(_line({"error": _described(error)}))
            return
        connection.sendall(_line({"ready": True}))
        for line in _lines(connection):
            if reply := _answer(made, line):
                report_files()
                connection.sendall(_line(reply))
        with contextlib.suppress(Exception):
            made.close()


def _file_reporter() -> Callable[[], None]:
    """Return a function that writes down new files: those of loaded modules, and those from which code was executed."""
    heard: set[str] = {__file__}
    written: set[str] = set()
    seen = (0, 0)

    def hear(event: str, arguments: tuple[object, ...]) -> None:
        if event == "exec" and isinstance(arguments[0], CodeType):
            heard.add(arguments[0].co_filename)

    def report() -> None:
        nonlocal seen
        before, seen = seen, (len(heard), len(sys.modules))
        if seen == before:
            return
        loaded = {getattr(each, "__file__", None) for each in list(sys.modules.values())}
        files = {each for each in loaded | heard if isinstance(each, str) and os.path.isabs(each)}  # noqa: PTH117
        lines = [json.dumps(each) + "\n" for each in sorted(files - written)]
        written.update(files)
        if lines:
            os.write(_FILES, "".join(lines).encode())

    sys.addaudithook(hear)
    return report


def _lines(connection: socket.socket) -> Iterator[bytes]:
    ahead = b""
    while came := connection.recv(_AT_ONCE):
        *whole, ahead = (ahead + came).split(b"\n")
        yield from whole


def _answer(made: Any, line: bytes) -> dict[str, object]:  # noqa: ANN401 - the vendor's
    """Do what a line asks for; a fragment of a line, ended by another one, is skipped."""
    try:
        asked = json.loads(line)
        number, name = asked["number"], asked["call"]
        arguments, channel = asked.get("arguments", {}), asked.get("channel", 0)
    except (ValueError, LookupError, TypeError, AttributeError):
        return {}
    try:
        on = made.channel(channel) if channel else made
        return {"number": number, "result": _plain(getattr(on, name)(**arguments))}
    except (TimeoutError, ConnectionError) as error:
        return {"number": number, "silent": _described(error)}
    except Exception as error:  # noqa: BLE001 - whatever the vendor's driver raises is reported
        return {"number": number, "error": _described(error)}


def _described(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())


def _plain(value: Any) -> Any:  # noqa: ANN401 - whatever the vendor's driver returns
    """Return a result as JSON has it: NaN and infinity become null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(each) for each in value]
    return value


def _line(value: dict[str, object]) -> bytes:
    return json.dumps(value, sort_keys=True, separators=(",", ":"), default=float).encode() + b"\n"


if __name__ == "__main__":
    main(*sys.argv[1:])
