"""An audit's document as one HTML page that needs no network, on a screen and on A4 landscape.

Rows are written as they come, without a template: a document may have ten thousand of them. The script only filters;
the page is whole without it.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import groupby

from hil.audit.document import CloseOut, Compliance, Document, Gap, GapKind, OnHardware, Row, Stated
from hil.audit.pages.markup import anchor, asset, escaped, link, plain, quoted
from hil.audit.pages.overview import TONES, overview
from hil.audit.reasons import Code, Reason

__all__ = ["as_html"]

_ROWS = 100  # of one table: a browser lays out only visible ones
_REPORT = "data/report/report.html"

_GAPS = {
    GapKind.WITHOUT_CASE: "Requirements without a case",
    GapKind.WITHOUT_REQUIREMENT: "Cases without a requirement",
    GapKind.WITHOUT_CHILDREN: "Parents without a requirement below them",
    GapKind.NOT_IN_CATALOGUE: "Evidence for requirements that the catalogue does not have",
}
_GOOD = frozenset({"PASS", "RECORDED"})
_COLUMNS = ("Requirement", "Text", "Traceability", "Level, stage", "Method", "Planning", "Evidence")
_STATUS = ("Compliance", "Close-out", "Reasons")
_HEAD = "<thead><tr>" + "".join(f'<th scope="col">{name}</th>' for name in (*_COLUMNS, *_STATUS)) + "</tr></thead>"


def as_html(document: Document, reports: str) -> Iterator[str]:
    """Yield the page in pieces; equal documents give equal text.

    Args:
        document: what the audit found.
        reports: the folder of packages as a link from where the page will lie, such as `../reports`; empty for the
            page's own folder.
    """
    yield _top(document)
    yield "<main>"
    yield from overview(document)
    yield from _requirements(document.rows, quoted(reports.rstrip("/")) + "/" if reports else "")
    yield from _gaps(document.gaps)
    yield from _inputs(document)
    yield "</main>"
    yield _bottom(document)


def _top(document: Document) -> str:
    script = base64.b64encode(hashlib.sha256(asset("page.js").encode()).digest()).decode()
    policy = f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{script}'"
    name = plain(document.workspace)
    summary = document.summary
    title = f"{summary.closed} of {summary.requirements} closed · {name}"
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        f"<title>{title}</title>\n<style>\n{asset('page.css')}\n</style>\n</head>\n<body>\n"
        f'<header class="masthead"><p class="kind">Verification control document</p>'
        f'<p class="soft">{_state(document)}</p></header>\n'
    )


def _state(document: Document) -> str:
    return f"State at the end of {escaped(document.as_of)} UTC" if document.as_of else "Current state of the files"


def _requirements(rows: Sequence[Row], reports: str) -> Iterator[str]:
    codes = sorted({reason.code for row in rows for reason in row.reasons}, key=list(Code).index)
    yield '<h2 id="requirements">Requirements</h2>\n'
    yield _filters(codes)
    write = _Rows(rows, reports).row
    for first in range(0, len(rows), _ROWS):
        yield f'<section class="chunk"><table class="matrix">{_HEAD}<tbody>\n'
        yield "".join(map(write, rows[first : first + _ROWS]))
        yield "</tbody></table></section>\n"


def _filters(codes: Iterable[Code]) -> str:
    reasons = "".join(f"<option>{code.value}</option>" for code in codes)
    close_outs = "".join(f"<option>{each.value}</option>" for each in CloseOut)
    compliances = "".join(f"<option>{each.value}</option>" for each in Compliance)
    return (
        '<form class="filters" hidden><label>Search <input type="search" name="words" autocomplete="off"></label>'
        f'<label>Close-out <select name="close"><option value="">any</option>{close_outs}</select></label>'
        f'<label>Compliance <select name="comply"><option value="">any</option>{compliances}</select></label>'
        f'<label>Reason <select name="reason"><option value="">any</option>{reasons}</select></label>'
        '<button type="reset">Show all</button><output></output></form>\n'
    )


class _Rows:
    """Writes rows; what many rows share is made once."""

    def __init__(self, rows: Iterable[Row], reports: str) -> None:
        self._known = {row.id for row in rows}
        self._reports = reports
        self._packages: dict[str, str] = {}
        self._name = cache(self._link)
        self._reference = cache(self._evidence)
        self._escaped = cache(escaped)

    def row(self, row: Row) -> str:
        """Return one requirement with the ten columns of a verification control document."""
        codes = " ".join(sorted({reason.code for reason in row.reasons}))
        stage = "<br>".join(escaped(each) for each in (row.level, row.stage) if each) or _MISSING
        tone = "good" if row.closed else "open"
        return (
            f'<tr id="{anchor(row.id)}" data-s="{row.close_out.value} {row.compliance.value} {codes}">'
            f'<th scope="row">{escaped(row.id)}<span class="soft"> rev {row.rev}</span></th>'
            f"<td>{escaped(row.text)}{_anomaly(row)}</td><td>{self._traces(row)}</td><td>{stage}</td>"
            f"<td>{escaped(row.method)}<br><span class='soft'>{escaped(row.kind)}</span></td><td>{_planning(row)}</td>"
            f"<td>{self._references(row)}</td>"
            f'<td><span class="badge {TONES[row.compliance]}">{row.compliance.value}</span></td>'
            f'<td><span class="badge {tone}">{row.close_out.value}</span></td><td>{self._reasons(row)}</td></tr>\n'
        )

    def _traces(self, row: Row) -> str:
        parts = [f'<li title="serves">↑ {self._name(each)}</li>' for each in row.parents]
        parts += [f'<li title="is served by">↓ {self._name(each)}</li>' for each in row.children]
        source = f'<span class="soft">{escaped(row.source)}</span>' if row.source else ""
        return (f"<ul>{''.join(parts)}</ul>{source}" if parts else source) or _MISSING

    def _link(self, name: str) -> str:
        return link(name) if name in self._known else escaped(name)

    def _references(self, row: Row) -> str:
        if not row.evidence and not row.stated:
            return _MISSING
        told = (
            self._reference(each.verdict, each.date[:10], each.source, each.dut, each.exceptions)
            + (_CLOSES if each.closes and each.package == row.closed_by else "")
            + f"<br>{self._package(each.package)}</li>"
            for each in row.evidence
        )
        return f"<ul>{''.join(told)}{''.join(_stated(each, row) for each in row.stated)}</ul>"

    @staticmethod
    def _evidence(verdict: str, day: str, source: str, dut: str, exceptions: tuple[str, ...]) -> str:
        tone = "good" if verdict in _GOOD else "bad" if verdict == "FAIL" else "open"
        where = f' <b class="open">{escaped(source.upper())}</b>' if source != "hardware" else ""
        unit = f" · {escaped(dut)}" if dut else ""
        if exceptions:
            where += f' <b class="bad">EXCEPTION: {escaped(", ".join(exceptions))}</b>'
        return f'<li><b class="{tone}">{escaped(verdict)}</b> {escaped(day)}{unit}{where}'

    def _reasons(self, row: Row) -> str:
        if not row.reasons:
            how = "every condition holds" if row.closed_by else "closed by the requirements below it"
            return f"{'' if row.waiver else how}{_records(row)}"
        groups: dict[tuple[str, Code], list[str]] = {}
        for reason in row.reasons:
            groups.setdefault((reason.package, reason.code), []).append(self._told(reason))
        lines, last = [], ""
        for (package, code), told in sorted(groups.items(), key=lambda group: group[0][0]):  # codes stay in order
            if package != last:
                lines.append(f'<li class="of">{self._package(package)}</li>')
            last = package
            lines.append(f'<li><span class="code">{code.value}</span> {"; ".join(_alike(told))}</li>')
        return f"<ul>{''.join(lines)}</ul>{_records(row)}{_on_hardware(row.on_hardware)}"

    def _told(self, reason: Reason) -> str:
        told = self._escaped(reason.text)
        if reason.origin and reason.text.startswith(f"{reason.origin} "):
            told = f"{self._name(reason.origin)}{escaped(reason.text.removeprefix(reason.origin))}"
        elif reason.origin:
            told = f'{told} <span class="soft">from {self._name(reason.origin)}</span>'
        return told

    def _package(self, folder: str) -> str:
        found = self._packages.get(folder)
        if found is None:
            link = f"{self._reports}{quoted(folder)}/{_REPORT}"
            found = self._packages[folder] = f'<a class="package" href="{plain(link)}">{escaped(folder)}</a>'
        return found


_CLOSES = " · <b class='good'>closes it</b>"
_IS_OPEN = " is open: "
_MISSING = '<span class="missing">none</span>'


def _records(row: Row) -> str:
    """Return by which waiver a row is closed, and what waivers and closed nonconformance reports say."""
    by = f'<b class="open">closed by waiver {escaped(row.waiver)}</b>' if row.waiver else ""
    lines = "".join(f"<li>{escaped(each)}</li>" for each in row.records)
    return f'{by}<ul class="soft">{lines}</ul>' if lines else by


def _on_hardware(would: OnHardware | None) -> str:
    """Return in a line what would keep a requirement open on hardware; its reasons have been told above it."""
    if would is None:
        return ""
    codes = ", ".join(dict.fromkeys(reason.code.value for reason in would.reasons))
    told = f"open: {codes}" if codes else "<b>closed</b>"
    texts = plain("; ".join(reason.text for reason in would.reasons))
    return f'<span class="soft" title="{texts}">The same run on hardware: {told}</span>'


def _anomaly(row: Row) -> str:
    return f'<p class="anomaly"><b>Anomaly in the source</b> {escaped(row.anomaly)}</p>' if row.anomaly else ""


def _stated(each: Stated, row: Row) -> str:
    """Return what was stated without a run: method and verdict, who, and the documents with their digests."""
    tone = "good" if each.verdict in _GOOD else "bad" if each.verdict == "FAIL" else "open"
    closes = _CLOSES if each.closes and each.number == row.closed_by else ""
    who = f"{each.by} ({each.role})" + (f", witnessed by {each.witness}" if each.witness else "")
    more = "; ".join(part for part in (f"by {who}", ", ".join(each.units), each.approved) if part)
    documents = "".join(
        f'<br>{escaped(file)} <span class="soft" title="{digest}">SHA-256 {digest[:12]}…</span>'
        for file, digest in each.documents
    )
    return (
        f'<li><b class="{tone}">{escaped(each.verdict)}</b> {escaped(each.date)} · {escaped(each.method)}'
        f" {escaped(each.number)}{closes}<br>{escaped(each.statement)}"
        f'<br><span class="soft">{escaped(more)}</span>{documents}</li>'
    )


def _planning(row: Row) -> str:
    planning = row.planning
    document = " ".join(part for part in (planning.document, planning.issue) if part)
    lines = [escaped(part) for part in (document, planning.plan) if part]
    if planning.place:
        place = planning.place.removeprefix(f"{planning.plan}/") if planning.plan else planning.place
        lines.append(f'<span class="soft">{escaped(place).replace("/", "/<wbr>")}</span>')
    cases = "".join(f"<li>{escaped(case)}</li>" for case in _in_short(planning.cases))
    return ("<br>".join(lines) + (f"<ul>{cases}</ul>" if cases else "")) or _MISSING


def _alike(told: Iterable[str]) -> Iterator[str]:
    """Give sentences, those of requirements that are open for the same reasons as one."""
    groups: dict[str, list[str]] = {}
    for sentence in told:
        name, is_open, codes = sentence.partition(_IS_OPEN)
        groups.setdefault(codes if is_open else sentence, []).append(name)
    for rest, names in groups.items():
        verb = " are open: " if len(names) > 1 else _IS_OPEN
        yield rest if names == [rest] else f"{', '.join(names)}{verb}{rest}"


def _in_short(cases: Iterable[str]) -> Iterator[str]:
    """Give the names of cases without their files, those of one function together: `test_noise[x, y, z]`."""
    split = (case.rpartition("::")[2].partition("[") for case in cases)
    for name, some in groupby(split, key=lambda parts: parts[0]):
        each = [parts[2].removesuffix("]") for parts in some]
        yield f"{name}[{', '.join(each)}]" if any(each) else name


def _gaps(gaps: Sequence[Gap]) -> Iterator[str]:
    yield '<h2 id="gaps">Gaps</h2>\n'
    if not gaps:
        yield "<p>Every requirement has a case, and every case a requirement.</p>\n"
    for kind, some in groupby(gaps, key=lambda gap: gap.kind):
        found = list(some)
        yield (
            f'<h3>{_GAPS[kind]} <span class="soft">{len(found):,}</span></h3>\n<table class="gaps"><thead><tr>'
            '<th scope="col">Name</th><th scope="col">Where</th></tr></thead><tbody>\n'
        )
        for gap in found:
            where = escaped(gap.where) or _MISSING
            yield f'<tr><th scope="row">{escaped(gap.name)}</th><td>{where}</td></tr>\n'
        yield "</tbody></table>\n"


def _inputs(document: Document) -> Iterator[str]:
    inputs = document.inputs
    ledger = f"{inputs.ledger}, {inputs.entries:,} entries" if inputs.ledger else ""
    yield '<h2 id="inputs">Inputs</h2>\n<dl class="facts">'
    for label, value in (
        ("Catalogue, SHA-256", inputs.catalogue),
        ("Register of units, SHA-256", inputs.duts),
        ("Register of instruments, SHA-256", inputs.instruments),
        ("Waivers and nonconformance reports, SHA-256", inputs.records),
        ("Analysis, SHA-256", inputs.analysis),
        ("Head of the ledger", ledger),
        ("Packages", f"{len(inputs.packages):,}"),
        ("hil version", document.version),
    ):
        yield f'<div><dt>{label}</dt><dd class="mono">{escaped(value) or _MISSING}</dd></div>'
    yield "</dl>\n"
    if inputs.packages:
        yield (
            "<details><summary>Packages with their evidence digests</summary><table><thead><tr>"
            '<th scope="col">Package</th><th scope="col">Evidence digest</th></tr></thead><tbody>\n'
        )
        for folder, digest in sorted(inputs.packages.items()):
            yield f'<tr><td>{escaped(folder)}</td><td class="mono">{escaped(digest) or "not verified"}</td></tr>\n'
        yield "</tbody></table></details>\n"


def _bottom(document: Document) -> str:
    return (
        "<footer><p>The columns follow ECSS-E-ST-10-02C Rev.1, Annex B. Every status is computed from the catalogue, "
        "the registers, the ledger and the packages; none is entered by hand. Equal inputs give the "
        "same page, byte for byte.</p>"
        f"<p>hil {escaped(document.version)}</p></footer>\n<script>{asset('page.js')}</script>\n</body>\n</html>\n"
    )
