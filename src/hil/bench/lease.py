"""Leases and latches: one executive per instrument, host-wide, and none on a latched bench."""

from __future__ import annotations

import errno
import fcntl
import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from hil.clock import wall
from hil.guardian.latch import Latch, clear, latch_files, may_clear, path_of, read, write, write_whole
from hil.model.errors import Refused
from hil.wire.held_names import Holder, hold_name, holder_of, keepers_of, names_held, short, user_name

__all__ = [
    "Lease",
    "ack_line",
    "clear_latches_of",
    "holds_a_lease",
    "keep_latched",
    "keepers_of_run",
    "latch_bench",
    "latch_unsafe_end",
    "latches_of",
    "refuse_latched",
    "require_clearable",
]

_FOLDER = Path("/tmp/hil-leases")  # noqa: S108 - the same for every user, whatever TMPDIR says; see _note_of and _share
_MOST_BYTES = 4096


class Lease:
    """Holds instruments for one run, until released or until its process ends, however that happens.

    The kernel keeps the lease, so nobody can take it away, no file's age matters, and a dead process blocks nobody.
    A note names the holder and the time; without one, what the kernel knows is reported.

    Args:
        keys: what is held, such as the port of an instrument or the folder of a simulated bench.
        holder: who holds it, for the message that another executive gets.
        folder: where the notes are; leases with notes in different folders do not know each other.

    Raises:
        Refused: if somebody else holds one of them.
    """

    def __init__(self, keys: Sequence[str], holder: str, folder: Path | None = None) -> None:
        self._folder = folder or _FOLDER
        self._held: list[int] = []
        self._notes: set[Path] = set()
        self._keys = sorted(set(keys))
        self._note = {"holder": holder, "pid": os.getpid(), "since": wall.utc_now(), "run": ""}
        try:
            for key in self._keys:
                self._take(key)
        except BaseException:
            self.release()
            raise
        self._publish()

    @property
    def descriptors(self) -> list[int]:
        """Descriptors of the leases; each is held as long as any process has its descriptor open."""
        return list(self._held)

    def name(self, run: str) -> None:
        """Publish the name of the run, once it has one."""
        self._note["run"] = run
        with suppress(OSError):  # a guardian that is about to end may still have it
            self._held.append(hold_name(_name_of_run(run, self._folder)))
        self._publish()

    def release(self) -> None:
        """Release everything; releasing twice is harmless."""
        while self._held:
            os.close(self._held.pop())
        for key in self._keys:  # a guardian that is still at work keeps its leases, and their notes
            holder = holder_of(_name(key, self._folder))
            path = _note_of(key, self._folder)
            if path in self._notes and (holder is None or holder.pid != os.getpid()):
                _remove_note(path)
        self._notes.clear()

    def _take(self, key: str) -> None:
        _require_not_locked(key, self._folder)
        try:
            self._held.append(hold_name(_name(key, self._folder)))
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise _held(key, self._folder) from None
            hint = "see whether this process may open sockets, and how many files"
            raise Refused(f"the lease of {key} cannot be taken: {error.strerror}", hint) from error

    def _publish(self) -> None:
        """Write the notes of who holds what, readable for every user; they inform people, nothing depends on them."""
        with suppress(OSError):
            _share(self._folder)
        for key in self._keys:
            with suppress(OSError):
                path = _note_of(key, self._folder)
                write_whole(path, json.dumps(self._note).encode(), 0o644, lasting=False)
                self._notes.add(path)


def holds_a_lease(run: str, folder: Path | None = None) -> bool:
    """Return whether any process, the run's own or its guardian, still holds a lease of a run given by its name."""
    place = folder or _FOLDER
    name = _name_of_run(run, place)
    if name in names_held(name) or holder_of(name) is not None:
        return True
    return any(_is_locked(path, run) for path in (place.glob("*.lease") if place.is_dir() else ()))


def keepers_of_run(run: str, folder: Path | None = None) -> str:
    """Return the processes that still hold a lease of a run given by its name, in words for a message."""
    return _named(_name_of_run(run, folder or _FOLDER))


