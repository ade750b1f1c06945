"""Documents as an audit gives them, of any size, for those that show them."""

from __future__ import annotations

from collections import Counter

from msgspec.structs import replace as changed

from hil.audit.document import (
    FORMAT,
    CloseOut,
    Compliance,
    Document,
    Evidence,
    Gap,
    GapKind,
    Inputs,
    Planning,
    Row,
    Summary,
)
from hil.audit.reasons import Code, Reason

__all__ = ["document", "document_of", "row"]

_TEXTS = (
    "The calibrated angular rate shall differ from the true rate by less than 0.5 deg/s from 10 to 45 degC.",
    "Each gyroscope axis shall be recorded at rest for at least four hours at 100 Hz without a gap over 0.1 s.",
    "The battery shall deliver at least 5.0 W.h at 0.2 C and 20 degC.",
)
_REASONS = {
    Code.SIM_ONLY: "the run's source is simulated",
    Code.NOT_ELIGIBLE: "the purpose development does not close requirements",
    Code.CAL_RETRO: "DMM-017 (certificate K-9) was found out of tolerance on 2027-09-28: what it measured is in doubt",
    Code.NO_EVIDENCE: "no package has evidence for it",
}


def row(number: int = 1, references: int = 3, **changes) -> Row:
    """Return a row: every fifth is closed, the others are open for several reasons."""
    closed = number % 5 == 0
    names = [f"20261121T{number % 24:02d}{each:02d}00Z-adcs-ADCS-FM-2-{number % 97:06x}" for each in range(references)]
    evidence = tuple(
        Evidence(
            package=name,
            digest=f"{number:064x}",
            date=f"2026-11-21T{number % 24:02d}:{place:02d}:00Z",
            verdict="PASS" if closed or place else "FAIL",
            cases=(f"testplans/gyroscope/test_rate.py::test_rate[{number}]",),
            rev=1,
            source="hardware" if closed else "simulated",
            purpose="acceptance",
            dut="ADCS-FM-2",
            eligible=closed,
            closes=closed,
        )
        for place, name in enumerate(names)
    )
    codes = list(_REASONS)[number % 3 : number % 3 + 2]
    reasons = [] if closed else [Reason(code=code, text=_REASONS[code], package=names[0]) for code in codes]
    parent = f"SYS-{number // 40:03d}"
    found = Row(
        id=f"ADCS-GYR-{number:05d}",
        rev=1,
        fingerprint=f"{number:064x}",
        text=_TEXTS[number % 3],
        kind="limit",
        method="test",
        source="gyroscope characterisation, section 30",
        parents=(parent,),
        level="equipment",
        stage="acceptance",
        planning=Planning(
            plan="testplans/gyroscope",
            document="ADCS-GYR",
            issue="1.0",
            place=f"testplans/gyroscope/requirements.yaml:{number}",
            cases=(f"testplans/gyroscope/test_rate.py::test_rate[{number}]",),
        ),
        evidence=evidence,
        compliance=Compliance.YES if closed else Compliance.PARTIAL if number % 2 else Compliance.NO,
        close_out=CloseOut.CLOSED if closed else CloseOut.OPEN,
        reasons=tuple(reasons),
        closed_by=names[-1] if closed else "",
    )
    return changed(found, **changes)


def document(rows: int, references: int = 3, **changes) -> Document:
    """Return a document of so many requirements, each with so many references to evidence."""
    found = [row(number, references) for number in range(1, rows + 1)]
    parents: dict[str, list[str]] = {}
    for each in found:
        parents.setdefault(each.parents[0], []).append(each.id)
    above = [_parent(name, children, found) for name, children in parents.items()]
    return document_of([*found, *above], **changes)


def document_of(rows: list[Row], **changes) -> Document:
    """Return a document of these rows."""
    rows = sorted(rows, key=lambda each: each.id)
    closed = sum(each.closed for each in rows)
    gaps = (
        Gap(kind=GapKind.WITHOUT_CASE, name=rows[0].id, where="testplans/gyroscope/requirements.yaml:7"),
        Gap(kind=GapKind.WITHOUT_REQUIREMENT, name="testplans/gyroscope/test_rate.py::test_drift", where="one package"),
    )
    found = Document(
        format=FORMAT,
        workspace="PoCat ADCS",
        as_of="2026-11-22",
        version="0.9.0",
        inputs=Inputs(
            catalogue="a" * 64,
            duts="b" * 64,
            ledger="c" * 64,
            entries=412,
            packages={each.package: each.digest for one in rows for each in one.evidence},
        ),
        summary=Summary(
            requirements=len(rows),
            closed=closed,
            open=len(rows) - closed,
            compliance=dict(Counter(each.compliance.value for each in rows)),
            reasons=dict(Counter(code.value for each in rows for code in {it.code for it in each.reasons})),
            gaps=dict(Counter(gap.kind.value for gap in gaps)),
            on_hardware=tuple(each.id for each in rows if each.reasons)[:2],
        ),
        rows=tuple(rows),
        gaps=gaps,
    )
    return changed(found, **changes)


def _parent(name: str, children: list[str], rows: list[Row]) -> Row:
    open_ones = [each for each in rows if each.id in set(children) and not each.closed]
    reasons = tuple(Reason(code=Code.CHILD_OPEN, text=f"{each.id} is open", origin=each.id) for each in open_ones[:3])
    return Row(
        id=name,
        rev=1,
        fingerprint="d" * 64,
        text="The attitude shall be determined to better than 2 deg.",
        kind="parent",
        method="test",
        children=tuple(children),
        level="subsystem",
        stage="acceptance",
        compliance=Compliance.PARTIAL if open_ones else Compliance.YES,
        close_out=CloseOut.OPEN if open_ones else CloseOut.CLOSED,
        reasons=reasons,
    )
