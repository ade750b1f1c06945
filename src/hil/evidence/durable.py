"""Durable writes, which are on disk when a function returns, and reads of regular files only."""

from __future__ import annotations

import errno
import hashlib
import os
import signal
import stat
import threading
from collections.abc import Callable
from functools import partial
from io import BufferedReader
from pathlib import Path

__all__ = [
    "DISK_FULL",
    "PART",
    "audibly",
    "open_plain",
    "read_plain",
    "sha256_of",
    "sync_file",
    "sync_folder",
    "sync_open",
    "write_whole",
]

DISK_FULL = frozenset({errno.ENOSPC, errno.EDQUOT})
"""The error numbers by which a file system reports that it is full."""

PART = ".part"
"""The suffix of a file that is not complete yet."""


def write_whole(path: Path, data: bytes) -> None:
    """Write a file atomically: it is there whole or not at all, whenever the process or the machine ends."""
    part = path.with_name(path.name + PART)
    with part.open("wb") as stream:
        stream.write(data)
        stream.flush()
        sync_open(stream.fileno())
    part.replace(path)
    sync_folder(path.parent)


def audibly(work: Callable[[], object]) -> None:
    """Do work that may block on a disk, and handle signals meanwhile if a timer runs, such as a run's heartbeat.

    A system call that waits for a disk is not interrupted, so it waits in a thread of its own, and the main thread,
    which handles signals, waits for that.

    Raises:
        Exception: what the work raises.
    """
    if not _alarm_rings() or threading.current_thread() is not threading.main_thread():
        work()
        return
    failed: list[Exception] = []

    def alone() -> None:
        try:
            work()
        except Exception as error:  # noqa: BLE001 - raised again below
            failed.append(error)

    thread = threading.Thread(target=alone, name="disk", daemon=True)
    thread.start()
    thread.join()
    if failed:
        raise failed[0]


def _alarm_rings() -> bool:
    return hasattr(signal, "getitimer") and signal.getitimer(signal.ITIMER_REAL)[0] > 0


def sync_open(descriptor: int) -> None:
    """Sync an open file to disk; see `audibly`.

    Raises:
        OSError: as `os.fsync`.
    """
    audibly(partial(os.fsync, descriptor))


def sync_file(path: Path) -> None:
    """Sync a file's content to disk."""
    _sync(path, os.O_RDONLY)


def sync_folder(path: Path) -> None:
    """Sync a folder's entries to disk."""
    _sync(path, os.O_RDONLY | getattr(os, "O_DIRECTORY", 0))


def open_plain(path: Path) -> BufferedReader:
    """Open a regular file for reading; a link, a pipe or a device is never read or waited for.

    Raises:
        OSError: if it is missing, is something else, or may not be read.
    """
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    try:
        descriptor = os.open(path, flags)
    except ValueError as error:  # not a valid file name
        raise OSError(errno.EINVAL, str(error)) from error
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(errno.EINVAL, "expected a regular file, found something else")
    return os.fdopen(descriptor, "rb")


def read_plain(path: Path, most: int = -1) -> bytes:
    """Return a regular file's content, of at most `most` bytes if that is given.

    Raises:
        OSError: if it cannot be opened, or is longer.
    """
    with open_plain(path) as stream:
        data = stream.read(most if most < 0 else most + 1)
    if 0 <= most < len(data):
        raise OSError(errno.EFBIG, f"it has more than {most} bytes")
    return data


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a regular file's content, as hexadecimal digits.

    Raises:
        OSError: as `open_plain`.
    """
    with open_plain(path) as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _sync(path: Path, flags: int) -> None:
    descriptor = os.open(path, flags)
    try:
        sync_open(descriptor)
    finally:
        os.close(descriptor)