def _named(name: str) -> str:
    """Return which processes have a name open, and how to continue a stopped one; empty if none is seen."""
    told = [
        f"{pid}, stopped: 'kill -CONT {pid}' lets it go on" if stopped else str(pid)
        for pid, stopped in keepers_of(name).items()
    ]
    return f" (process {' and '.join(told)})" if told else ""


def _name(key: str, folder: Path) -> str:
    return f"lease-{short(f'{folder}:{key}')}"


def _name_of_run(run: str, folder: Path) -> str:
    return f"run-{short(f'{folder}:{Path(run).name}')}"


def _note_of(key: str, folder: Path, uid: int | None = None) -> Path:
    """Return the path of a user's note about a lease, where nobody else can write."""
    return folder / f"{short(key)}-{os.geteuid() if uid is None else uid}.note"


def _share(folder: Path) -> None:
    """Create the folder so that every user can write notes in it, whatever this one's umask is."""
    try:
        folder.mkdir(parents=True)
    except FileExistsError:
        return
    folder.chmod(0o1777)


def _held(key: str, folder: Path) -> Refused:
    """Return the refusal that says who holds the lease, since when, and what to do."""
    holder = holder_of(_name(key, folder))
    if holder is None:
        return _refusal(key, {})
    note = _read_note(_note_of(key, folder, holder.uid), holder)
    ended = "" if holder.lives else f", which has ended: its guardian{_named(_name(key, folder))} is still at work"
    return _refusal(key, note, f"process {holder.pid} of user {holder.user}{ended}", ended=not holder.lives)


def _read_note(path: Path, holder: Holder) -> Mapping[str, object]:
    """Return the holder's note; one by another user or an earlier process is ignored."""
    try:
        file = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
        try:
            note = json.loads(os.pread(file, _MOST_BYTES, 0)) if os.fstat(file).st_uid == holder.uid else {}
        finally:
            os.close(file)
    except (OSError, ValueError):
        return {}
    return note if isinstance(note, dict) and note.get("pid") == holder.pid else {}


def _remove_note(path: Path) -> None:
    """Remove this process's note, and not that of the next holder, which writes as soon as it has the lease."""
    with suppress(OSError, ValueError, LookupError, TypeError):
        if json.loads(path.read_bytes())["pid"] == os.getpid():
            path.unlink()


def _refusal(key: str, note: Mapping[str, object], process: str = "", *, ended: bool = False) -> Refused:
    who, since, run = (str(note.get(name, "")) for name in ("holder", "since", "run"))
    if not who:
        by = f" ({process})" if process else ""
        return Refused(f"{key} is held by another run{by}", "wait for it to end, or stop it: 'hil runs' shows its name")
    told = f"{key} is held by {who} ({process or 'process ' + str(note.get('pid'))}) since {since}"
    if not run:
        return Refused(told, "wait for it to end")
    if ended:
        return Refused(f"{told}, as {run}", f"see what it still does with 'hil status {run}'; {ack_line(run)} ends it")
    return Refused(
        f"{told}, as {run}", f"wait for it to end, see it with 'hil status {run}', or end it with 'hil stop {run}'"
    )


def _require_not_locked(key: str, folder: Path) -> None:
    """Require that no run of an earlier version holds a key: those lock one file per key."""
    path = folder / f"{short(key)}.lease"
    if _is_locked(path):
        try:
            note = json.loads(path.read_bytes())
        except (OSError, ValueError):
            note = {}
        raise _refusal(key, note if isinstance(note, dict) else {})


def _is_locked(path: Path, run: str = "") -> bool:
    try:
        file = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        if run and json.loads(os.pread(file, _MOST_BYTES, 0))["run"] != run:
            return False
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except (OSError, ValueError, KeyError, TypeError):
        return False
    finally:
        os.close(file)
    return False


