"""Leases and latches: one executive per instrument, host-wide, and none if a bench was left by force."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from hil.clock import wall
from hil.guardian.latch import FOLDER, Latch, clear, path_of, read, write
from hil.model.errors import Refused

__all__ = [
    "Lease",
    "ack_line",
    "clear_latches_of",
    "holds_a_lease",
    "latch_bench",
    "latch_unsafe_end",
    "latches_of",
    "refuse_latched",
]

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
        """Publish the name of the run, once it has one."""
        self._note["run"] = run
        for file in self._files:
            self._write(file)

    def release(self) -> None:
        """Release everything; releasing twice is harmless."""
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
        return Refused(f"{key} is held by another run", "wait for it to end, or stop it: 'hil runs' shows its name")
    if not run:
        return Refused(f"{key} is held by {holder} since {since}", "wait for it to end")
    return Refused(
        f"{key} is held by {holder} since {since}, as {run}",
        f"wait for it to end, see it with 'hil status {run}', or end it with 'hil stop {run}'",
    )


def refuse_latched(leases: Sequence[str], folder: Path | None = None) -> None:
    """Refuse to drive what is latched; asked while the leases are held, so that no guardian is about to latch it.

    Args:
        leases: what the run or visit holds alone.
        folder: where latches are, those of this machine where None.

    Raises:
        Refused: with who latched it, when, why, and which outputs it is about.
    """
    for lease in sorted(set(leases)):
        path = path_of(lease, folder or FOLDER)
        latch = read(path)
        if latch is not None and not latch.run:
            raise Refused(f"the bench is latched: {latch.why}", f"check the bench, then remove {path}")
        if latch is not None:
            outputs = f"; not proven safe: {', '.join(latch.outputs)}" if latch.outputs else ""
            raise Refused(
                f"bench '{latch.bench}' is latched since {latch.since} by {latch.run}: {latch.why}{outputs}",
                f"check the bench, then: {ack_line(latch.run)}",
            )


def latch_bench(leases: Sequence[str], latch: Latch, folder: Path | None = None) -> None:
    """Latch all that a run holds, such as one that could not prove its bench safe.

    Raises:
        Refused: if the folder of latches is not as it has to be.
        OSError: if a latch cannot be written.
    """
    for lease in sorted(set(leases)):
        write(path_of(lease, folder or FOLDER), latch)


def latch_unsafe_end(leases: Sequence[str], *, bench: str, run: Path, why: str, folder: Path | None = None) -> None:
    """Latch what a run held that could not prove its bench safe; a latch that its guardian wrote stays as it is.

    Args:
        leases: what the run holds alone.
        bench: the bench's name.
        run: the run's folder.
        why: what was not safe.
        folder: where latches are, those of this machine where None.

    Raises:
        Refused, OSError: as `latch_bench`.
    """
    open_still = [lease for lease in leases if read(path_of(lease, folder or FOLDER)) is None]
    latch_bench(open_still, Latch(bench=bench, run=str(run), why=why, since=wall.utc_now(), outputs=()), folder)


def latches_of(run: str, folder: Path | None = None) -> dict[Path, Latch]:
    """Return the latches that a run, given by its path or name, has left, by their files."""
    return {path: latch for path, latch in _all(folder or FOLDER) if Path(latch.run).name == Path(run).name}


def clear_latches_of(run: str, folder: Path | None = None) -> tuple[Latch, ...]:
    """Remove every latch that a run has left, and return them.

    Raises:
        Refused: if one cannot be removed, which is then still there.
    """
    found = latches_of(run, folder)
    for path in found:
        clear(path)
    return tuple(found.values())


def ack_line(run: str) -> str:
    """Return the command that acknowledges what happened in a run."""
    return f'hil ack {run} --by NAME --text "what was seen and done"'


def _all(folder: Path) -> Iterator[tuple[Path, Latch]]:
    for path in sorted(folder.glob("*.latch")) if folder.is_dir() else ():
        latch = read(path)
        if latch is not None and latch.run:
            yield path, latch
