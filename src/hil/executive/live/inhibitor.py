"""The inhibitor: this machine neither sleeps nor shuts down while a live bench is driven."""

from __future__ import annotations

import os
import select
import signal
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from types import TracebackType
from typing import Self

from hil.clock import wall
from hil.executive.live.logind import NotHeldOff, hold_off
from hil.model.errors import Refused

__all__ = ["Inhibitor"]

_HINT = (
    "log in at this machine (logind refuses users from afar), or name a command that holds it awake in hil.toml: "
    '[hardware] inhibitor = ["command", "argument"]'
)
_COMMAND_HINT = (
    "the command of [hardware] inhibitor writes one line once it holds off sleep and shutdown, and holds until its "
    "standard input ends"
)
_LIMIT_S = 1.0
_LONGEST_LINE = 4096


class Inhibitor:
    """Holds off sleep and shutdown from `take` on, until it is closed or the last copy of its descriptor is.

    Taken twice it is held once. It is let go of with its process, however that ends, unless another one, such as the
    guardian, was passed the descriptor.

    Args:
        why: what the machine is busy with, for whoever asks it to sleep.
        command: holds in the place of logind; it writes a line once it holds, until its standard input ends.
        limit_s: how long each answer may take [s].
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
        """What holds as long as any process has it open; None while nothing is held."""
        return self._descriptor

    def take(self) -> None:
        """Hold off sleep and shutdown, if they are not held off already.

        Raises:
            Refused: with why that cannot be done here, and what to do.
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
        """Return why nothing is held any more, empty while it is, and where nothing was taken."""
        if self._process is not None and (code := self._process.poll()) is not None:
            return f"the command of [hardware] inhibitor ended with {code}"
        if self._descriptor is None:
            return ""
        looked = select.poll()
        looked.register(self._descriptor, 0)
        gone = any(events & (select.POLLERR | select.POLLHUP | select.POLLNVAL) for _, events in looked.poll(0))
        return "whoever held it off let go" if gone else ""

    def close(self) -> None:
        """Let go; closing twice is harmless."""
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
            self._hear(self._process)
        except (OSError, ValueError, NotHeldOff) as error:
            os.close(writer)
            self.close()
            raise NotHeldOff(f"{self._command[0]}: {getattr(error, 'strerror', None) or error}") from error
        finally:
            os.close(reader)
        return writer

    def _hear(self, process: subprocess.Popen[bytes]) -> None:
        """Wait for the line with which the command says that it holds."""
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
    """Wait for a command whose standard input has ended; one that does not end by itself is killed with its own."""
    try:
        process.wait(limit_s)
    except subprocess.TimeoutExpired:
        with suppress(OSError):  # it may end by itself right now
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    if process.stdout is not None:
        process.stdout.close()
