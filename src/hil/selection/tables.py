"""A selection as canonical JSON and as CSV: equal packages give equal bytes, in whatever order they are named."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator

import msgspec

from hil.audit.tables import guarded
from hil.documents.canonical import canonical
from hil.selection.document import Cell, Document

__all__ = ["COLUMNS", "as_csv", "as_json"]

COLUMNS = (
    "line", "role", "criterion", "parameter", "unit", "candidate", "rank", "last", "value", "uncertainty", "expanded",
    "of", "ties", "probability", "low", "high", "packages", "text",
)  # fmt: skip
"""The columns. A line is `warning`, `ranked`, `axis` (what a rank was computed from), `not judged`, `note`, `overall`,
`excluded` or `package`; the uncertainty is a standard uncertainty."""


def as_json(document: Document) -> bytes:
    """Return the selection as canonical JSON (RFC 8785)."""
    return canonical(msgspec.to_builtins(document))


def as_csv(document: Document) -> bytes:
    """Return the selection as CSV in UTF-8; no cell of it is a formula to a spreadsheet."""
    written = io.StringIO()
    lines = csv.DictWriter(written, COLUMNS, restval="", lineterminator="\r\n")
    lines.writeheader()
    for line in _lines(document):
        lines.writerow({name: _cell(value) for name, value in line.items()})
    return written.getvalue().encode()


def _cell(value: object) -> str:
    return guarded(value) if isinstance(value, str) else "" if value is None else repr(value)


def _lines(document: Document) -> Iterator[dict[str, object]]:
    for text in document.warnings:
        yield {"line": "warning", "text": text}
    for cell in document.cells:
        yield from _of_cell(cell)
    for share in document.shares:
        its = {"low": share.low, "probability": share.share, "high": share.high}
        yield {"line": "overall", "role": share.role, "candidate": share.candidate, **its}
    for each in document.excluded:
        about = {"candidate": each.candidate, "of": each.what, "packages": each.run, "text": each.reason}
        yield {"line": "excluded", **about}
    for package in document.packages:
        yield {"line": "package", "packages": package.run, "text": package.digest or "not verified"}


def _of_cell(cell: Cell) -> Iterator[dict[str, object]]:
    where = {name: getattr(cell, name) for name in ("role", "criterion", "parameter", "unit")}
    for text in cell.notes:
        yield {"line": "note", **where, "text": text}
    for each in cell.standings:
        numbers = {name: getattr(each, name) for name in ("rank", "last", "value", "uncertainty", "expanded")}
        who = {"candidate": each.candidate, "of": each.of, "ties": " ".join(each.ties)}
        yield {"line": "ranked", **where, **who, **numbers, "probability": each.probability}
        for axis in each.axes:
            known = {"value": axis.value, "uncertainty": axis.uncertainty, "of": axis.of}
            yield {"line": "axis", **where, "candidate": each.candidate, **known, "packages": " ".join(axis.packages)}
    for missing in cell.unjudged:
        yield {"line": "not judged", **where, "candidate": missing.candidate, "text": "; ".join(missing.reasons)}
