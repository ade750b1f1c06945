"""Published tables in CSV files, and jobs that state how they were computed from each other."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from hil.documents.declared import Document, read_document
from hil.documents.findings import Findings
from hil.documents.node import Place
from hil.documents.suggest import did_you_mean
from hil.documents.text import decoded, read_bytes
from hil.model.errors import Refused
from hil.model.notation import AnyText, Text, matching

__all__ = ["Job", "OneFormula", "Sheet", "SheetCell", "Source", "Statement", "read_job", "read_sheets"]

_SCHEMA = "hil/published-tables/1"
_DIGITS = matching("(exact|[1-9]|1[0-5])?", 'a number of digits such as "5", or exact')
_BLANK = frozenset({"", "-", "--", "\u2013", "\u2014", "n/a", "N/A"})


@dataclass(frozen=True, slots=True, kw_only=True)
class SheetCell:
    """The text of a cell and its position."""

    text: str
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """A table of texts: row and column names, and non-blank cells by row and column."""

    name: str
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    cells: Mapping[tuple[str, str], SheetCell]


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A file of tables.

    Attributes:
        file: its path, from the job's folder.
        name: of the table, that of the file by default; with `split`, what stands before each table's name.
        split: the column that says to which table a row belongs; empty where the file is one table.
        rows: the columns that name a row together; the first one by default.
        digits: significant digits to which each number was rounded, `exact` for none; empty for the digits as printed.
    """

    file: Text
    name: AnyText = ""
    split: AnyText = ""
    rows: tuple[Text, ...] = ()
    digits: Annotated[str, _DIGITS] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class OneFormula:
    """The formula of one cell."""

    row: Text
    column: Text
    formula: Text


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """Statement that a published table was computed from others.

    Attributes:
        published: its name.
        sources: tables by their names in the formulas.
        formula: of every cell that has none of its own.
        columns: formulas of columns.
        cells: formulas of single cells.
    """

    published: Text
    sources: Mapping[str, Text] = field(metadata={"alias": "from"})
    formula: AnyText = ""
    columns: Mapping[str, Text] = field(default_factory=dict)
    cells: tuple[OneFormula, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A verification job; see `docs/how-to/check-a-published-table.md`."""

    title: AnyText = ""
    source: AnyText = ""
    tables: tuple[Source, ...]
    checks: tuple[Statement, ...]


def read_job(file: Path, findings: Findings) -> Document[Job]:
    """Read a job.

    Raises:
        Refused: the file is not a job.
        ConfigurationError: with every error, each with its line and column.
    """
    document = read_document(file, str(file), findings, Job, schema=_SCHEMA)
    findings.raise_if_any()
    if document is None:
        raise Refused(f"{file}: not a job", f"begin it with schema: {_SCHEMA}")
    return document


def read_sheets(source: Source, folder: Path, findings: Findings) -> tuple[Sheet, ...]:
    """Read the tables of a file, collecting every error with its line and column."""
    file = folder / source.file
    data = read_bytes(file, str(file), findings)
    text = None if data is None else decoded(data, str(file), findings)
    return () if text is None else tuple(_Grid(text, str(file), source, findings).sheets())


class _Grid:
    """The cells of one file with their positions."""

    def __init__(self, text: str, file: str, source: Source, findings: Findings) -> None:
        self._file, self._source, self._findings = file, source, findings
        self._stem = Path(file).stem
        lines = text.split("\n")
        first = next((number for number, line in enumerate(lines) if _meant(line)), 0)
        self._separator = max(",;\t", key=lambda each: (lines[first].count(each), each == ","))
        self._rows = [
            (number, self._cells(line)) for number, line in enumerate(lines[first:], first + 1) if _meant(line)
        ]

    def sheets(self) -> list[Sheet]:
        """Return the tables of the file."""
        if len(self._rows) < 2:
            self._say(0, 0, "a table has a line of names and a row at least")
            return []
        (line, head), rows = self._rows[0], self._rows[1:]
        names = [_bare(text) for _, text in head]
        for place, name in enumerate(names):
            if name in names[:place]:
                self._say(line, head[place][0], f"two columns are called '{name}'")
        for number, cells in rows:
            if len(cells) != len(head):
                self._say(number, 1, f"this row has {len(cells)} cells, and the line of names {len(head)}")
        keys = [self._column(name, names, line) for name in self._source.rows]
        split = self._column(self._source.split, names, line) if self._source.split else None
        if len(self._findings):
            return []
        keys = keys or [next(place for place in range(len(names)) if place != split)]
        groups: dict[str, list[tuple[int, list[tuple[int, str]]]]] = {}
        for number, cells in rows:
            group = self._source.name + cells[split][1] if split is not None else self._source.name or self._stem
            groups.setdefault(group, []).append((number, cells))
        told = [place for place in range(len(names)) if place not in {*keys, split}]
        return [self._sheet(name, [names[place] for place in told], told, keys, rows) for name, rows in groups.items()]

    def _sheet(
        self,
        name: str,
        columns: list[str],
        told: list[int],
        keys: list[int],
        rows: list[tuple[int, list[tuple[int, str]]]],
    ) -> Sheet:
        found: dict[tuple[str, str], SheetCell] = {}
        seen: list[str] = []
        for number, cells in rows:
            row = " ".join(cells[place][1] for place in keys)
            if row in seen:
                self._say(number, cells[keys[0]][0], f"{name} has two rows '{row}'")
            seen.append(row)
            for column, place in zip(columns, told, strict=True):
                at, text = cells[place]
                if text not in _BLANK:
                    where = Place(path=self._file, line=number, column=at)
                    found[row, column] = SheetCell(text=text, place=where)
        filled = tuple(column for column in columns if any(key[1] == column for key in found))
        return Sheet(name=name, rows=tuple(seen), columns=filled, cells=found)

    def _column(self, name: str, names: list[str], line: int) -> int:
        if name in names:
            return names.index(name)
        self._say(line, 1, f"there is no column '{name}'{did_you_mean(name, names)}")
        return 0

    def _cells(self, line: str) -> list[tuple[int, str]]:
        """Return the cells of a line, each with its starting column."""
        cells = next(csv.reader(io.StringIO(line), delimiter=self._separator, skipinitialspace=True))
        placed, at = [], 0
        for cell in cells:
            found = line.find(cell, at)
            at = found if found >= 0 else at
            placed.append((at + 1, cell.strip()))
            at = max(line.find(self._separator, at + len(cell)), at) + 1
        if self._separator != ",":
            return [(place, _with_point(cell)) for place, cell in placed]
        return placed

    def _say(self, line: int, column: int, message: str) -> None:
        self._findings.add(Place(path=self._file, line=line, column=column), message)


def _meant(line: str) -> bool:
    return bool(line.strip()) and not line.startswith("#")


def _bare(name: str) -> str:
    """Return a column's name without its unit in square brackets."""
    return name.partition("[")[0].strip() or name


def _with_point(cell: str) -> str:
    """Return a number with a decimal comma, in a file not separated by commas, with a point."""
    whole, comma, rest = cell.partition(",")
    return f"{whole}.{rest}" if comma and whole.lstrip("+-").isdigit() and rest[:1].isdigit() else cell
