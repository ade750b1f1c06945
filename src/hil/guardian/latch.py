"""Latches: files that keep a bench from being used until a named person has looked at it.

They survive a reboot, and every user of the host finds them. Each user writes files of its own. A file in a latch's
place that cannot be parsed counts as a latch: if in doubt, look at the bench.

Nothing ages below /var/lib, where the administrator has to create the folder. Until then they are below /var/tmp, where
systemd-tmpfiles removes what is older than 30 days. It skips files with the sticky bit (`dir_cleanup` in its
tmpfiles.c), which all latches have; to guard against other programs a run renews the latches of its bench.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import stat
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from hil.model.errors import Refused

__all__ = ["PLACES", "Latch", "clear", "latch_files", "may_clear", "path_of", "read", "share", "write", "write_whole"]

PLACES = (Path("/var/lib/hil/latches"), Path("/var/tmp/hil-latches"))  # noqa: S108 - the same for every user
"""Latches are written in the first that exists, or in the last, and looked for in all."""

_MOST_BYTES = 65_536
_FLAGS = os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK


@dataclass(frozen=True, slots=True, kw_only=True)
class Latch:
    """Why a bench is latched.

    Attributes:
        bench: its name.
        run: the folder of the run that the guardian ended.
        why: what the guardian found.
        since: when, UTC.
        outputs: the outputs that could not be proven safe.
    """

    bench: str
    run: str
    why: str
    since: str
    outputs: tuple[str, ...]


def path_of(key: str, folder: Path | None = None) -> Path:
    """Return the file with which this user latches the instrument of a lease's key; in `PLACES` unless in a folder."""
    place = folder or next((each for each in PLACES[:-1] if _takes_files(each)), PLACES[-1])
    return place / f"{_digest(key)}-{os.geteuid()}.latch"


def latch_files(key: str | None = None, folder: Path | None = None) -> list[Path]:
    """Return the files that may latch an instrument, whoever wrote them; all files if no key is given.

    A folder that cannot be read counts as one of them.
    """
    found: list[Path] = []
    for place in dict.fromkeys([folder] if folder else PLACES):
        try:
            names = sorted(entry.name for entry in os.scandir(place))
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError:
            found.append(place)
            continue
        ours = (name for name in names if name.endswith(".latch"))
        # Earlier versions had one file for all users, whose name ends after the key.
        found += [place / each for each in ours if key is None or each[:-6].partition("-")[0] == _digest(key)]
    return found


def _digest(key: str) -> str:
    return hashlib.sha256(key.encode()).hexdigest()[:24]


def _takes_files(folder: Path) -> bool:
    with suppress(OSError):
        return stat.S_ISDIR(folder.lstat().st_mode) and _may(folder, os.W_OK | os.X_OK)
    return False


def _may(path: Path, what: int) -> bool:
    return os.access(path, what, effective_ids=os.access in os.supports_effective_ids)


def share(folder: Path) -> None:
    """Make the folder, writable for every user.

    Raises:
        Refused: if it cannot be made or written.
    """
    try:
        with suppress(FileExistsError):
            folder.mkdir(parents=True)
            folder.chmod(0o1777)
        if not stat.S_ISDIR(folder.lstat().st_mode):
            raise NotADirectoryError(errno.ENOTDIR, "it is not a folder")
        if not _may(folder, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, "it is not writable")
    except OSError as error:
        raise Refused(
            f"cannot latch benches in {folder}: {error.strerror}", "check who owns it, and its permissions"
        ) from error


def write(path: Path, latch: Latch, *, alone: bool = False) -> None:
    """Write a latch, on disk before this returns; an existing one is replaced.

    Args:
        path: where it is.
        latch: what is written down.
        alone: whether only this user and root can clear it; for an existing latch this stays as it is.

    Raises:
        Refused: if the folder cannot be used.
        OSError: if it cannot be written.
    """
    share(path.parent)
    write_whole(path, json.dumps(asdict(latch)).encode(), 0o644 if alone else 0o666)
    _sync(path.parent)


def write_whole(path: Path, data: bytes, mode: int, *, lasting: bool = True) -> None:
    """Write a file of this user's in a shared folder; a link is not followed.

    Args:
        path: where it is.
        data: its whole content.
        mode: of a file that is new, or was empty; the sticky bit is added, so that it does not age.
        lasting: whether it must be on disk before this returns.

    Raises:
        OSError: if it cannot be written.
    """
    file = _opened_to_write(path)
    try:
        status = os.fstat(file)
        if status.st_uid != os.geteuid():
            raise PermissionError(errno.EPERM, "it belongs to another user", str(path))
        if not status.st_size:
            os.fchmod(file, mode | stat.S_ISVTX)
        os.pwrite(file, data, 0)
        os.ftruncate(file, len(data))  # after the write, so that the file is never empty
        if lasting:
            os.fsync(file)
    finally:
        os.close(file)


def read(path: Path) -> Latch | None:
    """Return the latch, None if there is none."""
    try:
        file = os.open(path, os.O_RDONLY | _FLAGS)
    except FileNotFoundError:
        return None
    except OSError as error:
        return _unreadable(path, str(error.strerror))
    try:
        if not stat.S_ISREG(os.fstat(file).st_mode):
            return _unreadable(path, "it is not a file")
        data = os.pread(file, _MOST_BYTES, 0)
    except OSError as error:
        return _unreadable(path, str(error.strerror))
    finally:
        os.close(file)
    return _parsed(path, data) if data else None


def clear(path: Path) -> None:
    """Remove the latch, if there is one.

    Raises:
        Refused: if it cannot be removed.
    """
    try:
        if stat.S_ISREG(path.lstat().st_mode):
            _empty(path)
        with suppress(PermissionError):  # in a shared folder only its owner removes a file; an empty one is no latch
            path.unlink()
        _sync(path.parent)
        left = read(path)
    except FileNotFoundError:
        return
    except OSError as error:
        raise _stays(path, str(error.strerror)) from error
    if left is not None:
        raise _stays(path, "it belongs to another user")


def may_clear(path: Path) -> bool:
    """Return whether this user can clear a latch; True if it is gone."""
    try:
        mine = path.lstat().st_uid == os.geteuid()
    except OSError:
        return True
    return mine or _may(path, os.W_OK)


def _stays(path: Path, why: str) -> Refused:
    return Refused(f"cannot remove the latch {path}: {why}", "ask its owner, or remove it as root")


def _empty(path: Path) -> None:
    file = os.open(path, os.O_RDWR | _FLAGS)
    try:
        os.ftruncate(file, 0)
        os.fsync(file)
    finally:
        os.close(file)


def _opened_to_write(path: Path) -> int:
    """Open for every user; in a shared folder another user's file opens only without O_CREAT."""
    try:
        file = os.open(path, os.O_RDWR | _FLAGS)
    except FileNotFoundError:
        file = os.open(path, os.O_RDWR | os.O_CREAT | _FLAGS, 0o600)
    if not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise OSError(errno.EINVAL, "the latch's path is not a file", str(path))
    return file


def _sync(folder: Path) -> None:
    file = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(file)
    finally:
        os.close(file)


def _parsed(path: Path, data: bytes) -> Latch:
    try:
        fields = json.loads(data)
        words = {name: str(fields[name]) for name in ("bench", "run", "why", "since")}
        return Latch(**words, outputs=tuple(str(each) for each in fields["outputs"]))
    except (ValueError, KeyError, TypeError):
        return _unreadable(path, "it is damaged")


def _unreadable(path: Path, why: str) -> Latch:
    return Latch(bench="", run="", why=f"cannot read the latch {path}: {why}", since="", outputs=())
