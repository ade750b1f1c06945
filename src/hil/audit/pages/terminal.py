"""An audit's document in a few terminal lines: how much is closed, and what keeps the rest open, the worst first."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from hil.audit.document import Document, GapKind, Summary
from hil.audit.reasons import Code
from hil.documents.text import counted

__all__ = ["GROUPS", "as_lines"]

_WIDTH = 80
_MOST = 10

GROUPS: Mapping[str, tuple[Code, ...]] = {
    "Failed on hardware": (Code.FAILED, Code.SUPERSEDED_BY_FAIL, Code.OPEN_NCR),
    "Damaged, missing or unknown": (
        Code.INTEGRITY,
        Code.MISSING_PACKAGE,
        Code.WITHDRAWN,
        Code.UNKNOWN_TO_LEDGER,
    ),
    "Evidence no longer holds": (
        Code.SUSPECT_REQ,
        Code.WRONG_DUT,
        Code.STALE_DUT,
        Code.STALE_CAL,
        Code.CAL_RETRO,
        Code.STALE_ANALYSIS,
        Code.EXPIRED,
    ),
    "Evidence not sufficient": (
        Code.NO_EVIDENCE,
        Code.NO_VERDICT,
        Code.SIM_ONLY,
        Code.NOT_ELIGIBLE,
        Code.UNSIGNED,
        Code.AWAITING_APPROVAL,
    ),
    "Waits for requirements below it": (Code.CHILD_OPEN, Code.NO_CHILDREN),
}
"""The codes by the action they need, the worst first."""

_GAPS = {
    GapKind.WITHOUT_CASE: "requirement without a case",
    GapKind.WITHOUT_REQUIREMENT: "case without a requirement",
    GapKind.WITHOUT_CHILDREN: "parent without a requirement below it",
    GapKind.NOT_IN_CATALOGUE: "result for a requirement that the catalogue does not have",
}


def as_lines(document: Document) -> Iterator[str]:
    """Yield the lines: wrapped to 80 columns, but for problems, which name files and stand in one line each."""
    summary = document.summary
    day = f" at the end of {document.as_of}" if document.as_of else ""
    asked = counted(summary.requirements, "requirement")
    yield f"{document.workspace}{day}: {summary.closed} of {asked} closed, {summary.open} open"
    yield "compliance: " + ", ".join(f"{count} {word}" for word, count in summary.compliance.items())
    if summary.waived:
        yield from _wrapped(f"closed by waivers: {_some(summary.waived)}")
    yield from _exceptions(document)
    yield from _others(document)
    yield from _problems(document.problems)
    yield from _why_open(summary)
    yield from _gaps(document)
    yield from _on_hardware(summary)


def _others(document: Document) -> Iterator[str]:
    if document.others:
        yield ""
        yield "parts of other packages:"
        runs = Counter(each.text for each in document.others)
        for text in list(runs)[:_MOST]:
            yield from _wrapped(f"{text} ({counted(runs[text], 'run')})", "  ", "    ")
        yield from _more(list(runs), "part")


def _exceptions(document: Document) -> Iterator[str]:
    if not document.exceptions:
        return
    closed = document.summary.by_exception
    yield ""
    yield from _wrapped("EXCEPTION: instruments that count as hardware because the bench file says so", "", "  ")
    yield f"  {counted(closed, 'requirement')} {'is' if closed == 1 else 'are'} closed by such runs"
    for each in document.exceptions[:_MOST]:
        yield f"  {each.package}"
        yield from _wrapped(f"{each.instrument}: {each.reason}", "    ")
    yield from _more(document.exceptions, "exception")


def _problems(problems: Sequence[str]) -> Iterator[str]:
    if problems:
        yield ""
        yield "Not usable"
        yield from (f"  {each}" for each in problems[:_MOST])
        yield from _more(problems, "problem")


def _why_open(summary: Summary) -> Iterator[str]:
    if not summary.reasons:
        return
    counts = {Code(code): count for code, count in summary.reasons.items()}
    digits, letters = len(str(max(counts.values()))), max(map(len, counts))
    yield ""
    yield "Open because (a requirement may be open for several reasons)"
    for title, codes in GROUPS.items():
        found = sorted((code for code in codes if code in counts), key=lambda code: -counts[code])
        if found:
            yield f"  {title}"
        for code in found:
            before = f"    {counts[code]:>{digits}}  {code:<{letters}}  "
            yield from _wrapped(code.meaning, before, " " * len(before))


def _gaps(document: Document) -> Iterator[str]:
    if not document.gaps:
        return
    yield ""
    yield "Gaps"
    for kind, title in _GAPS.items():
        names = [gap.name for gap in document.gaps if gap.kind == kind]
        if names:
            yield from _wrapped(f"{len(names)}  {title}: {_some(names)}", "  ", "     ")


def _on_hardware(summary: Summary) -> Iterator[str]:
    if not summary.elsewhere:
        return
    closed, left = len(summary.on_hardware), summary.elsewhere - len(summary.on_hardware)
    asked = counted(summary.elsewhere, "open requirement")
    yield ""
    yield f"If the same runs were made on hardware: {asked} with simulated runs"
    if closed:
        yield from _wrapped(f"{closed} would be closed: {_some(summary.on_hardware)}", "  ", "    ")
    if left:
        yield f"  {left} would stay open, because"
    shown = tuple(summary.left_open.items())[:_MOST]
    digits = len(str(max(summary.left_open.values(), default=0)))
    for text, count in shown:
        before = f"    {count:>{digits}}  "
        yield from _wrapped(text, before, " " * len(before))
    yield from _more(tuple(summary.left_open), "reason")


def _more(each: Sequence[object], noun: str) -> Iterator[str]:
    if len(each) > _MOST:
        yield f"  and {counted(len(each) - _MOST, f'more {noun}')}"


def _wrapped(text: str, first: str = "", further: str = "    ") -> Iterable[str]:
    return textwrap.wrap(
        text,
        _WIDTH,
        initial_indent=first,
        subsequent_indent=further,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _some(names: Sequence[str]) -> str:
    shown = ", ".join(names[:_MOST])
    return shown if len(names) <= _MOST else f"{shown} and {len(names) - _MOST} more"
