"""Detects that files have not changed since they were read, so that they need not be read again.

A folder's key covers the names of everything in it; size, inode, and the times of content and inode of every file, to
the nanosecond; and the version of the product. Only the administrator of a machine can set the time of an inode, so
that a file that was changed and set back is read again. Results are kept in the user's own folder, never beside the
packages, so that whoever hands over packages does not hand over what is believed of them.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import hil

__all__ = ["cache_folder", "folder_key", "product_key"]


def cache_folder(kind: str) -> Path:
    """Return the user's cache folder, for what can be recomputed."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "hil" / kind


def product_key() -> str:
    """Return a key of the product's code: if any of it changes, everything is recomputed."""
    content = hashlib.sha256()
    content.update("".join(_fingerprints(str(Path(hil.__file__).parent), only=".py") or ()).encode(errors=_AS_BYTES))
    return content.hexdigest()


def folder_key(folder: Path, version: str) -> str:
    """Return the key of a folder's content; empty if something in it cannot be examined.

    Args:
        folder: the folder; a link, pipe or device in it makes the key empty.
        version: the key of the product that read it.
    """
    lines = _fingerprints(str(folder))
    if lines is None:
        return ""
    text = f"{version}\0{folder.absolute()}\0{''.join(lines)}"
    return hashlib.sha256(text.encode(errors=_AS_BYTES)).hexdigest()


_AS_BYTES = "surrogateescape"  # file names that are not valid text


def _fingerprints(root: str, only: str = "") -> list[str] | None:
    """Return a line for everything below a folder, sorted; None if something is neither a file nor a folder.

    Args:
        root: the folder.
        only: the suffix of the files that count; other files and all folders are then left out.
    """
    lines: list[str] = []
    pending = [root]
    try:
        while pending:
            with os.scandir(pending.pop()) as found:
                for entry in found:
                    if entry.is_dir(follow_symlinks=False):
                        pending.append(entry.path)
                        if not only:
                            lines.append(f"{entry.path}/\n")
                    elif only and not entry.name.endswith(only):
                        continue
                    elif entry.is_file(follow_symlinks=False):
                        its = entry.stat(follow_symlinks=False)
                        times = f"{its.st_mtime_ns} {its.st_ctime_ns}"
                        lines.append(f"{entry.path}\0{its.st_size} {times} {its.st_ino} {its.st_dev}\n")
                    elif not only:
                        return None
    except OSError:
        return None
    return sorted(lines)
