"""The document that an audit gives: a row per requirement, with everything that keeps it open."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum

import msgspec

from hil.audit.reasons import Code, Reason

__all__ = [
    "FORMAT",
    "CloseOut",
    "Compliance",
    "Document",
    "Evidence",
    "Exempted",
    "Gap",
    "GapKind",
    "Inputs",
    "OnHardware",
    "OtherCode",
    "Planning",
    "Row",
    "Stated",
    "Summary",
    "summary_of",
]

FORMAT = 1
"""The number of the document's format."""


class Compliance(StrEnum):
    """Whether a requirement is met, as far as the evidence that counts shows it."""

    YES = "yes"
    PARTIAL = "partial"
    """Evidence from hardware is good, but not every condition holds; or part of the children are met; or a waiver
    closes it."""
    NO = "no"


class CloseOut(StrEnum):
    """Whether a requirement is closed."""

    OPEN = "open"
    CLOSED = "closed"


class Evidence(msgspec.Struct, frozen=True, kw_only=True):
    """What one package says of one requirement.

    Attributes:
        package: the folder of the package below the reports.
        digest: its evidence digest, empty if the package is not verified.
        date: UTC of its end, ISO 8601.
        verdict: its verdict on the requirement.
        cases: the ids of the cases that carry the requirement.
        rev: the revision of the requirement that it was judged against; 0 if it is not recorded.
        source: where the run's bytes came from.
        purpose: why the run was made.
        dut: serial number of the device under test.
        eligible: whether the run's own results say that it can close the requirement.
        closes: whether every condition holds for it now, so that it closes the requirement.
        reasons: why it does not, each with its code.
        exceptions: the instruments of the run that count as hardware by the word of the bench file alone.
    """

    package: str
    digest: str
    date: str
    verdict: str
    cases: tuple[str, ...]
    rev: int
    source: str
    purpose: str
    dut: str
    eligible: bool
    closes: bool
    reasons: tuple[Reason, ...] = ()
    exceptions: tuple[str, ...] = ()


class Stated(msgspec.Struct, frozen=True, kw_only=True):
    """What was stated of one requirement without a run: by analysis, inspection or review.

    Attributes:
        number: the number of the verification.
        method: how it was made.
        date: the day, ISO 8601.
        verdict: its verdict.
        by: who made it.
        role: in what role.
        statement: what was found.
        documents: file and SHA-256 of what shows it.
        units: the units that it speaks of, by part and serial number.
        witness: who was present, empty if nobody is named.
        approved: who approved it, and when; empty if nobody did.
        closes: whether every condition holds for it now, so that it closes the requirement.
        reasons: why it does not, each with its code.
    """

    number: str
    method: str
    date: str
    verdict: str
    by: str
    role: str
    statement: str
    documents: tuple[tuple[str, str], ...]
    units: tuple[str, ...] = ()
    witness: str = ""
    approved: str = ""
    closes: bool = False
    reasons: tuple[Reason, ...] = ()

    @property
    def told(self) -> str:
        """All of it in a line, but for the reasons."""
        who = f"{self.by} ({self.role})" + (f", witnessed by {self.witness}" if self.witness else "")
        shown = ", ".join(f"{file} {digest}" for file, digest in self.documents)
        units = f" of {', '.join(self.units)}" if self.units else ""
        approved = f"; {self.approved}" if self.approved else ""
        return f"{self.date} {self.verdict} {self.number} {self.method}{units} by {who}: {shown}{approved}"


class Exempted(msgspec.Struct, frozen=True, kw_only=True, order=True):
    """An instrument of a run that counts as hardware although nothing but the bench file says so.

    Attributes:
        package: the folder of the run's package.
        instrument: its name.
        reason: why, as the bench file declares it.
    """

    package: str
    instrument: str
    reason: str


class OtherCode(msgspec.Struct, frozen=True, kw_only=True, order=True):
    """What the run of a package used of another package than hil, and whether that counts, in a sentence."""

    package: str
    text: str


