"""Listing of a run's folder: regular files, folders, and everything that a package must not contain."""

from __future__ import annotations

import os
import stat
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from hil.model.errors import Finding

__all__ = ["Listing", "list_folder", "shown"]

_SPECIAL = {
    stat.S_IFLNK: "a link",
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Listing:
    """Everything below a folder; paths are relative to it, with slashes, sorted by their bytes.

    Attributes:
        files: regular files.
        empty: folders with no file below them.
        odd: a finding for everything that is neither file nor folder, or cannot be examined.
    """

    files: tuple[str, ...]
    empty: tuple[str, ...]
    odd: tuple[Finding, ...]

    def findings(self) -> Iterator[Finding]:
        """Yield a finding for everything that a sealed package must not contain."""
        yield from self.odd
        for path in self.empty:
            yield Finding(shown(path), 0, 0, "empty folder: a package has none")
        seen: dict[str, str] = {}
        for path in self.files:
            twin = seen.setdefault(unicodedata.normalize("NFC", path).casefold(), path)
            if twin != path:
                yield Finding(shown(path), 0, 0, f"its name differs from {shown(twin)} by case only")


def list_folder(folder: Path) -> Listing:
    """List everything below a folder; nothing is opened, and no link is followed."""
    files: list[str] = []
    folders: list[str] = []
    odd: list[Finding] = []
    pending = [""]
    while pending:
        here = pending.pop()
        try:
            found = list(_scanned(folder, here))
        except OSError as error:
            odd.append(Finding(shown(here) or ".", 0, 0, f"this folder cannot be read: {error.strerror}"))
            continue
        for path, kind in found:
            if kind == stat.S_IFDIR:
                folders.append(path)
                pending.append(path)
            elif kind == stat.S_IFREG:
                files.append(path)
            else:
                what = _SPECIAL.get(kind, "something special")
                odd.append(Finding(shown(path), 0, 0, f"expected a regular file, found {what}"))
    holding = {path[:cut] for path in files for cut, letter in enumerate(path) if letter == "/"}
    return Listing(
        files=tuple(sorted(files, key=os.fsencode)),
        empty=tuple(sorted((path for path in folders if path not in holding), key=os.fsencode)),
        odd=tuple(sorted(odd)),
    )


def _scanned(folder: Path, here: str) -> Iterator[tuple[str, int]]:
    """Yield path and kind of everything directly in one folder."""
    with os.scandir(os.path.join(folder, here)) as found:  # noqa: PTH118 - joining paths with many parts is slow
        for entry in found:
            yield f"{here}/{entry.name}" if here else entry.name, stat.S_IFMT(entry.stat(follow_symlinks=False).st_mode)


def shown(path: str) -> str:
    """Return a text that can be printed anywhere: invalid text and control characters are escaped."""
    if path.isprintable():
        return path
    return "".join(letter if letter.isprintable() else letter.encode("unicode_escape").decode() for letter in path)
