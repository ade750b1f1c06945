"""Reader of foreign text tables: selected columns as numbers, or a located error."""

from __future__ import annotations

import io
import math
import re
from codecs import BOM_UTF8
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from hil.documents.suggest import did_you_mean
from hil.logs.clocks import Clock
from hil.logs.layout import COMMENT_MARKS, Layout, recognise
from hil.logs.numerals import MARGIN, numbers, plain
from hil.model.errors import Refused

__all__ = ["Reading", "Table", "read"]

_CLOCK = re.compile(r"\d:\d\d")
_AS_TIMES = "write times as seconds, hh:mm:ss.sss, or 2026-01-31T23:59:59.9"
_SAMPLE = 400  # lines used to detect the layout
_BLOCK = 1 << 18  # bytes read at once: they and their results fit into the processor's cache
_TAIL = 1 << 14  # bytes at the end of a file, for comparison with an unterminated last line
_FEWEST, _ENOUGH = 4, 20  # rows above it needed to suspect, and to decide
_SHOWN = 40  # characters of a cell in an error
_ODD = 0.1  # of the cells of a block: with more irregular cells, lines are parsed one by one
_PACKED = {
    b"\x1f\x8b": "packed by gzip",
    b"PK\x03\x04": "a ZIP archive or a workbook",
    b"\xff\xfe": "in UTF-16",
    b"\xfe\xff": "in UTF-16",
}
"""Signatures of binary files mistaken for text."""

_MARKS = tuple({mark[0] for mark in COMMENT_MARKS})


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """The selected columns of a text table.

    Attributes:
        names: the columns' names, with the unit from a line of units below them, such as `t [ms]`; their numbers,
            counted from 1, where the table names none.
        values: shape (rows, columns), columns in the order requested.
        remarks: omissions, in sentences.
        clocked: whether the first column was parsed as clock times, in s.
    """

    names: tuple[str, ...]
    values: NDArray[np.float64]
    remarks: tuple[str, ...]
    clocked: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Parser for a column that does not contain plain numbers.

    Attributes:
        number: converts a cell to a number; raises ValueError if it cannot.
        what: description of a valid cell, for errors.
        hint: remedy for an invalid cell.
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
    blank: bool = False,
) -> Table:
    """Read columns of numbers from a text table.

    Cells are separated by tabs, semicolons, commas or white space; the decimal sign is a point, or a comma where cells
    are not separated by commas. Lines above the first row, blank lines and comments are skipped. An unterminated last
    line is torn if it is not a complete row, or if its last cell is shorter than those above it; it is left out with a
    remark.

    Args:
        path: the file, in UTF-8 or another encoding with ASCII digits.
        columns: columns by number, counted from 1, or by name; if empty, all except `first`.
        first: a column to put before them, by number or name.
        clock: whether `first` holds times, which may also be `hh:mm:ss.sss`, `3 days 04:05:06` or ISO 8601; these are
            converted to seconds, dates from midnight of the first one.
        readings: parsers by column, for columns that are not plain numbers.
        blank: whether an empty cell is NaN rather than an error.

    Raises:
        Refused: no such file, no table, no such column, a row of the wrong width, or a cell that is not a number.
    """
    try:
        _refuse_binary(path)
        layout = recognise(_sample(path))
        if layout is None:
            raise Refused(f"{path}: no row of numbers in the first {_SAMPLE} lines", "is this a table of samples?")
        leading = [_place(path, layout, first)] if first else []
        chosen = [_place(path, layout, column) for column in columns]
        others = chosen or [each for each in range(layout.width) if each not in leading and each not in layout.empty]
        special = {_place(path, layout, column): reading for column, reading in readings.items()}
        if leading and clock and not _starts_with_number(path, layout, leading[0]):
            special[leading[0]] = Reading(number=Clock(), what="time", hint=_AS_TIMES)
        left = [layout.title(each) for each in sorted(layout.empty) if layout.names and layout.names[each]]
        remarks = [] if chosen else [f"column {name} is empty, and left out" for name in left]
        clocked = bool(leading) and leading[0] in special
        return _rows(path, layout, leading + others, special, remarks=remarks, clocked=clocked, blank=blank)
    except OSError as error:
        raise Refused(f"{path}: {error.strerror}", "name a text table that can be read") from None


def _sample(path: Path) -> list[str]:
    """Return the first lines, as UTF-8 or else as Windows-1252."""
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        lines = list(islice(file, _SAMPLE))
    if not any("\ufffd" in line for line in lines):
        return lines
    with path.open(encoding="cp1252", errors="replace") as file:
        return list(islice(file, _SAMPLE))