class OnHardware(msgspec.Struct, frozen=True, kw_only=True):
    """What a run that was not on hardware would leave open if it were.

    Attributes:
        package: the folder of the run's package, empty where runs of the requirements below tell.
        reasons: why the requirement would still be open; none if it would be closed.
    """

    package: str = ""
    reasons: tuple[Reason, ...] = ()


class Planning(msgspec.Struct, frozen=True, kw_only=True):
    """Where it is planned how a requirement is verified.

    Attributes:
        plan: the plan's folder, relative to the workspace; empty for a requirement of the workspace.
        document: the id of the document that the plan's requirements stand for.
        issue: its issue.
        place: file and line of the requirement.
        cases: the cases that carry it, from the newest package or from the plan's sources.
    """

    plan: str = ""
    document: str = ""
    issue: str = ""
    place: str = ""
    cases: tuple[str, ...] = ()


class Row(msgspec.Struct, frozen=True, kw_only=True):
    """One requirement: the ten columns of a verification control document.

    Attributes:
        id: the requirement's id.
        rev: its revision now.
        fingerprint: SHA-256 of its meaning now.
        text: its text.
        kind: `limit`, `record`, `characterise` or `parent`.
        source: where it comes from.
        anomaly: what is wrong with the text at its source.
        parents: ids of the requirements that it serves.
        children: ids of the requirements that serve it.
        level: level of verification, empty if the catalogue does not give it.
        stage: stage of verification, likewise.
        method: its verification method.
        planning: plan, document and cases.
        evidence: what the packages say of it, the oldest first.
        compliance: whether it is met.
        close_out: whether it is closed.
        reasons: why it is open, all that apply, its own before inherited ones; empty if it is closed.
        on_hardware: what the newest run elsewhere would leave open on hardware; None without such a run, or if the
            requirement is closed.
        stated: what was stated of it without a run, the oldest first.
        closed_by: the folder of the package, or the number of the verification, that closes it; empty if it is open, or
            closed by its children or a waiver.
        waiver: the number of the waiver without which it would be open; empty if it needs none.
        records: what its waivers and its closed nonconformance reports say, a sentence each.
    """

    id: str
    rev: int
    fingerprint: str
    text: str
    kind: str
    method: str
    source: str = ""
    anomaly: str = ""
    parents: tuple[str, ...] = ()
    children: tuple[str, ...] = ()
    level: str = ""
    stage: str = ""
    planning: Planning = Planning()
    evidence: tuple[Evidence, ...] = ()
    stated: tuple[Stated, ...] = ()
    compliance: Compliance = Compliance.NO
    close_out: CloseOut = CloseOut.OPEN
    reasons: tuple[Reason, ...] = ()
    on_hardware: OnHardware | None = None
    closed_by: str = ""
    waiver: str = ""
    records: tuple[str, ...] = ()

    @property
    def closed(self) -> bool:
        """Whether it is closed."""
        return self.close_out is CloseOut.CLOSED


class GapKind(StrEnum):
    """What is missing between requirements, cases and parents."""

    WITHOUT_CASE = "requirement without case"
    WITHOUT_REQUIREMENT = "case without requirement"
    WITHOUT_CHILDREN = "parent without children"
    NOT_IN_CATALOGUE = "evidence without requirement"


class Gap(msgspec.Struct, frozen=True, kw_only=True, order=True):
    """One gap; `name` is the id of a requirement or of a case, `where` its file or the package that has it."""

    kind: GapKind
    name: str
    where: str = ""


class Inputs(msgspec.Struct, frozen=True, kw_only=True):
    """What the document was computed from; equal inputs give equal bytes.

    Attributes:
        catalogue: SHA-256 over the fingerprints of all requirements.
        duts: SHA-256 of the register of devices under test, empty without one.
        instruments: SHA-256 of the register of instruments, empty without one.
        records: SHA-256 over the nonconformance reports and the waivers, empty without any.
        analysis: SHA-256 over the analysis and the judging of the version that computed it.
        ledger: head of the ledger, empty without one.
        entries: how many entries the ledger has up to that head.
        packages: folder and evidence digest of every package that was read, empty for one that is not verified.
    """

    catalogue: str
    duts: str = ""
    instruments: str = ""
    records: str = ""
    analysis: str = ""
    ledger: str = ""
    entries: int = 0
    packages: Mapping[str, str] = {}


