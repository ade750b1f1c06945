"""Files that a command writes for a person: each is written whole, or the previous one stays."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from hil.evidence.durable import PART

__all__ = ["whole", "write_whole_file"]


@contextmanager
def whole(path: Path) -> Iterator[BinaryIO]:
    """Open a file for writing; it takes its name once it is whole, so that a full disk never costs the previous one.

    A pipe or a device is written to as it is, and so is a file in a folder in which no other can be made.

    Raises:
        OSError: if it cannot be written; nothing half written is left.
    """
    target = path.resolve()
    if target.exists() and not (target.is_file() and os.access(target.parent, os.W_OK)):
        with target.open("wb") as stream:
            yield stream
        return
    part = target.with_name(target.name + PART)
    try:
        with part.open("wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        if target.exists():
            shutil.copymode(target, part)
        part.replace(target)
    except BaseException:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise


def write_whole_file(path: Path, data: bytes) -> None:
    """Write a file as `whole` does.

    Raises:
        OSError: as of `whole`.
    """
    with whole(path) as stream:
        stream.write(data)
