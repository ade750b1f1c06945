"""Leases: one executive per instrument, host-wide."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections.abc import Sequence
from pathlib import Path

from hil.clock import wall
from hil.model.errors import Refused

__all__ = ["Lease", "holds_a_lease"]

_FOLDER = Path("/tmp/hil-leases")  # noqa: S108 - the same for every user, whatever TMPDIR says; see _open and _share


class Lease:
    """Holds instruments for one run, until released or until its process ends, however that happens.

    The operating system's file locks do the work, so that a dead process blocks nobody.

    Args:
        keys: what is held, such as the port of an instrument or the folder of a simulated bench.
        holder: who holds it, for the message that another executive gets.
        folder: where the lock files live; the same for every user of the host.
    """

    def __init__(self, keys: Sequence[str], holder: str, folder: Path | None = None) -> None:
        self._folder = folder or _FOLDER
        self._files: list[int] = []
        self._note = {"holder": holder, "pid": os.getpid(), "since": wall.utc_now(), "run": ""}
        try:
            _share(self._folder)
            for key in sorted(set(keys)):
                self._take(key)
        except Refused:
            self.release()
            raise
        except OSError as error:
            self.release()
            raise Refused(
                f"leases in {self._folder} cannot be taken: {error.strerror}", "check who owns it, and its permissions"
            ) from error

    @property
    def descriptors(self) -> list[int]:
        """The open files; a lease is held as long as any process has its file open."""
        return list(self._files)

    def name(self, run: str) -> None:
        """Tell others the name of the run, once it has one."""
        self._note["run"] = run
        for file in self._files:
            self._write(file)

    def release(self) -> None:
        """Let go of everything; releasing twice is harmless."""
        while self._files:
            os.close(self._files.pop())

    def _take(self, key: str) -> None:
        path = self._folder / f"{hashlib.sha256(key.encode()).hexdigest()[:24]}.lease"
        file = _open(path)
        self._files.append(file)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise _held(key, file) from None
        self._write(file)

    def _write(self, file: int) -> None:
        os.ftruncate(file, 0)
        os.pwrite(file, json.dumps(self._note).encode(), 0)


def holds_a_lease(run: str, folder: Path | None = None) -> bool:
    """Return whether any process still holds what a run, given by its name, had leased: its own, or its guardian."""
    place = folder or _FOLDER
    return any(_is_held(path, run) for path in (place.glob("*.lease") if place.is_dir() else ()))


def _is_held(path: Path, run: str) -> bool:
    try:
        file = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
    except OSError:
        return False
    try:
        if json.loads(os.pread(file, 4096, 0))["run"] != run:
            return False
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except (OSError, ValueError, KeyError, TypeError):
        return False
    finally:
        os.close(file)
    return False


def _share(folder: Path) -> None:
    """Make the folder so that every user can take leases in it, whatever this one's umask is."""
    try:
        folder.mkdir(parents=True)
    except FileExistsError:
        return
    folder.chmod(0o1777)


def _open(path: Path) -> int:
    """Open a lease's file for every user.

    In a folder that everybody can write to, the kernel opens another user's file only where nobody asks
    to create it (`fs.protected_regular`).
    """
    flags = os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW
    try:
        return os.open(path, flags)
    except FileNotFoundError:
        file = os.open(path, flags | os.O_CREAT)
    os.fchmod(file, 0o666)
    return file


def _held(key: str, file: int) -> Refused:
    """Return the refusal that says who holds the lease, since when, and what to do."""
    try:
        note = json.loads(os.pread(file, 4096, 0))
        holder, since, run = f"{note['holder']} (process {note['pid']})", note["since"], note["run"]
    except (ValueError, KeyError, TypeError):
        return Refused(f"{key} is held by another run", "wait for it to end, or stop it: 'hil runs' tells its name")
    if not run:
        return Refused(f"{key} is held by {holder} since {since}", "wait for it to end")
    return Refused(
        f"{key} is held by {holder} since {since}, as {run}",
        f"wait for it to end, look at it with 'hil status {run}', or end it with 'hil stop {run}'",
    )