class Summary(msgspec.Struct, frozen=True, kw_only=True):
    """How many requirements there are, by status.

    Attributes:
        requirements: how many there are; withdrawn ones are left out once nothing of them is open.
        closed: how many of them are closed.
        open: how many are open.
        compliance: how many there are of each compliance.
        reasons: how many requirements each code keeps open.
        gaps: how many gaps there are of each kind.
        elsewhere: how many open requirements have evidence from simulated benches or replays.
        on_hardware: ids of those of them that the same runs on hardware would close.
        left_open: what would keep the others open on hardware, and how many of them.
        by_exception: how many requirements are closed by a run in which an exception was declared.
        waived: ids of those that are closed by waivers.
    """

    requirements: int
    closed: int
    open: int
    compliance: Mapping[str, int]
    reasons: Mapping[str, int]
    gaps: Mapping[str, int]
    elsewhere: int = 0
    on_hardware: tuple[str, ...] = ()
    left_open: Mapping[str, int] = {}
    by_exception: int = 0
    waived: tuple[str, ...] = ()


class Document(msgspec.Struct, frozen=True, kw_only=True):
    """The whole document.

    Attributes:
        format: the number of its format.
        workspace: the name of the workspace.
        as_of: the day at whose end the state is told, ISO 8601; empty for the state now.
        version: the version of hil that computed it.
        inputs: what it was computed from.
        summary: the counts.
        rows: a row per requirement, by id.
        gaps: everything that is missing, by kind and name.
        problems: packages that cannot be used, and what is wrong with the ledger, a sentence each.
        exceptions: what counts as hardware by the word of a bench file alone, by package and instrument.
        others: drivers and the like of other packages than hil, by package.
    """

    format: int
    workspace: str
    as_of: str
    version: str
    inputs: Inputs
    summary: Summary
    rows: tuple[Row, ...]
    gaps: tuple[Gap, ...]
    problems: tuple[str, ...] = ()
    exceptions: tuple[Exempted, ...] = ()
    others: tuple[OtherCode, ...] = ()


def summary_of(rows: Sequence[Row], gaps: Sequence[Gap]) -> Summary:
    """Return the counts of a document."""
    closed = sum(row.closed for row in rows)
    counted = Counter(code for row in rows for code in {reason.code for reason in row.reasons})
    compliance = Counter(row.compliance for row in rows)
    elsewhere = [(row, row.on_hardware) for row in rows if row.on_hardware]
    return Summary(
        requirements=len(rows),
        closed=closed,
        open=len(rows) - closed,
        compliance={each.value: compliance[each] for each in Compliance},
        reasons={code.value: counted[code] for code in Code if counted[code]},
        gaps={str(kind): count for kind, count in sorted(Counter(gap.kind for gap in gaps).items())},
        elsewhere=len(elsewhere),
        on_hardware=tuple(row.id for row, would in elsewhere if not would.reasons),
        left_open=_left_open(would for _, would in elsewhere),
        waived=tuple(row.id for row in rows if row.waiver),
        by_exception=sum(each.package == row.closed_by for row in rows for each in row.evidence if each.exceptions),
    )


def _left_open(each: Iterable[OnHardware]) -> dict[str, int]:
    """Return every reason that would keep requirements open on hardware, the one of most requirements first."""
    counted = Counter(text for would in each for text in {_left_text(reason) for reason in would.reasons})
    return dict(sorted(counted.items(), key=lambda item: (-item[1], item[0])))


def _left_text(reason: Reason) -> str:
    return "a requirement below it would stay open" if reason.code is Code.CHILD_OPEN else reason.text
