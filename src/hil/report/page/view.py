"""What a report shows of one run: frozen, in reading order, with every word and number in final form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from hil.evidence.results.outcome import CaseOutcome, RequirementOutcome
from hil.model.verdict import Verdict
from hil.report.drawing.panel import Graphic
from hil.report.sentences import Closing

__all__ = [
    "Arming",
    "BrokenRow",
    "CaseGroup",
    "CaseName",
    "CaseView",
    "CheckGroup",
    "CheckRow",
    "DocumentRow",
    "Exchange",
    "Fact",
    "GateRow",
    "Happening",
    "Headline",
    "InstrumentRow",
    "ParameterRow",
    "RecordingRow",
    "RequirementRow",
    "RunView",
    "SafeRow",
    "StepRow",
    "WireRow",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fact:
    """One field with its label; an empty value is shown as not recorded."""

    label: str
    value: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseName:
    """A case as tables name it: short where that is clear, with the place of its procedure on the page."""

    shown: str
    anchor: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DocumentRow:
    """The document that a plan's requirements are from."""

    plan: str
    id: str
    issue: str
    title: str


@dataclass(frozen=True, slots=True, kw_only=True)
class BrokenRow:
    """Cases that did not end well although none of their checks says so, and the reasons that they share."""

    named: tuple[CaseName, ...]
    verdict: Verdict
    reasons: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RequirementRow:
    """One requirement that the run covers; `demands` are its limits and the like, a line each."""

    result: RequirementOutcome
    parents: str
    level: str
    stage: str
    demands: tuple[str, ...]
    cases: tuple[tuple[CaseName, Verdict], ...]
    anomaly: str
    proofs: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckRow:
    """One evaluated criterion."""

    case: str
    named: CaseName | None
    step: str
    attempt: str
    requirement: str
    parameter: str
    of: str
    value: str
    coverage: str
    limit: str
    margin: str
    tur: str
    decision: str
    verdict: Verdict
    reason: str
    instruments: str
    derived_from: str
    closes_nothing: tuple[str, ...]
    at: str = ""
    bar: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckGroup:
    """The checks of one parameter of one requirement, and what all of them share."""

    requirement: str
    parameter: str
    limit: str
    decision: str
    rows: tuple[CheckRow, ...]
    instruments: str
    derived_from: str
    closes_nothing: tuple[str, ...]
    drawn: bool
    listed: bool
    """Whether its values stand in one list: many, recorded in one step without a limit, with nothing to say of one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Headline:
    """A figure that the plan put on the first page: the value nearest its limit, or the range of several."""

    name: str
    value: str
    at: str
    among: str
    limit: str
    verdict: Verdict
    requirement: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Exchange:
    """A question to a person and the answer."""

    form: str
    text: str
    options: str
    answer: str
    by: str
    witness: str = ""
    asked_witness: str = ""
    file: str = ""
    picture: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class GivenRow:
    """A file that a person gave in the run, or a picture that a question showed.

    Attributes:
        name: the name that it had.
        file: its path in the package.
        what: the question that it answers, or that showed it.
        kind: what it is, and its size in words.
        sha256: its hash.
        by: who gave it, empty for a picture of the plan.
        witness: who witnessed it.
        when: when it was given, UTC and bench time.
        case: the case that asked.
        image: the picture as a data URI, empty for a document and for what is too large for the page.
    """

    name: str
    file: str
    what: str
    kind: str
    sha256: str
    by: str
    witness: str
    when: str
    case: CaseName | None
    image: str


@dataclass(frozen=True, slots=True, kw_only=True)
class StepRow:
    """One step as it was run."""

    number: str
    attempt: str
    depth: int
    title: str
    begin: str
    duration: str
    outcome: str
    effects: str
    recordings: tuple[str, ...]
    exchanges: tuple[Exchange, ...]
    count: int = 1
    lasted: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingRow:
    """One recording, or several of one case that are alike: what it holds, and whether it is whole."""

    id: str
    name: str
    count: int
    channels: str
    rate: str
    duration: str
    rows: str
    gap: str
    whole: str
    source: str
    ids: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseView:
    """One case as it was run; one that never began has nothing to show but its line among those that were not run."""

    anchor: str
    begun: bool
    result: CaseOutcome
    duration: str
    attempts: str
    used: str
    steps: tuple[StepRow, ...]
    tally: str
    recordings: tuple[RecordingRow, ...]
    graphics: tuple[Graphic, ...]
    variant: str = ""
    answers: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseGroup:
    """A case, or several that differ in their parameters only and went alike; the steps are those of the first."""

    cases: tuple[CaseView, ...]
    steps: tuple[StepRow, ...]
    recordings: tuple[RecordingRow, ...]
    graphics: tuple[Graphic, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentRow:
    """One instrument of the bench file, with its calibration."""

    name: str
    driver: str
    identity: str
    certificate: str
    due: str
    ranges: tuple[str, ...]
    dut: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class WireRow:
    """One named role instance."""

    name: str
    instrument: str
    channel: str
    note: str
    settings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class GateRow:
    """One readiness gate; one that could not be tried does not count as passed."""

    name: str
    ok: bool
    tried: bool
    detail: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Arming:
    """The gates of one arming in their order; the title says which, and is empty if there was only one."""

    title: str
    gates: tuple[GateRow, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SafeRow:
    """One output, brought to its safe state and proven there, or not."""

    at: str
    output: str
    state: str
    ok: bool
    detail: str
    duration: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Happening:
    """An incident outside the procedure that a reader must know."""

    at: str
    kind: str
    case: CaseName | None
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterRow:
    """One parameter of a plan, as the plan has it."""

    plan: str
    name: str
    value: str
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RunView:
    """Everything the page shows.

    `source_word` stands on every printed page and is empty for hardware; `common` are the reasons against closing that
    concern every requirement, `proofs` what was proven of the run, `common_proofs` of every requirement; `unspoken`
    are requirements of the plans that the run is silent about, with why; `held` is when the bench was held in the
    course of cases that are not good. The verdict of a damaged package is `-`.
    """

    title: str
    subject: str
    run: str
    source_word: str
    verdict: Verdict | Literal["-"]
    headline: str
    closing: str
    warnings: tuple[tuple[str, str], ...]
    counts: tuple[tuple[str, int], ...]
    closings: tuple[Closing, ...]
    common: tuple[str, ...]
    proofs: tuple[str, ...]
    common_proofs: tuple[str, ...]
    facts: tuple[Fact, ...]
    failed: tuple[CheckRow, ...]
    broken: tuple[BrokenRow, ...]
    held: tuple[tuple[CaseName, str], ...]
    documents: tuple[DocumentRow, ...]
    requirements: tuple[RequirementRow, ...]
    unspoken: tuple[tuple[str, str], ...]
    headlines: tuple[Headline, ...]
    charts: tuple[Graphic, ...]
    checks: tuple[CheckGroup, ...]
    cases: tuple[CaseView, ...]
    procedure: tuple[CaseGroup, ...]
    not_run: tuple[tuple[str, str, str], ...]
    orphans: tuple[str, ...]
    armings: tuple[Arming, ...]
    watched: tuple[RecordingRow, ...]
    watched_graphics: tuple[Graphic, ...]
    fed: tuple[str, ...]
    safe: tuple[SafeRow, ...]
    safe_word: str
    instruments: tuple[InstrumentRow, ...]
    wiring: tuple[WireRow, ...]
    people: tuple[tuple[str, str], ...]
    given: tuple[GivenRow, ...]
    happenings: tuple[Happening, ...]
    deviations: tuple[str, ...]
    parameters: tuple[ParameterRow, ...]
    software: tuple[Fact, ...]
    content_digest: str
    evidence_digest: str
    ledger_head: str
