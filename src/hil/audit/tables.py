"""An audit's document as canonical JSON and as CSV: equal inputs give equal bytes."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence

import msgspec

from hil.audit.document import Document, Row

__all__ = ["COLUMNS", "as_csv", "as_json", "guarded"]

COLUMNS = (
    "requirement",
    "text",
    "parents",
    "children",
    "level",
    "stage",
    "method",
    "planning",
    "evidence",
    "compliance",
    "close-out",
    "reasons",
    "on hardware",
    "records",
    "exceptions",
)
"""The columns of the table; traceability, and level and stage, have two each. The last three
say what would keep the requirement open if its newest simulated run were made on hardware,
what its waivers and nonconformance reports say, and which instruments behind its evidence
count as hardware by the word of a bench file alone."""

_FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""The first characters of a cell that a spreadsheet would compute."""


def as_json(document: Document) -> bytes:
    """Return the document as canonical JSON (RFC 8785); all of its numbers are integers."""
    return msgspec.json.encode(document, order="sorted")


def as_csv(document: Document) -> bytes:
    """Return a line per requirement as CSV in UTF-8; no cell of it is a formula to a spreadsheet."""
    written = io.StringIO()
    lines = csv.writer(written, lineterminator="\r\n")
    lines.writerow(COLUMNS)
    exceptions: dict[str, list[str]] = {}
    for each in document.exceptions:
        told = f"EXCEPTION: {each.package}: {each.instrument}: {each.reason}"
        exceptions.setdefault(each.package, []).append(told)
    lines.writerows(map(guarded, _cells(row, exceptions)) for row in document.rows)
    return written.getvalue().encode()


def _cells(row: Row, exceptions: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    planning = row.planning
    named = " ".join(part for part in (planning.document, planning.issue) if part)
    plan = (part for part in (planning.plan, named, planning.place, *planning.cases) if part)
    return (
        row.id,
        row.text,
        _lines(row.parents),
        _lines(row.children),
        row.level,
        row.stage,
        row.method,
        _lines(plan),
        _lines(
            (
                *(f"{each.date[:10]} {each.verdict} {each.package} {each.digest}".strip() for each in row.evidence),
                *(each.told for each in row.stated),
            )
        ),
        row.compliance,
        row.close_out,
        _lines(_reasons(row)),
        _on_hardware(row),
        _lines(row.records),
        _lines(told for each in row.evidence if each.exceptions for told in exceptions[each.package]),
    )


def _reasons(row: Row) -> Iterator[str]:
    if row.waiver:
        yield f"closed by waiver {row.waiver}"
    for each in row.reasons:
        yield f"{each.code}: {each.text}" + (f" ({each.package})" if each.package else "")


def _on_hardware(row: Row) -> str:
    if row.on_hardware is None:
        return ""
    return _lines(f"{each.code}: {each.text}" for each in row.on_hardware.reasons) or "closed"


def _lines(parts: Iterable[str]) -> str:
    return "\n".join(parts)


def guarded(cell: str) -> str:
    """Return a cell that no spreadsheet takes for a formula: one that begins like a formula gets an apostrophe."""
    return f"'{cell}" if cell.startswith(_FORMULA) else cell
