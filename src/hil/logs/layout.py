"""Layout detection for foreign text tables: separator, decimal sign, column names and first row."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

__all__ = ["COMMENT_MARKS", "Layout", "recognise"]

COMMENT_MARKS = ("#", "%", "//")
"""Prefixes of comment lines; above the first row a comment may hold the column names."""

_UNIT = re.compile(
    r"[numkMµμ]?(?:s|sec|V|A|Ah|W|Wh|g|T|G|K|J|N|m|Hz|Pa|rad|[Oo]hm|Ω)"
    r"|min|h|hr|d|C|F|deg|degC|degF|°F|dps|mdps|mdeg|urad|°|°C|bar|rpm|LSB|counts?|sqrt|%"
)
"""The words of a unit, between joining signs."""

_JOINTS = re.compile(r"[\s/*·.^()√²³\d-]+")
_CLOCK = re.compile(r"[hH]{1,2}:[mM]{2}:[sS]{2}(?:[.,]\w+)?")
_LOOKED_AT = 20  # lines at the end of the sample that count as rows, whatever precedes them


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Layout of a table.

    Attributes:
        separator: cell separator, None for any white space.
        decimal: decimal sign, a point or a comma.
        width: cells per row.
        names: column names, empty if the table has none.
        units: units from a line below the names, without brackets; empty if there is none.
        first: line number of the first row, counted from 1.
        quoted: whether cells are in double quotes.
        empty: indices of columns that are empty in all examined rows.
    """

    separator: str | None
    decimal: str
    width: int
    names: tuple[str, ...]
    units: tuple[str, ...] = ()
    first: int
    quoted: bool
    empty: frozenset[int] = frozenset()

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line, without quotes and surrounding space."""
        if self.separator is not None and '"' in line:
            found = next(csv.reader([line], delimiter=self.separator, skipinitialspace=True), [])
            return [cell.strip() for cell in found]
        return [cell.strip().strip('"') for cell in line.split(self.separator)]

    def title(self, place: int) -> str:
        """Return the name of a column, with any unit from the units line in brackets; or else its number."""
        unit = self.units[place] if self.units else ""
        name = self.names[place] if self.names else str(place + 1)
        return f"{name} [{unit}]" if unit else name

    def number(self, cell: str) -> float | None:
        """Parse a cell, None if it is not a number."""
        if "_" in cell or not cell.isascii() or (self.decimal == "," and "." in cell):
            return None
        try:
            return float(cell.replace(self.decimal, "."))
        except ValueError:
            return None


def recognise(lines: Sequence[str]) -> Layout | None:
    """Detect the layout of a table from its first lines, None if they contain no row of numbers."""
    written = [line for line in lines if line.strip() and not line.lstrip().startswith(COMMENT_MARKS)]
    best: tuple[float, float, Layout] | None = None
    for separator, decimal in (("\t", "."), (";", "."), (",", "."), (None, "."), ("\t", ","), (";", ","), (None, ",")):
        guess = Layout(separator=separator, decimal=decimal, width=0, names=(), first=0, quoted=False)
        rows = [guess.cells(line) for line in written[-_LOOKED_AT:]]
        numbers = sum(guess.number(cell) is not None for row in rows for cell in row)
        # A trailing separator makes an empty cell, which does not count against any separator.
        score = (numbers / max(1, sum(len(row) - (row[-1:] == [""]) for row in rows)), float(numbers))
        if numbers and (best is None or score > best[:2]):
            best = (*score, guess)
    return _placed(lines, written[-_LOOKED_AT:], best[2]) if best else None


def _placed(lines: Sequence[str], rows: Sequence[str], guess: Layout) -> Layout | None:
    """Find the first row, and the names: the last line above it with a distinct one for each column.

    A units line below names is not taken for names, nor a comment below a line that holds them. Empty columns, such as
    from trailing separators, need no name.
    """
    split = [guess.cells(line) for line in rows]
    width = Counter(map(len, split)).most_common(1)[0][0]
    whole = [cells for cells in split if len(cells) == width]
    empty = frozenset(place for place in range(width) if not any(cells[place] for cells in whole))
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    commented = True
    for place, line in enumerate(lines):
        cells = guess.cells(line)
        comment = line.lstrip().startswith(COMMENT_MARKS)
        if not comment and len(cells) == width and any(guess.number(cell) is not None for cell in cells):
            return Layout(
                separator=guess.separator,
                decimal=guess.decimal,
                width=width,
                names=names,
                units=units,
                first=place + 1,
                quoted='"' in line,
                empty=empty,
            )
        above = guess.cells(line.strip().lstrip("#%/ ")) if comment else cells
        if len(above) == width - 1 and width - 1 in empty:
            above = [*above, ""]
        if len(above) != width:
            continue
        told = _units(above) if names else ()
        named = [cell for number, cell in enumerate(above) if cell or number not in empty]
        if told:
            units = told
        elif len(set(named)) == len(named) and (commented or not comment):
            names, units, commented = tuple(above), (), comment
    return None


def _units(cells: Sequence[str]) -> tuple[str, ...]:
    """Return the cells of a units line, in which a cell may be empty or a dash; empty if it is not one."""
    bare = [cell.strip("[]") if cell.startswith("[") else cell.strip("-") for cell in cells]
    bare = [cell[1:-1] if cell.startswith("(") and cell.endswith(")") else cell for cell in bare]
    words = [[word for word in _JOINTS.split(cell) if word] for cell in bare if not _CLOCK.fullmatch(cell)]
    known = all(_UNIT.fullmatch(word) for cell in words for word in cell)
    return tuple(bare) if known and any(bare) else ()
