"""Leases: one executive per instrument, host-wide."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

from hil.model.errors import Refused

__all__ = ["Lease"]


class Lease:
    """Holds instruments for one run, until released or until its process ends, however that happens.

    The operating system's file locks do the work, so that a dead process blocks nobody.

    Args:
        keys: what is held, such as the port of an instrument or the folder of a simulated bench.
        holder: who holds it, for the message that another executive gets.
        folder: where the lock files live; the same for every user of the host.
    """

    def __init__(self, keys: Sequence[str], holder: str, folder: Path | None = None) -> None:
        self._folder = folder or Path(tempfile.gettempdir()) / "hil-leases"
        self._files: list[int] = []
        self._folder.mkdir(mode=0o1777, parents=True, exist_ok=True)
        try:
            for key in sorted(set(keys)):
                self._take(key, holder)
        except Refused:
            self.release()
            raise

    def release(self) -> None:
        """Let go of everything; releasing twice is harmless."""
        while self._files:
            os.close(self._files.pop())

    def _take(self, key: str, holder: str) -> None:
        path = self._folder / f"{hashlib.sha256(key.encode()).hexdigest()[:24]}.lease"
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            other = _holder(file)
            os.close(file)
            raise Refused(
                f"{key} is held by {other}", "wait for it to end, or stop it: 'hil runs' tells its name"
            ) from None
        os.ftruncate(file, 0)
        os.pwrite(file, json.dumps({"holder": holder, "pid": os.getpid()}).encode(), 0)
        self._files.append(file)


def _holder(file: int) -> str:
    try:
        note = json.loads(os.pread(file, 4096, 0))
        return f"{note['holder']} (process {note['pid']})"
    except (ValueError, KeyError, TypeError):
        return "another run"