def _refuse_binary(path: Path) -> None:
    with path.open("rb") as file:
        start = file.read(8192)
    if not start.strip():
        raise Refused(f"{path}: the file is empty", "name a table with at least one row")
    packed = next((what for mark, what in _PACKED.items() if start.startswith(mark)), "")
    if packed:
        raise Refused(
            f"{path}: not a text file in UTF-8, but {packed}", "export or unpack it as text (CSV) in UTF-8 first"
        )
    if b"\0" in start:
        raise Refused(f"{path}: not a text file", "export the log as text (CSV) in UTF-8 first")


def _place(path: Path, layout: Layout, column: str) -> int:
    if column and column in layout.names:
        return layout.names.index(column)
    if column.isdecimal() and 1 <= int(column) <= layout.width:
        return int(column) - 1
    known = ", ".join(layout.names) if layout.names else "without names, or with names that repeat"
    raise Refused(
        f"{path}: no column '{column}'{did_you_mean(column, layout.names)}",
        f"there are {layout.width} columns, numbered from 1 ({known})",
    )


def _rows(
    path: Path,
    layout: Layout,
    chosen: list[int],
    special: Mapping[int, Reading],
    *,
    remarks: list[str],
    clocked: bool,
    blank: bool,
) -> Table:
    rows = _Rows(path=path, layout=layout, chosen=chosen, special=special, remarks=remarks, blank=blank)
    with path.open("rb") as file:
        if file.read(len(BOM_UTF8)) != BOM_UTF8:
            file.seek(0)
        if all(b"\r" not in line.removesuffix(b"\n").removesuffix(b"\r") for line in islice(file, layout.first - 1)):
            rows.number = layout.first
        else:  # a lone carriage return ends a line too
            file.seek(0)
        for block in _blocks(file):
            rows.take(block)
    names = tuple(layout.title(place) for place in chosen)
    values = rows.values[:, : rows.count].T
    return Table(names=names, values=values, remarks=tuple(rows.remarks), clocked=clocked)


def _blocks(file: BinaryIO) -> Iterator[bytes]:
    """Yield blocks of whole lines after `MARGIN` line ends, the end of the file unchanged."""
    margin, rest = b"\n" * MARGIN, b""
    while more := file.read(_BLOCK):
        cut = more.rfind(b"\n") + 1
        if cut:
            yield b"".join((margin, rest, more[:cut]))
            rest = more[cut:]
        else:
            rest += more
    if rest:
        yield margin + rest


