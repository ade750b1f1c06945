"""How a foreign text table is written: separator, decimal sign, names, and where its rows begin."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

__all__ = ["COMMENT_MARKS", "Layout", "recognise"]

COMMENT_MARKS = ("#", "%", "//")
"""A line that begins with one of these holds no row; above the first row it may hold the columns' names."""

_UNIT = re.compile(
    r"[numkMµμ]?(?:s|sec|V|A|Ah|W|Wh|g|T|G|K|J|N|m|Hz|Pa|rad|[Oo]hm|Ω)"
    r"|min|h|hr|d|C|F|deg|degC|degF|°F|dps|mdps|mdeg|urad|°|°C|bar|rpm|LSB|counts?|sqrt|%"
)
"""The words of a unit, between the signs that join them."""

_JOINTS = re.compile(r"[\s/*·.^()√²³\d-]+")
_CLOCK = re.compile(r"[hH]{1,2}:[mM]{2}:[sS]{2}(?:[.,]\w+)?")
_LOOKED_AT = 20  # lines at the end of the sample that count as rows, whatever stands above them


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """How a table is written.

    Attributes:
        separator: what stands between cells, None for any white space.
        decimal: the decimal sign, a point or a comma.
        width: cells in a row.
        names: the columns' names, empty where the table names none.
        units: what a line of units below the names says, without brackets; empty where there is none.
        first: line number of the first row, counted from 1.
        quoted: whether cells stand in double quotes.
        empty: places of the columns in which no row that was looked at holds anything, counted from 0.
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
        """Return the name of a column, with its unit in brackets if a line of its own says it; else its number."""
        unit = self.units[place] if self.units else ""
        name = self.names[place] if self.names else str(place + 1)
        return f"{name} [{unit}]" if unit else name

    def number(self, cell: str) -> float | None:
        """Return the number that a cell holds, or None."""
        if "_" in cell or not cell.isascii() or (self.decimal == "," and "." in cell):
            return None
        try:
            return float(cell.replace(self.decimal, "."))
        except ValueError:
            return None


def recognise(lines: Sequence[str]) -> Layout | None:
    """Return how a table is written, judged by its first lines, or None where they hold no row of numbers."""
    written = [line for line in lines if line.strip() and not line.lstrip().startswith(COMMENT_MARKS)]
    best: tuple[float, float, Layout] | None = None
    for separator, decimal in (("\t", "."), (";", "."), (",", "."), (None, "."), ("\t", ","), (";", ","), (None, ",")):
        guess = Layout(separator=separator, decimal=decimal, width=0, names=(), first=0, quoted=False)
        rows = [guess.cells(line) for line in written[-_LOOKED_AT:]]
        numbers = sum(guess.number(cell) is not None for row in rows for cell in row)
        # A separator at the end of a row makes an empty cell, which speaks against no separator.
        score = (numbers / max(1, sum(len(row) - (row[-1:] == [""]) for row in rows)), float(numbers))
        if numbers and (best is None or score > best[:2]):
            best = (*score, guess)
    return _placed(lines, written[-_LOOKED_AT:], best[2]) if best else None


def _placed(lines: Sequence[str], rows: Sequence[str], guess: Layout) -> Layout | None:
    """Find the first row, and the names in the last line above it that has one for each column, each another.

    A line of units below names is not taken for names, nor a comment below a line that holds them. Columns without
    anything in them need no name: a separator at the end of each row makes one.
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
    """Return the cells of a line of units, or nothing if it is another; a cell may be empty or a dash."""
    bare = [cell.strip("[]") if cell.startswith("[") else cell.strip("-") for cell in cells]
    bare = [cell[1:-1] if cell.startswith("(") and cell.endswith(")") else cell for cell in bare]
    words = [[word for word in _JOINTS.split(cell) if word] for cell in bare if not _CLOCK.fullmatch(cell)]
    known = all(_UNIT.fullmatch(word) for cell in words for word in cell)
    return tuple(bare) if known and any(bare) else ()
