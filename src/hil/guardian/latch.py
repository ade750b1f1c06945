"""Latches: files that keep a bench from being used until a named person has looked at it.

They survive a reboot, and are shared by all users of the host, as leases are. A file in a latch's
place that cannot be read as one counts as a latch: in doubt, look at the bench.
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

__all__ = ["FOLDER", "Latch", "clear", "path_of", "read", "share", "write"]

FOLDER = Path("/var/tmp/hil-latches")  # noqa: S108 - the same for every user, and kept over a reboot
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
    """Return the path of an instrument's latch, by the key of its lease; in `FOLDER` unless another is named."""
    return (folder or FOLDER) / f"{hashlib.sha256(key.encode()).hexdigest()[:24]}.latch"


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
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, "it is not writable")
    except OSError as error:
        raise Refused(
            f"cannot latch benches in {folder}: {error.strerror}", "check who owns it, and its permissions"
        ) from error


def write(path: Path, latch: Latch) -> None:
    """Write a latch, on disk before this returns. One that is there already is replaced.

    Raises:
        Refused: if the folder cannot be used.
        OSError: if it cannot be written.
    """
    share(path.parent)
    file = _opened_to_write(path)
    try:
        data = json.dumps(asdict(latch)).encode()
        os.pwrite(file, data, 0)
        os.ftruncate(file, len(data))  # after the write, so that the file is never empty
        os.fsync(file)
    finally:
        os.close(file)
    _sync(path.parent)


def read(path: Path) -> Latch | None:
    """Return the latch, None where there is none."""
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
    return _told(path, data) if data else None


def clear(path: Path) -> None:
    """Remove the latch; nothing happens where there is none.

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
        file = os.open(path, os.O_RDWR | os.O_CREAT | _FLAGS)
        os.fchmod(file, 0o666)
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


def _told(path: Path, data: bytes) -> Latch:
    try:
        told = json.loads(data)
        words = {name: str(told[name]) for name in ("bench", "run", "why", "since")}
        return Latch(**words, outputs=tuple(str(each) for each in told["outputs"]))
    except (ValueError, KeyError, TypeError):
        return _unreadable(path, "it is damaged")


def _unreadable(path: Path, why: str) -> Latch:
    return Latch(bench="", run="", why=f"cannot read the latch {path}: {why}", since="", outputs=())
