"""A recording as a text table: one line of names with units, then a line per row."""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from hil.documents.canonical import canonical
from hil.evidence.package.listing import shown
from hil.evidence.recordings.hdf5 import read_blocks
from hil.model.errors import Refused
from hil.report.export.selection import Facts

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["TableFormat", "header", "lines_of", "write_csv"]


_BLOCK = 16_384
"""Rows converted to text at a time: a chunk of the HDF5 file, some megabytes of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TableFormat:
    """How a table is written.

    Attributes:
        separator: what stands between two columns: a comma, a semicolon or a tab.
        decimal: a point or a comma.
        commented: whether the facts stand above the table, in lines that begin with `#`.

    Raises:
        Refused: for a decimal comma between commas.
    """

    separator: str = ","
    decimal: str = "."
    commented: bool = False

    def __post_init__(self) -> None:
        if self.separator == self.decimal:
            raise Refused("a decimal comma needs another separator than the comma", "add --separator ';'")


def write_csv(recording: Path, table: Path, facts: Facts, form: TableFormat) -> str:
    """Write a recording as a table in UTF-8, block by block, and return the SHA-256 of the file.

    Numbers have the digits that read back as the same float64; a NaN is an empty field.

    Args:
        recording: its HDF5 file.
        table: the file to write.
        facts: the recording's facts.
        form: how it is written.

    Raises:
        EvidenceError: where the recording cannot be read.
        OSError: where the table cannot be written.
    """
    written = hashlib.sha256()
    with table.open("wb") as stream:
        for text in _texts(recording, facts, form):
            data = text.encode("utf-8")
            written.update(data)
            stream.write(data)
    return written.hexdigest()


def header(facts: Facts, form: TableFormat) -> str:
    """Return the line of names with units, such as `time [s],x [deg/s]`; a name is quoted where it must be."""
    named = [("time", "s"), *((channel["name"], channel["unit"]) for channel in facts["channels"])]
    line = io.StringIO()
    writer = csv.writer(line, delimiter=form.separator, lineterminator="\n")
    writer.writerow(shown(f"{name} [{unit}]") for name, unit in named)
    return line.getvalue()


def lines_of(columns: Sequence[NDArray[np.float64]], form: TableFormat) -> str:
    """Return a line per row.

    Args:
        columns: the time and then every channel, each of shape (n,).
        form: how they are written.
    """
    written = (map(repr, column.tolist()) for column in columns)
    text = "".join(f"{line}\n" for line in map(form.separator.join, zip(*written, strict=True)))
    text = text.replace("nan", "")
    return text.replace(".", ",") if form.decimal == "," else text


def _texts(recording: Path, facts: Facts, form: TableFormat) -> Iterator[str]:
    if form.commented:
        yield "".join(f"# {shown(name)}: {_told(value)}\n" for name, value in facts.items())
    yield header(facts, form)
    for block in read_blocks(recording, _BLOCK):
        yield lines_of(block, form)


def _told(value: object) -> str:
    return shown(value) if isinstance(value, str) else canonical(value).decode("utf-8")
