"""Incident log of the guardian: latches, its own journal, one line on standard error."""

from __future__ import annotations

import json
import os
import select
import time
from datetime import UTC, datetime
from pathlib import Path

from hil.guardian import latch
from hil.guardian.latch import Latch
from hil.model.errors import HilError
from hil.model.safing import GuardPlan

__all__ = ["IncidentLog", "utc_now"]

_STANDARD_ERROR = 2
_LONGEST_LINE = 1000
_SAYING_MS = 200
_SEAL = "bagit.txt"


class IncidentLog:
    """Keeps events in memory, and writes them once the outputs are off.

    Args:
        plan: names bench, run, latches and journal.

    Attributes:
        latched: a sentence that says whether the bench is latched.
    """

    def __init__(self, plan: GuardPlan) -> None:
        self._plan = plan
        self._lines: list[str] = []
        self._paths: set[str] = set()
        self._said = ""
        self._executive: int | None = None
        self.latched = "the bench could not be latched"

    def note(self, event: str, **fields: object) -> None:
        """Keep one event until it is saved."""
        now = {"utc": utc_now(), "boot": round(time.clock_gettime(time.CLOCK_BOOTTIME), 6)}
        self._lines.append(json.dumps({**now, "event": event, **fields}))

    def check(self) -> None:
        """Check that latches and journal can be written.

        Raises:
            HilError: if not.
        """
        for folder in {Path(path).parent for path in self._plan.latches}:
            latch.share(folder)
        if self._plan.journal and not os.access(Path(self._plan.journal).parent, os.W_OK | os.X_OK):
            raise HilError(f"the guardian cannot write its journal {self._plan.journal}")

    def latch(self, why: str, since: str, unproven: tuple[str, ...]) -> None:
        """Latch the bench, unless that was acknowledged; note once what is latched, and what cannot be."""
        if self.is_acknowledged():
            return
        entry = Latch(bench=self._plan.bench, run=self._plan.run, why=why, since=since, outputs=unproven)
        for path in self._plan.latches:
            try:
                latch.write(Path(path), entry)
            except (OSError, HilError) as error:
                self.note("not latched", path=path, why=str(error))
                continue
            if path not in self._paths:
                self._paths.add(path)
                self.note("latched", path=path)
            self.latched = "the bench is latched"

    def is_acknowledged(self) -> bool:
        """Return whether a latch that was written is gone: only a person removes one."""
        return any(Path(path).parent.is_dir() and latch.read(Path(path)) is None for path in self._paths)

    def save(self) -> None:
        """Append the events to the journal, on disk before this returns.

        Raises:
            OSError: if that is not possible; the events are kept.
        """
        if not self._plan.journal or self._waits():
            return
        file = os.open(self._plan.journal, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW, 0o644)
        try:
            left = memoryview("".join(f"{line}\n" for line in self._lines).encode())
            while left:
                left = left[os.write(file, left) :]
            os.fsync(file)
        finally:
            os.close(file)
        self._lines.clear()

    def wait_for(self, executive: int) -> None:
        """Write nothing while the executive lives, which may seal the folder; events are kept in memory until it ends.

        Args:
            executive: descriptor of its process.
        """
        self._executive = executive

    def _waits(self) -> bool:
        """Return whether the journal must not be written now; in a sealed folder it is never written again."""
        if (Path(self._plan.run) / _SEAL).exists():
            self._lines.clear()
            return True
        poll = select.poll()
        if self._executive is not None:
            poll.register(self._executive, select.POLLIN)
        return self._executive is not None and not poll.poll(0)

    def say(self, why: str, end: str) -> None:
        """Write one line on standard error, unless it was said before.

        Args:
            why: why the guardian acted.
            end: whether the outputs are safe.
        """
        if end != self._said:
            self._said = end
            _say(f"bench {self._plan.bench}: {why}; {end}; {self.latched} (run {self._plan.run})")


def utc_now() -> str:
    """Return the wall clock's UTC as ISO 8601 with microseconds and `Z`."""
    return datetime.now(UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")


def _say(text: str) -> None:
    """Write one line to standard error without waiting for a reader that is gone or stopped."""
    poll = select.poll()
    poll.register(_STANDARD_ERROR, select.POLLOUT)
    try:
        if poll.poll(_SAYING_MS):
            os.write(_STANDARD_ERROR, f"hil guardian: {text[:_LONGEST_LINE]}\n".encode())
    except OSError:
        return
