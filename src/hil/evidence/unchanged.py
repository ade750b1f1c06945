"""What tells that files did not change since they were read, so that they need not be read again.

A folder is known again by the names of everything in it, by size, inode, and the times of content and inode of every
file, to the nanosecond, and by the version of the product. Nobody but the administrator of a machine can set the time
of an inode, so that a file that was changed and set back is read again. What was found is kept in the user's own
folder, never beside the packages, so that nobody who hands over packages hands over what is believed of them.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import hil

__all__ = ["cache_folder", "folder_key", "product_key"]


def cache_folder(kind: str) -> Path:
    """Return the user's folder for what can be computed again."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "hil" / kind


def product_key() -> str:
    """Return what identifies the code of the product: whatever of it changes, everything is computed again."""
    content = hashlib.sha256()
    content.update("".join(_looked_at(str(Path(hil.__file__).parent), only=".py") or ()).encode(errors=_AS_BYTES))
    return content.hexdigest()


def folder_key(folder: Path, version: str) -> str:
    """Return what the content of a folder is known again by; empty where something in it cannot be looked at.

    Args:
        folder: the folder; a link, pipe or device in it makes the key empty.
        version: what identifies the product that read it.
    """
    told = _looked_at(str(folder))
    if told is None:
        return ""
    text = f"{version}\0{folder.absolute()}\0{''.join(told)}"
    return hashlib.sha256(text.encode(errors=_AS_BYTES)).hexdigest()


_AS_BYTES = "surrogateescape"  # names of files that are no text


def _looked_at(root: str, only: str = "") -> list[str] | None:
    """Return a line for everything below a folder, sorted; None where something is neither a file nor a folder.

    Args:
        root: the folder.
        only: the ending of the files that count; other files and all folders are then left out.
    """
    told: list[str] = []
    pending = [root]
    try:
        while pending:
            with os.scandir(pending.pop()) as found:
                for entry in found:
                    if entry.is_dir(follow_symlinks=False):
                        pending.append(entry.path)
                        if not only:
                            told.append(f"{entry.path}/\n")
                    elif only and not entry.name.endswith(only):
                        continue
                    elif entry.is_file(follow_symlinks=False):
                        its = entry.stat(follow_symlinks=False)
                        times = f"{its.st_mtime_ns} {its.st_ctime_ns}"
                        told.append(f"{entry.path}\0{its.st_size} {times} {its.st_ino} {its.st_dev}\n")
                    elif not only:
                        return None
    except OSError:
        return None
    return sorted(told)
