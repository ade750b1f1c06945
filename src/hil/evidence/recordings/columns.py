"""Columns of a row file that are read when somebody asks for them, because weeks of rows are large."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from hil.evidence.recordings.row_file import NUMBER, PIECE, RowsFile, row_blocks, table
from hil.model.errors import EvidenceError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Columns"]


class Columns(Mapping[str, "NDArray[np.float64]"]):
    """The channels of a row file by name, each of shape (rows,); nothing of them is kept.

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
        """Return time and channels of the rows from `first` to before `end`.

        Raises:
            EvidenceError: where the file cannot be read.
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
