"""What `hil analyse table` prints: the cells that do not follow for people, or one JSON document for machines."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hil.analysis.published.check import CellVerdict, CheckedCell
from hil.documents.text import counted, fitting
from hil.report.tables import aligned

if TYPE_CHECKING:
    from hil.analysis.published.printed import Key
    from hil.logs.published import Job

__all__ = ["CheckedTable", "as_json", "as_text"]

_VERBS = {  # of one cell, of several
    CellVerdict.FOLLOWS: ("follows", "follow"),
    CellVerdict.DOES_NOT_FOLLOW: ("does not", "do not"),
    CellVerdict.UNKNOWN: ("unknown", "unknown"),
}
_WIDTH = 80
_HEAD = ("row", "column", "printed", "recomputed", "")
_LONGEST = 22  # characters of a row's or a column's name in a table of 80 columns


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedTable:
    """A published table, what it was computed from, and what is said of each cell.

    Attributes:
        name: of the table.
        sources: names of the sources, by their names in the formulas.
        formulas: by row and column.
        cells: every cell that has a formula.
        places: where each stands in its file.
    """

    name: str
    sources: Mapping[str, str]
    formulas: Mapping[Key, str]
    cells: tuple[CheckedCell, ...]
    places: Mapping[Key, str]


def as_json(file: str, job: Job, tables: Sequence[CheckedTable]) -> str:
    """Return the result as one JSON document."""
    document = {
        "format": 1,
        "file": file,
        "title": job.title,
        "source": job.source,
        "status": "consistent" if not _counts(tables).keys() - {CellVerdict.FOLLOWS} else "inconsistent",
        "counts": {verdict.value: _counts(tables)[verdict] for verdict in CellVerdict},
        "tables": [
            {"published": each.name, "from": dict(each.sources), "cells": [_cell(each, cell) for cell in each.cells]}
            for each in tables
        ],
    }
    return json.dumps(document, allow_nan=False, indent=2)


def _cell(table: CheckedTable, cell: CheckedCell) -> dict[str, object]:
    key = (cell.row, cell.column)
    return {
        "row": cell.row,
        "column": cell.column,
        "at": table.places[key],
        "formula": table.formulas[key],
        "printed": cell.printed.text,
        "value": cell.printed.value,
        "verdict": cell.verdict.value,
        "low": cell.low,
        "high": cell.high,
        "reason": cell.reason,
        "causes": list(cell.causes),
    }


def as_text(file: str, job: Job, tables: Sequence[CheckedTable], *, every: bool) -> str:
    """Return the result as plain text: a part for each published table, and the sum of all."""
    lines = [f"{file}: {job.title}" if job.title else file]
    if job.source:
        lines.append(f"source: {job.source}")
    for table in tables:
        lines += ["", *_part(table, every=every)]
    lines += ["", _told(_counts(tables), f" in {counted(len(tables), 'table')}")]
    return "\n".join(fitting(lines, _WIDTH))


def _counts(tables: Sequence[CheckedTable]) -> Counter[CellVerdict]:
    return Counter(cell.verdict for each in tables for cell in each.cells)


def _told(counts: Counter[CellVerdict], where: str = "") -> str:
    total = sum(counts.values())
    said = (f"{count} {_VERBS[verdict][count != 1]}" for verdict in _VERBS if (count := counts[verdict]))
    return f"{counted(total, 'cell')}{where}: {', '.join(said)}" if total else "no cells"


def _part(table: CheckedTable, *, every: bool) -> Iterator[str]:
    formulas = {table.formulas[cell.row, cell.column] for cell in table.cells}
    sources = ", ".join(f"{name} = {meant}" for name, meant in table.sources.items())
    one = f": {next(iter(formulas))}" if len(formulas) == 1 else ""
    yield f"{table.name} from {sources}{one}"
    yield f"  {_told(Counter(cell.verdict for cell in table.cells))}"
    shown = [cell for cell in table.cells if every or cell.verdict is not CellVerdict.FOLLOWS]
    lines = aligned([_row(cell, every=every) for cell in shown], head=_HEAD, right=(2,), indent="  ")
    if shown:
        yield lines[0]
    for cell, line in zip(shown, lines[1:], strict=True):
        yield line
        if len(formulas) > 1 and cell.verdict is not CellVerdict.FOLLOWS:
            yield f"    {table.formulas[cell.row, cell.column]}"
        for words in (cell.reason, *cell.causes):
            if words:
                yield f"    - {words}"


def _row(cell: CheckedCell, *, every: bool) -> tuple[str, ...]:
    names = (_short(cell.row), _short(cell.column))
    verdict = cell.verdict.value if every else ""
    if cell.low is None or cell.high is None:
        return (*names, cell.printed.text, "unknown", "")
    return (*names, cell.printed.text, _range(cell.low, cell.high), verdict)


def _short(name: str) -> str:
    return name if len(name) <= _LONGEST else f"{name[: _LONGEST - 1]}…"


def _range(low: float, high: float) -> str:
    """Return a range as its middle and half of its width, with two digits of that."""
    middle, half = low / 2 + high / 2, high / 2 - low / 2
    if half <= 1e-12 * abs(middle):
        return f"{middle:.10g}"
    places = 1 - math.floor(math.log10(half))
    if 0 <= places <= 6 and abs(middle) < 1e7:
        return f"{middle:.{places}f} ± {half:.{places}f}"
    digits = max(2, 1 + places + math.floor(math.log10(abs(middle) or half)))
    return f"{middle:.{digits}g} ± {half:.2g}"