def refuse_latched(leases: Sequence[str], folder: Path | None = None) -> None:
    """Refuse to drive what is latched; call it with the leases held, so that no guardian is about to latch it.

    Args:
        leases: what the run or visit holds alone.
        folder: the folder of latches; by default this machine's.

    Raises:
        Refused: with who latched it, when, why, and which outputs it is about.
    """
    for path in (path for lease in sorted(set(leases)) for path in latch_files(lease, folder)):
        latch = read(path)
        if latch is not None and not latch.run:
            raise Refused(f"the bench is latched: {latch.why}", f"check the bench, then remove {path}")
        if latch is not None:
            outputs = f"; not proven safe: {', '.join(latch.outputs)}" if latch.outputs else ""
            raise Refused(
                f"bench '{latch.bench}' is latched since {latch.since} by {latch.run}{_of_user(path)}:"
                f" {latch.why}{outputs}",
                f"check the bench, then: {ack_line(latch.run)}",
            )


def latch_bench(leases: Sequence[str], latch: Latch, folder: Path | None = None, *, alone: bool = False) -> None:
    """Latch all that a run holds, such as one that could not prove its bench safe.

    Args:
        leases: what the run holds alone.
        latch: what is written down.
        folder: the folder of latches; by default this machine's.
        alone: whether only this user and root can remove the latches.

    Raises:
        Refused: if the folder of latches is not as it has to be.
        OSError: if a latch cannot be written.
    """
    for lease in sorted(set(leases)):
        write(path_of(lease, folder), latch, alone=alone)


def keep_latched(leases: Sequence[str], latch: Latch, folder: Path | None = None, *, alone: bool = False) -> None:
    """Renew the latches of an armed bench, and restore those that were removed; see `latch_bench`.

    A program that cleans up files unused for some weeks then finds them fresh.
    """
    for lease in sorted(set(leases)):
        path = path_of(lease, folder)
        if read(path) is None:
            write(path, latch, alone=alone)
        else:
            os.utime(path, follow_symlinks=False)


def latch_unsafe_end(
    leases: Sequence[str], *, bench: str, run: Path, why: str, folder: Path | None = None, alone: bool = False
) -> None:
    """Latch the leases of a run that could not prove its bench safe; a latch by its guardian stays as it is.

    Args:
        leases: what the run holds alone.
        bench: the bench's name.
        run: the run's folder.
        why: what was not safe.
        folder: the folder of latches; by default this machine's.
        alone: whether only this user and root can remove the latches.

    Raises:
        Refused, OSError: as `latch_bench`.
    """
    open_still = [lease for lease in leases if all(read(path) is None for path in latch_files(lease, folder))]
    told = Latch(bench=bench, run=str(run), why=why, since=wall.utc_now(), outputs=())
    latch_bench(open_still, told, folder, alone=alone)


def latches_of(run: str, folder: Path | None = None) -> dict[Path, Latch]:
    """Return the latches left by a run given by its path or name, by their files."""
    found = ((path, read(path)) for path in latch_files(None, folder))
    return {path: latch for path, latch in found if latch and latch.run and Path(latch.run).name == Path(run).name}


def require_clearable(latches: Mapping[Path, Latch]) -> None:
    """Require that this user may remove latches, before anything is written down.

    Raises:
        Refused: with the user to ask.
    """
    for path, latch in latches.items():
        if not may_clear(path):
            owner = user_name(path.lstat().st_uid)
            raise Refused(
                f"bench '{latch.bench}' was latched by user {owner}, and its file does not let others acknowledge that",
                f"ask {owner}" if owner == "root" else f"ask {owner}, or root",
            )


def clear_latches_of(run: str, folder: Path | None = None) -> tuple[Latch, ...]:
    """Remove every latch left by a run, and return them.

    Raises:
        Refused: if one cannot be removed; it is then still there.
    """
    found = latches_of(run, folder)
    for path in found:
        clear(path)
    return tuple(found.values())


def ack_line(run: str) -> str:
    """Return the command that acknowledges what happened in a run."""
    return f'hil ack {run} --by NAME --text "what was seen and done"'


def _of_user(path: Path) -> str:
    """Return the owner of a latch, if that is another user."""
    with suppress(OSError):
        uid = path.lstat().st_uid
        return "" if uid == os.geteuid() else f" of user {user_name(uid)}"
    return ""
