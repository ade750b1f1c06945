"""Files of an export: all that belong together are there whole, or none of them is."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from hil.evidence.durable import DISK_FULL, PART, sync_file, sync_folder
from hil.evidence.folder import is_sealed
from hil.model.errors import Refused

__all__ = ["require_new", "whole_files"]


def require_new(folder: Path, names: Sequence[str]) -> None:
    """Refuse a folder to which these files cannot be added.

    Raises:
        Refused: where it is inside of a sealed package or is no folder, or where one of the files is there.
    """
    whole = Path(os.path.realpath(folder))
    for place in (whole, *whole.parents):
        if is_sealed(place):
            raise Refused(f"{folder}: this is inside of the sealed package {place.name}", "choose another --output")
    if os.path.lexists(folder) and not folder.is_dir():
        raise Refused(f"{folder}: this is no folder", "choose another --output")
    for name in names:
        if os.path.lexists(folder / name):
            raise Refused(f"{folder / name} is there already, and nothing is overwritten", "choose another --output")


@contextmanager
def whole_files(folder: Path, names: Sequence[str]) -> Iterator[list[Path]]:
    """Give paths to write to, and give the files their names once all of them are on the disk.

    Args:
        folder: where they are written; it is made where it is not there, and removed again if nothing comes into it.
        names: the names that the files get.

    Raises:
        Refused: where the disk is full or a file cannot be written; nothing half written is left.
    """
    parts = [folder / f"{name}{PART}" for name in names]
    there = folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield parts
        for part in parts:
            sync_file(part)
        for part, name in zip(parts, names, strict=True):
            part.replace(folder / name)
        sync_folder(folder)
    except OSError as error:
        what = "disk full" if error.errno in DISK_FULL else f"cannot be written: {error.strerror or error}"
        raise Refused(f"{folder / names[0]}: {what}", "choose another --output, or free some space") from error
    finally:
        for part in parts:
            with suppress(OSError):
                part.unlink()
        if not there:
            with suppress(OSError):
                folder.rmdir()  # only an empty one can be
