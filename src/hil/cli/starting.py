"""How the process of a run is started: with the pinned environment, or detached, with a log beside its package."""

from __future__ import annotations

import os
import secrets
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import click

from hil.cli.run_names import shown
from hil.cli.supervision import ONLOOKER

__all__ = ["detach", "pin"]

_INTERNAL = 3


def detach(arguments: Sequence[str], place: Path) -> int:
    """Start `hil` with these arguments in a session of its own, and return once its run has begun.

    What it says goes into a log in `place`, named as the run's folder. A run that does not begin is waited for; what it
    said is said here, and its exit code returned.

    Args:
        arguments: the command line after `hil`.
        place: where the package goes.
    """
    new = not place.exists()
    place.mkdir(parents=True, exist_ok=True)
    log = place / f".detached-{secrets.token_hex(6)}.log"
    process, reader = _started(arguments, log)
    folder = _begun(process, reader)
    if folder is not None:
        named = folder.with_name(f"{folder.name}.log")
        log.replace(named)
        click.echo(f"log  {shown(named)}")
        click.echo(shown(folder))
        return 0
    code = process.wait()
    with suppress(OSError, ValueError):
        sys.stderr.write(log.read_text(encoding="utf-8", errors="replace"))
    log.unlink(missing_ok=True)
    with suppress(OSError):  # it is not empty where something else came in the meantime
        if new:
            place.rmdir()
    return code if code >= 0 else _INTERNAL


def pin() -> None:
    """Replace this process by itself with the pinned environment, unless it has it.

    Modules that happen to lie in the present folder do not take part, as they do not for the `hil` script.
    """
    from hil.executive.setup.pins import PINNED, pinned_environment  # noqa: PLC0415 - only when cases run

    if any(os.environ.get(name) != value for name, value in PINNED.items()):
        sys.stdout.flush()
        os.execve(sys.executable, [sys.executable, "-P", "-m", "hil.cli", *sys.argv[1:]], pinned_environment())  # noqa: S606


def _started(arguments: Sequence[str], log: Path) -> tuple[subprocess.Popen[bytes], int]:
    """Return the process, and the end of the pipe on which it reports its run's folder."""
    reader, writer = os.pipe()
    with log.open("xb") as output:
        process = subprocess.Popen(  # noqa: S603 - ourselves
            [sys.executable, "-P", "-m", "hil.cli", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            env={**os.environ, ONLOOKER: str(writer)},
            pass_fds=[writer],
            start_new_session=True,
        )
    os.close(writer)
    return process, reader


def _begun(process: subprocess.Popen[bytes], reader: int) -> Path | None:
    """Return the run's folder, None if the run ended before it had one; Ctrl-C stops the run."""
    told = b""
    with os.fdopen(reader, "rb") as stream:
        while True:
            try:
                told += stream.read()
                return Path(os.fsdecode(told)) if told else None
            except KeyboardInterrupt:
                process.send_signal(signal.SIGTERM)