@dataclass(slots=True, kw_only=True)
class _Rows:
    """A table being read: in blocks where `plain` can parse them, otherwise line by line.

    Attributes:
        number: number of the next line, counted from 1.
        values: shape (columns, rows plus spare capacity).
        count: number of rows so far.
        remarks: omissions, in sentences.
        blank: whether an empty cell is NaN.
    """

    path: Path
    layout: Layout
    chosen: list[int]
    special: Mapping[int, Reading]
    number: int = 1
    values: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0)))
    count: int = 0
    remarks: list[str] = field(default_factory=list)
    blank: bool = False

    def take(self, block: bytes) -> None:
        """Take a block of whole lines after `MARGIN` line ends, or the end of the file."""
        found = None if self.layout.quoted else self._plainly(block)
        if found is not None:
            self.number += found[0].size
        else:
            found = self._strictly(block)
        self._append(found, len(block))

    def _append(self, found: Sequence[NDArray[np.float64]], size: int) -> None:
        rows = found[0].size
        if self.count + rows > self.values.shape[1]:
            whole = self.path.stat().st_size / size if not self.count else 1.5 * self.count / max(rows, 1)
            room = np.empty((len(self.chosen), self.count + int(max(1.05 * whole, 1.0) * (rows + _SAMPLE))))
            if self.count:
                room[:, : self.count] = self.values[:, : self.count]
            self.values = room  # untouched pages take no memory
        for place, column in enumerate(found):
            self.values[place, self.count : self.count + rows] = column
        self.count += rows

    def _plainly(self, block: bytes) -> list[NDArray[np.float64]] | None:
        """Parse a block at once; None if anything in it is not plain."""
        if block[-1:] != b"\n" or (b"\r" in block and block.count(b"\r") != block.count(b"\r\n")):
            return None
        usual = [place for place in self.chosen if place not in self.special]
        cells = plain(block, self.layout.separator, self.layout.decimal, self.layout.width, usual)
        if cells is None or (0 not in self.chosen and not cells.beginnings.isdisjoint(map(ord, _MARKS))):
            return None
        columns = []
        for place in self.chosen:
            if place in self.special:
                values, odd = np.empty(len(cells)), np.arange(len(cells))
            else:
                values, odd = numbers(cells, place)
                if odd.size > _ODD * values.size and not self.blank:
                    return None
            try:
                values[odd] = [self._one(cell, self.special.get(place)) for cell in cells.texts(place, odd)]
            except ValueError:
                return None
            columns.append(values)
        return columns

    def _one(self, cell: bytes, special: Reading | None) -> float:
        text = cell.decode("utf-8", errors="replace")
        text = text.replace(",", ".") if self.layout.decimal == "," else text
        if special is not None:
            return special.number(text)
        if self.blank and not text.strip():
            return math.nan
        if "_" in text or not text.isascii():
            raise ValueError(text)
        return float(text)

    def _strictly(self, block: bytes) -> list[NDArray[np.float64]]:
        """Parse a block line by line.

        Raises:
            Refused: a row of the wrong width, or a cell that is not a number.
        """
        text = block[MARGIN:].decode("utf-8", errors="replace")
        every = list(io.StringIO(text, newline=None))
        lines = list(self._whole(every))
        self.number += len(every)
        if not lines:
            return [np.empty(0)] * len(self.chosen)
        try:
            values = np.loadtxt(
                lines,
                delimiter=self.layout.separator,
                usecols=self.chosen,
                ndmin=2,
                comments=None,
                quotechar='"' if self.layout.quoted else None,
                converters={place: reading.number for place, reading in self.special.items()} or None,
            )
        except ValueError as error:
            raise _located(self.path, self.layout, self.chosen, error, self.special) from None
        return list(values.T)

    def _whole(self, lines: Sequence[str]) -> Iterator[str]:
        """Yield the rows with decimal points; refuse the first of the wrong width."""
        layout = self.layout
        for number, raw in enumerate(lines, start=self.number):
            line = raw.replace(",", ".") if layout.decimal == "," else raw
            comment = line.lstrip().startswith(COMMENT_MARKS) if line[0] in _MARKS else False
            if number < layout.first or comment or line.isspace():
                continue
            if line[-1] != "\n":
                if not _is_row(layout, self.chosen, raw, self.special):
                    self.remarks.append(f"line {number}, the last, is torn off and left out")
                    return
                above = _last_cells(self.path, layout)
                cell = layout.cells(raw)[-1]
                if len(above) >= _FEWEST and len(cell) < min(map(len, above)):
                    sure = len(above) >= _ENOUGH
                    told = f"line {number}, the last, has no end, and '{cell}' in it is shorter than all cells above it"
                    self.remarks.append(f"{told}: {'torn off, and left out' if sure else 'check whether it is whole'}")
                    if sure:
                        return
            count = len(line.split()) if layout.separator is None else line.count(layout.separator) + 1
            if count != layout.width and not layout.quoted:
                raise Refused(
                    f"{self.path}:{number}:1: {count} cells, where the rows above have {layout.width}",
                    "fix or remove the line",
                )
            yield line


def _starts_with_number(path: Path, layout: Layout, place: int) -> bool:
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        cells = layout.cells(next(islice(file, layout.first - 1, None)))
    return layout.number(cells[place]) is not None


def _last_cells(path: Path, layout: Layout) -> list[str]:
    """Return the last cells of the final rows of a file, except the last line."""
    with path.open("rb") as file:
        begin = max(0, path.stat().st_size - _TAIL)
        file.seek(begin)
        lines = file.read().decode("utf-8", errors="replace").splitlines()[1 if begin else 0 : -1]
    rows = [layout.cells(line) for line in lines]
    return [cells[-1] for cells in rows if len(cells) == layout.width and layout.number(cells[-1]) is not None]


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
    """Locate the first cell that is not a number; only such a table is read twice."""
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        for number, line in enumerate(file, start=1):
            if number < layout.first or not line.strip() or line.lstrip().startswith(COMMENT_MARKS):
                continue
            cells = layout.cells(line)
            for place in chosen:
                if place < len(cells) and not _is_read(layout, cells[place], special.get(place)):
                    column = _position(layout, line, place)
                    usual = (
                        _AS_TIMES if _CLOCK.search(cells[place]) else "fix or remove the line, or choose other columns"
                    )
                    wanted = special.get(place) or Reading(number=float, what="number", hint=usual)
                    shown = "".join(each if each.isprintable() else "?" for each in cells[place][:_SHOWN])
                    return Refused(
                        f"{path}:{number}:{column}: '{shown}' in column {place + 1} is not a {wanted.what}",
                        wanted.hint,
                    )
    return Refused(f"{path}: {error}", "fix the table")


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
