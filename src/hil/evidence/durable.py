"""Files that are on the disk once a function returns, and the SHA-256 of files."""

from __future__ import annotations

import errno
import hashlib
import os
from pathlib import Path

__all__ = ["DISK_FULL", "PART", "sha256_of", "sync_file", "sync_folder", "write_whole"]

DISK_FULL = frozenset({errno.ENOSPC, errno.EDQUOT})
"""The error numbers with which a file system says that nothing more fits."""

PART = ".part"
"""The ending of a file that is not whole yet."""


def write_whole(path: Path, data: bytes) -> None:
    """Write a file that is there whole or not at all, whenever the process or the machine ends."""
    part = path.with_name(path.name + PART)
    with part.open("wb") as stream:
        stream.write(data)
        stream.flush()
        os.fsync(stream.fileno())
    part.replace(path)
    sync_folder(path.parent)


def sync_file(path: Path) -> None:
    """Bring a file's content to the disk."""
    _sync(path, os.O_RDONLY)


def sync_folder(path: Path) -> None:
    """Bring a folder's names to the disk."""
    _sync(path, os.O_RDONLY | getattr(os, "O_DIRECTORY", 0))


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file's content, as hexadecimal digits."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _sync(path: Path, flags: int) -> None:
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
