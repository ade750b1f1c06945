"""What an audit found earlier in files that did not change since, so that it need not read them again.

A package is known again by path, size, inode, and the times of content and inode of every file in it, to the
nanosecond, and by the version of the product. Nobody but the administrator of a machine can set the time of an inode,
so that a file that was changed and set back is read again. The cache is kept in the user's own folder, never beside
the packages, so that nobody who hands over packages hands over what is believed of them.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

import msgspec

import hil
from hil.audit.inputs import Asked, Package
from hil.evidence.durable import write_whole
from hil.evidence.package.listing import list_folder

__all__ = ["Cache", "cache_folder", "product_key"]

_Kept = TypeVar("_Kept")


def cache_folder() -> Path:
    """Return the user's folder for what can be computed again."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "hil" / "audit"


def product_key() -> str:
    """Return what identifies the code of the product: whatever of it changes, everything is computed again."""
    root = Path(hil.__file__).parent
    content = hashlib.sha256()
    for file in sorted(root.rglob("*.py")):
        its = file.stat()
        content.update(f"{file} {its.st_size} {its.st_mtime_ns}\n".encode(errors="surrogateescape"))
    return content.hexdigest()


class Cache:
    """What is known of packages and of files of requirements.

    Args:
        place: the folder where it is kept; None keeps nothing and knows nothing.
        version: what identifies the product that computes it.
    """

    def __init__(self, place: Path | None, version: str) -> None:
        self._place = place
        self._version = version

    def package(self, folder: Path, read: Callable[[], Package]) -> Package:
        """Return what a package says, read again unless no file of it changed; one that is not whole is always read."""
        before = self._key_of(folder)
        known = self._get(before, Package)
        if known is not None:
            return known
        found = read()
        if found.sealed and self._key_of(folder) == before:  # else it changed while it was read
            self._put(before, found)
        return found

    def requirements(self, files: tuple[bytes, ...], read: Callable[[], tuple[Asked, ...]]) -> tuple[Asked, ...]:
        """Return the requirements that files of these contents hold, read again unless they were read before."""
        content = hashlib.sha256(self._version.encode())
        for data in files:
            content.update(b"%d " % len(data) + data)
        key = content.hexdigest()
        known = self._get(key, tuple[Asked, ...])
        if known is None:
            known = read()
            self._put(key, known)
        return known

    def _key_of(self, folder: Path) -> str:
        """Return what a package is known again by; empty where something in it cannot be looked at."""
        if self._place is None:
            return ""
        listing = list_folder(folder)
        content = hashlib.sha256(f"{self._version}\0{folder.resolve()}\0".encode(errors="surrogateescape"))
        if listing.odd or listing.empty:
            return ""
        try:
            for path in listing.files:
                its = (folder / path).lstat()
                told = f"{path}\0{its.st_size} {its.st_mtime_ns} {its.st_ctime_ns} {its.st_ino} {its.st_dev}\0"
                content.update(told.encode(errors="surrogateescape"))
        except OSError:
            return ""
        return content.hexdigest()

    def _get(self, key: str, kind: type[_Kept]) -> _Kept | None:
        if self._place is None or not key:
            return None
        try:
            return msgspec.msgpack.decode((self._place / key).read_bytes(), type=kind)
        except (OSError, msgspec.MsgspecError):
            return None

    def _put(self, key: str, found: object) -> None:
        if self._place is None or not key:
            return
        with suppress(OSError):  # it is a convenience: without it the next audit takes as long as this one
            self._place.mkdir(mode=0o700, parents=True, exist_ok=True)
            write_whole(self._place / key, msgspec.msgpack.encode(found))
