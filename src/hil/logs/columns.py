"""Reader of foreign text tables: the chosen columns as numbers, or where and why that is not possible."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from types import MappingProxyType
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from hil.documents.suggest import did_you_mean
from hil.logs.clocks import Clock
from hil.model.errors import Refused

__all__ = ["COMMENT_MARKS", "Layout", "Reading", "Table", "read", "recognise"]

COMMENT_MARKS = ("#", "%", "//")
"""A line that begins with one of these holds no row; above the first row it may hold the columns' names."""

_LOOKED_AT = 20  # lines at the end of the sample that count as rows, whatever stands above them


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """How a table is written.

    Attributes:
        separator: what stands between cells, None for any white space.
        decimal: the decimal sign, a point or a comma.
        width: cells in a row.
        names: the columns' names, empty where the table names none.
        first: line number of the first row, counted from 1.
        quoted: whether cells stand in double quotes.
    """

    separator: str | None
    decimal: str
    width: int
    names: tuple[str, ...]
    first: int
    quoted: bool

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line, without quotes and surrounding space."""
        return [cell.strip().strip('"') for cell in line.split(self.separator)]

    def number(self, cell: str) -> float | None:
        """Return the number that a cell holds, or None."""
        if "_" in cell or (self.decimal == "," and "." in cell):
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
    """Find the first row, and the names in the last line above it that has one for each column, each another."""
    counts = Counter(len(guess.cells(line)) for line in rows)
    width = counts.most_common(1)[0][0]
    names: tuple[str, ...] = ()
    for place, line in enumerate(lines):
        cells = guess.cells(line)
        comment = line.lstrip().startswith(COMMENT_MARKS)
        if not comment and len(cells) == width and any(guess.number(cell) is not None for cell in cells):
            return Layout(
                separator=guess.separator,
                decimal=guess.decimal,
                width=width,
                names=names,
                first=place + 1,
                quoted='"' in line,
            )
        above = guess.cells(line.strip().lstrip("#%/ ")) if comment else cells
        if len(above) == width and len(set(above)) == width:
            names = tuple(above)
    return None


_CLOCK = re.compile(r"\d:\d\d")
_AS_TIMES = "write times as seconds, hh:mm:ss.sss, or 2026-01-31T23:59:59.9"
_SAMPLE = 400  # lines from which the layout is recognised
_MARKS = tuple({mark[0] for mark in COMMENT_MARKS})


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """The chosen columns of a text table.

    Attributes:
        names: the columns' names, or their numbers counted from 1 where the table names none.
        values: shape (rows, columns), in the order in which the columns were asked for.
        remarks: what was left out, in sentences.
        clocked: whether the first column was read as times of a clock, so that it is in s.
    """

    names: tuple[str, ...]
    values: NDArray[np.float64]
    remarks: tuple[str, ...]
    clocked: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """How a column is read that does not hold plain numbers.

    Attributes:
        number: returns the number that a cell stands for; raises ValueError where it stands for none.
        what: what a cell should be, for errors.
        hint: what to do about a cell that is not.
    """

    number: Callable[[str], float]
    what: str
    hint: str


_NONE: Mapping[str, Reading] = MappingProxyType({})


def read(
    path: Path,
    columns: Sequence[str] = (),
    *,
    first: str = "",
    clock: bool = False,
    readings: Mapping[str, Reading] = _NONE,
) -> Table:
    """Read columns of numbers from a text table.

    Cells stand between tabs, semicolons, commas or white space; the decimal sign is a point, or a comma where cells
    are not separated by commas. Lines above the first row, blank lines and comments are skipped. A last line without
    its end that does not hold a whole row was torn off, and is left out with a remark.

    Args:
        path: the file, UTF-8 or another code in which digits are ASCII.
        columns: each by its number, counted from 1, or by its name; all others than `first` where empty.
        first: a column to put before them, by number or name.
        clock: whether `first` holds times, which may also be `hh:mm:ss.sss`, `3 days 04:05:06` or ISO 8601; these are
            read as seconds, dates from midnight of the first one.
        readings: by column, how its cells are read where they are not plain numbers.

    Raises:
        Refused: no such file, no table, no such column, a row with more or fewer cells, a cell that is no number.
    """
    try:
        _refuse_binary(path)
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            layout = recognise(list(islice(file, _SAMPLE)))
        if layout is None:
            raise Refused(f"{path}: no row of numbers in the first {_SAMPLE} lines", "is this a table of samples?")
        leading = [_place(path, layout, first)] if first else []
        chosen = [_place(path, layout, column) for column in columns]
        others = chosen or [each for each in range(layout.width) if each not in leading]
        special = {_place(path, layout, column): reading for column, reading in readings.items()}
        if leading and clock and not _starts_with_number(path, layout, leading[0]):
            special[leading[0]] = Reading(number=Clock(), what="time", hint=_AS_TIMES)
        return _rows(path, layout, leading + others, special, clocked=bool(leading) and leading[0] in special)
    except OSError as error:
        raise Refused(f"{path}: {error.strerror}", "name a text table that can be read") from None


def _refuse_binary(path: Path) -> None:
    with path.open("rb") as file:
        start = file.read(8192)
    if not start.strip():
        raise Refused(f"{path}: the file is empty", "name a table with at least one row")
    if b"\0" in start:
        raise Refused(f"{path}: not a text file", "export the log as text (CSV) in UTF-8 first")


def _place(path: Path, layout: Layout, column: str) -> int:
    if column in layout.names:
        return layout.names.index(column)
    if column.isdecimal() and 1 <= int(column) <= layout.width:
        return int(column) - 1
    known = ", ".join(layout.names) if layout.names else "without names"
    raise Refused(
        f"{path}: no column '{column}'{did_you_mean(column, layout.names)}",
        f"there are {layout.width} columns, numbered from 1 ({known})",
    )


def _rows(path: Path, layout: Layout, chosen: list[int], special: Mapping[int, Reading], *, clocked: bool) -> Table:
    remarks: list[str] = []
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        lines = _whole(path, layout, chosen, file, remarks, special)
        try:
            values = np.loadtxt(
                lines,
                delimiter=layout.separator,
                usecols=chosen,
                ndmin=2,
                comments=None,
                quotechar='"' if layout.quoted else None,
                converters={place: reading.number for place, reading in special.items()} or None,
            )
        except ValueError as error:
            raise _located(path, layout, chosen, error, special) from None
    names = tuple(layout.names[place] if layout.names else str(place + 1) for place in chosen)
    return Table(names=names, values=values, remarks=tuple(remarks), clocked=clocked)


def _starts_with_number(path: Path, layout: Layout, place: int) -> bool:
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        cells = layout.cells(next(islice(file, layout.first - 1, None)))
    return layout.number(cells[place]) is not None


def _whole(
    path: Path, layout: Layout, chosen: list[int], file: TextIO, remarks: list[str], special: Mapping[int, Reading]
) -> Iterator[str]:
    """Yield the rows as lines with decimal points; refuse the first with another number of cells."""
    for number, raw in enumerate(islice(file, layout.first - 1, None), start=layout.first):
        line = raw.replace(",", ".") if layout.decimal == "," else raw
        if line.isspace() or (line.lstrip().startswith(COMMENT_MARKS) if line[0] in _MARKS else False):
            continue
        if line[-1] != "\n" and not _is_row(layout, chosen, raw, special):
            remarks.append(f"line {number}, the last, is torn off and left out")
            return
        count = len(line.split()) if layout.separator is None else line.count(layout.separator) + 1
        if count != layout.width and not layout.quoted:
            raise Refused(
                f"{path}:{number}:1: {count} cells, where the rows above have {layout.width}",
                "mend or remove the line",
            )
        yield line


def _is_row(layout: Layout, chosen: list[int], line: str, special: Mapping[int, Reading]) -> bool:
    cells = layout.cells(line)
    return len(cells) == layout.width and all(_is_read(layout, cells[each], special.get(each)) for each in chosen)


def _is_read(layout: Layout, cell: str, special: Reading | None) -> bool:
    if special is None:
        return layout.number(cell) is not None
    try:
        special.number(cell)
    except ValueError:
        return False
    return True


def _located(
    path: Path, layout: Layout, chosen: list[int], error: ValueError, special: Mapping[int, Reading]
) -> Refused:
    """Find the first cell that is no number; only a table with such a cell is read twice."""
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        for number, line in enumerate(file, start=1):
            if number < layout.first or not line.strip() or line.lstrip().startswith(COMMENT_MARKS):
                continue
            cells = layout.cells(line)
            for place in chosen:
                if place < len(cells) and not _is_read(layout, cells[place], special.get(place)):
                    column = _position(layout, line, place)
                    usual = (
                        _AS_TIMES if _CLOCK.search(cells[place]) else "mend or remove the line, or choose other columns"
                    )
                    wanted = special.get(place) or Reading(number=float, what="number", hint=usual)
                    return Refused(
                        f"{path}:{number}:{column}: '{cells[place]}' in column {place + 1} is not a {wanted.what}",
                        wanted.hint,
                    )
    return Refused(f"{path}: {error}", "mend the table")


def _position(layout: Layout, line: str, place: int) -> int:
    """Return the position of a cell in its line, counted from 1."""
    if layout.separator is not None:
        before = sum(len(cell) + 1 for cell in line.split(layout.separator)[:place])
        rest = line[before:]
        return before + len(rest) - len(rest.lstrip()) + 1
    position = 0
    for cell in line.split()[:place]:
        position = line.index(cell, position) + len(cell)
    return position + len(line[position:]) - len(line[position:].lstrip()) + 1
