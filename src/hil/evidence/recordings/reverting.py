"""Recordings back from HDF5 to rows: a run whose seal was interrupted goes on, and its recordings with it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from hil.evidence.durable import PART, sync_file, sync_folder
from hil.evidence.events import Recording
from hil.evidence.recordings.hdf5 import read_blocks
from hil.evidence.recordings.row_file import header_line

__all__ = ["revert"]


def revert(folder: Path, begun: Iterable[Recording]) -> None:
    """Turn every HDF5 file into the row file that it was made from; a row file that is there still is the original.

    Args:
        folder: the run's `data/recordings`.
        begun: its recordings.

    Raises:
        EvidenceError: where an HDF5 file cannot be read.
        OSError: where the disk is full or fails.
    """
    for event in begun:
        rows, hdf5 = (folder / f"{event.recording}{suffix}" for suffix in (".rows", ".h5"))
        if not hdf5.exists():
            continue
        if not rows.exists():
            _write(rows, hdf5, event)
        hdf5.unlink()


def _write(rows: Path, hdf5: Path, begun: Recording) -> None:
    import numpy as np  # noqa: PLC0415 - slow to import

    part = rows.with_name(rows.name + PART)
    with part.open("wb") as stream:
        stream.write(header_line(begun.recording, [(each.name, each.unit) for each in begun.channels]))
        for block in read_blocks(hdf5):
            stream.write(np.column_stack(block).astype("<f8").tobytes())
    sync_file(part)
    part.replace(rows)
    sync_folder(rows.parent)
