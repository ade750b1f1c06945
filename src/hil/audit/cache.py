"""Earlier results of an audit for files that have not changed since, see `hil.evidence.unchanged`."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

import msgspec

from hil.audit.inputs import Asked, Package
from hil.evidence.durable import write_whole
from hil.evidence.unchanged import folder_key

__all__ = ["Cache"]

_Kept = TypeVar("_Kept")


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
        """Return the content of a package, read again if any file changed; one that is not whole is always read."""
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
        """Return the cache key of a package; empty if something in it cannot be examined."""
        return "" if self._place is None else folder_key(folder, self._version)

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
