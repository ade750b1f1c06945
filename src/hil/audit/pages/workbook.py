"""An audit's document as an XLSX workbook of a few sheets, every cell a text or a count.

The writer keeps one row in memory at a time. Nothing in a cell is a formula or a link, whatever it begins with.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from hil.audit.document import Document, Row
from hil.clock.wall import epoch

if TYPE_CHECKING:
    from xlsxwriter import Workbook

__all__ = ["as_xlsx"]

_LONGEST = 32_767  # characters of a cell
_MORE = " … (the rest is in the other formats)"
# What XML cannot hold, and marks that reorder or hide text: they are shown by their number.
_UNSEEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ud800-\udfff\ufffe\uffff]"
)

_REQUIREMENTS = (
    ("Requirement", 18),
    ("Text", 50),
    ("Traceability", 18),
    ("Levels and stages", 14),
    ("Methods", 10),
    ("Planning documents", 34),
    ("References to evidence", 52),
    ("Status of compliance", 12),
    ("Close-out status", 10),
    ("Reasons of the close-out status", 60),
)
_EVIDENCE = (
    ("Requirement", 18),
    ("Package", 46),
    ("Evidence digest", 66),
    ("Date", 21),
    ("Verdict", 14),
    ("Source", 11),
    ("Purpose", 14),
    ("Unit under test", 16),
    ("Closes it", 9),
    ("Reasons", 60),
    ("Exceptions", 24),
)
_ON_HARDWARE = (("Requirement", 18), ("Package", 46), ("Would be", 10), ("Reasons", 80))
_RECORDS = (("Requirement", 18), ("Waiver or nonconformance", 100))
_GAPS = (("Gap", 32), ("Name", 50), ("Where", 60))

_Cells = Iterable[str | int]


def as_xlsx(document: Document) -> bytes:
    """Return the workbook; equal documents give equal bytes."""
    from xlsxwriter import Workbook  # noqa: PLC0415 - heavy

    written = io.BytesIO()
    options = {"constant_memory": True, "strings_to_formulas": False, "strings_to_urls": False}
    book = Workbook(written, options)
    book.set_properties({"title": "Verification control document", "author": "hil", "created": epoch()})
    sheets = _Sheets(book)
    sheets.add("Summary", (("", 44), ("", 80)), _summary(document), head=False)
    sheets.add("Requirements", _REQUIREMENTS, map(_requirement, document.rows))
    sheets.add("Evidence", _EVIDENCE, (cells for row in document.rows for cells in (*_evidence(row), *_stated(row))))
    sheets.add("On hardware", _ON_HARDWARE, (cells for row in document.rows for cells in _on_hardware(row)))
    sheets.add("Records", _RECORDS, ((row.id, each) for row in document.rows for each in row.records))
    sheets.add("Gaps", _GAPS, ((gap.kind.value, gap.name, gap.where) for gap in document.gaps))
    book.close()
    return written.getvalue()


class _Sheets:
    """Writes sheets of rows into a workbook."""

    def __init__(self, book: Workbook) -> None:
        self._book = book
        self._wrapped = book.add_format({"text_wrap": True, "valign": "top"})
        self._bold = book.add_format({"bold": True, "bottom": 1, "text_wrap": True})

    def add(self, name: str, columns: Iterable[tuple[str, int]], rows: Iterable[_Cells], *, head: bool = True) -> None:
        """Add a sheet: columns with their widths, and rows as they come."""
        sheet = self._book.add_worksheet(name)
        sheet.set_landscape()
        sheet.set_paper(9)
        sheet.fit_to_pages(1, 0)
        titles = [title for title, _ in columns]
        for place, (_, width) in enumerate(columns):
            sheet.set_column(place, place, width)
        if head:
            sheet.freeze_panes(1, 1)
            sheet.repeat_rows(0)
            for place, title in enumerate(titles):
                sheet.write_string(0, place, title, self._bold)
        last = 0
        for last, cells in enumerate(rows, 1 if head else 0):
            for place, cell in enumerate(cells):
                if isinstance(cell, int):
                    sheet.write_number(last, place, cell, self._wrapped)
                elif cell:
                    sheet.write_string(last, place, _cell(cell), self._wrapped)
        if head:
            sheet.autofilter(0, 0, last, len(titles) - 1)


def _cell(text: str) -> str:
    shown = _UNSEEN.sub(lambda match: f"U+{ord(match[0]):04X}", text)
    return shown if len(shown) <= _LONGEST else shown[: _LONGEST - len(_MORE)] + _MORE


def _summary(document: Document) -> Iterator[_Cells]:
    summary, inputs = document.summary, document.inputs
    yield "Verification control document", document.workspace
    yield "State", f"at the end of {document.as_of} UTC" if document.as_of else "of the files as they are now"
    yield "Requirements", summary.requirements
    yield "Closed", summary.closed
    yield "Open", summary.open
    yield "Closed by waivers", ", ".join(summary.waived)
    for title, counts in (("Compliance", summary.compliance), ("Open for", summary.reasons), ("Gaps", summary.gaps)):
        yield from ((f"{title}: {name}", count) for name, count in sorted(counts.items()))
    yield from (
        ("EXCEPTION: hardware by the bench file's word alone", f"{each.package}: {each.instrument}: {each.reason}")
        for each in document.exceptions
    )
    yield from (("Part of another package", f"{each.package}: {each.text}") for each in document.others)
    yield from (("Not usable", problem) for problem in document.problems)
    yield "Catalogue, SHA-256", inputs.catalogue
    yield "Register of units, SHA-256", inputs.duts
    yield "Register of instruments, SHA-256", inputs.instruments
    yield "Waivers and nonconformance reports, SHA-256", inputs.records
    yield "Analysis, SHA-256", inputs.analysis
    yield "Head of the ledger", inputs.ledger
    yield "Packages", len(inputs.packages)
    yield "hil version", document.version
    yield "Columns", "follow ECSS-E-ST-10-02C Rev.1, Annex B"


def _requirement(row: Row) -> _Cells:
    planning = row.planning
    named = " ".join(part for part in (planning.document, planning.issue) if part)
    return (
        row.id,
        row.text,
        _lines((*(f"serves {each}" for each in row.parents), *(f"served by {each}" for each in row.children))),
        _lines((row.level, row.stage)),
        row.method,
        _lines((named, planning.plan, planning.place, *planning.cases)),
        _lines(
            (
                *(f"{each.verdict} {each.date[:10]} {each.source} {each.package}" for each in row.evidence),
                *(each.told for each in row.stated),
            )
        ),
        row.compliance.value,
        row.close_out.value,
        _lines(
            (
                f"closed by waiver {row.waiver}" if row.waiver else "",
                *(
                    f"{each.code.value}: {each.text}{f', from {each.origin}' if each.origin else ''}"
                    for each in row.reasons
                ),
            )
        ),
    )


def _evidence(row: Row) -> Iterator[_Cells]:
    for each in row.evidence:
        reasons = _lines(f"{reason.code.value}: {reason.text}" for reason in each.reasons)
        closes = "yes" if each.closes else "no"
        yield (
            row.id,
            each.package,
            each.digest,
            each.date,
            each.verdict,
            each.source,
            each.purpose,
            each.dut,
            closes,
            reasons,
            _lines(each.exceptions),
        )


def _stated(row: Row) -> Iterator[_Cells]:
    """Give what was stated without a run in the columns of evidence: the documents take the place of the digest."""
    for each in row.stated:
        documents = _lines(f"{file} {digest}" for file, digest in each.documents)
        reasons = _lines(f"{reason.code.value}: {reason.text}" for reason in each.reasons)
        closes = "yes" if each.closes else "no"
        who = f"{each.by} ({each.role})"
        units = _lines(each.units)
        yield row.id, each.number, documents, each.date, each.verdict, each.method, who, units, closes, reasons, ""


def _on_hardware(row: Row) -> Iterator[_Cells]:
    if would := row.on_hardware:
        reasons = _lines(f"{each.code.value}: {each.text}" for each in would.reasons)
        yield row.id, would.package, "open" if would.reasons else "closed", reasons


def _lines(parts: Iterable[str]) -> str:
    return "\n".join(part for part in parts if part)
