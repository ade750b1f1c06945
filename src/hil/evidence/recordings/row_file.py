"""Reader of row files: header, complete rows, a torn last one, and lazily read columns."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hil.documents.canonical import JsonError, canonical, parse_strict
from hil.model.errors import EvidenceError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["BLOCK", "NUMBER", "PIECE", "Columns", "RowsFile", "header_line", "read_rows", "row_blocks", "table"]

BLOCK = 65_536
"""Number of rows after which the running hash goes into the journal."""

PIECE = 16_384
"""Number of rows read or written at a time, so that a long recording takes no more memory than a short one."""

NUMBER = 8
"""Bytes of one number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RowsFile:
    """A row file on disk: its header, where its rows begin, and how many are complete."""

    path: Path
    header: dict[str, Any]
    start: int
    rows: int
    torn: int

    @property
    def width(self) -> int:
        """Numbers per row: time, then the channels."""
        return len(self.header["channels"]) + 1


def header_line(recording: str, channels: Sequence[tuple[str, str]]) -> bytes:
    """Return the first line of a row file, from the recording's id, and name and unit of every channel."""
    header = {
        "channels": [{"name": name, "unit": unit} for name, unit in channels],
        "format": 1,
        "recording": recording,
        "row": "float64 little-endian: time in s, then the channels",
    }
    return canonical(header) + b"\n"


def read_rows(path: Path) -> RowsFile:
    """Read a row file's header and count its complete rows; a torn last row is left out.

    Raises:
        EvidenceError: if there is no such file, or its header cannot be read.
    """
    try:
        with path.open("rb") as stream:
            line = stream.readline()
            size = os.fstat(stream.fileno()).st_size
        header = parse_strict(line) if line.endswith(b"\n") else None
    except (OSError, JsonError) as error:
        raise EvidenceError(f"{path}: not a row file: {error}", "the recording cannot be read back") from error
    if not isinstance(header, dict) or not isinstance(header.get("channels"), list):
        raise EvidenceError(f"{path}: its header is not that of a row file", "the recording cannot be read back")
    rows, torn = divmod(size - len(line), (len(header["channels"]) + 1) * NUMBER)
    return RowsFile(path=path, header=header, start=len(line), rows=rows, torn=torn)


def row_blocks(found: RowsFile, most: int = BLOCK) -> Iterator[bytes]:
    """Yield the bytes of the complete rows, in blocks of `most` rows."""
    left = found.rows * found.width * NUMBER
    with found.path.open("rb") as stream:
        stream.seek(found.start)
        while left:
            block = stream.read(min(left, most * found.width * NUMBER))
            if not block:
                raise EvidenceError(f"{found.path}: the file became shorter while it was read", "read it again")
            left -= len(block)
            yield block


def table(block: bytes, width: int) -> NDArray[np.float64]:
    """Return rows as an array of shape (rows, width)."""
    import numpy as np  # noqa: PLC0415 - rows are packed without it

    return np.frombuffer(block, "<f8").reshape(-1, width)


class Columns(Mapping[str, "NDArray[np.float64]"]):
    """The channels of a row file by name, each of shape (rows,), read at each access.

    Args:
        found: the row file; it has to stay where it is.
    """

    def __init__(self, found: RowsFile) -> None:
        self._found = found
        names = ["time", *(channel["name"] for channel in found.header["channels"])]
        self._places = {name: place for place, name in enumerate(names)}

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        import numpy as np  # noqa: PLC0415 - slow to import

        place, found = self._places[name], self._found
        values = np.empty(found.rows)
        for number, block in enumerate(row_blocks(found, PIECE)):
            column = table(block, found.width)[:, place]
            values[number * PIECE : number * PIECE + len(column)] = column
        return values

    def __iter__(self) -> Iterator[str]:
        return iter([name for name in self._places if name != "time"])

    def __len__(self) -> int:
        return len(self._places) - 1

    def part(self, first: int, end: int) -> dict[str, NDArray[np.float64]]:
        """Return time and channels for the rows from `first` to before `end`.

        Raises:
            EvidenceError: if the file cannot be read.
        """
        found = self._found
        first, end, _ = slice(first, end).indices(found.rows)
        size = found.width * NUMBER
        try:
            with found.path.open("rb") as stream:
                stream.seek(found.start + first * size)
                block = stream.read(max(end - first, 0) * size)
        except OSError as error:
            raise EvidenceError(f"{found.path}: its rows cannot be read: {error}", "see hil verify") from error
        rows = table(block, found.width)
        return {name: rows[:, place].copy() for name, place in self._places.items()}
