"""What people state and approve: nonconformance reports, waivers, and verifications without a run, each in a register.

`fixtures/nonconformances.yaml` has what went wrong and what was done about it, `fixtures/waivers.yaml` which
requirement need not be met by which unit, `fixtures/verifications.yaml` what was shown by analysis, inspection or
review, with its documents. None counts for anything until its present content is approved: the ledger has the approval,
with the content's hash.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, TypeVar

from hil.clock.wall import is_date
from hil.documents.canonical import canonical
from hil.documents.declared import Document, read_document
from hil.documents.findings import Findings
from hil.documents.suggest import did_you_mean
from hil.model.identity import Day, Dut
from hil.model.notation import AnyText, Text, matching, one_of
from hil.model.notation import Path as Keys
from hil.model.verdict import Verdict

__all__ = [
    "NONCONFORMANCES",
    "VERIFICATIONS",
    "WAIVERS",
    "Action",
    "Disposition",
    "Filing",
    "NamedDocument",
    "Nonconformance",
    "Record",
    "Records",
    "UnitName",
    "Verification",
    "Waiver",
    "load_records",
]

NONCONFORMANCES, WAIVERS, VERIFICATIONS = "nonconformances.yaml", "waivers.yaml", "verifications.yaml"
"""The files' names, in the folder of fixtures."""

_Number = Annotated[str, matching("NCR-[A-Za-z0-9._-]+", "a number such as NCR-0007")]
_WaiverNumber = Annotated[str, matching("W-[A-Za-z0-9._-]+", "a number such as W-0003")]
_INSPECTION = "inspection"
_VerificationNumber = Annotated[str, matching("V-[A-Za-z0-9._-]+", "a number such as V-0012")]
_Digest = Annotated[str, matching("[0-9a-f]{64}", "the 64 digits of the requirement's fingerprint")]
_OF_NOTHING = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
_FileDigest = Annotated[str, matching("[0-9a-f]{64}", "the 64 digits that sha256sum prints")]
_Shown = Annotated[str, one_of("analysis", _INSPECTION, "review")]
_Verdict = Annotated[str, one_of(Verdict.PASS, Verdict.FAIL, Verdict.INCONCLUSIVE)]


class Disposition(StrEnum):
    """What becomes of a unit that does not conform."""

    USE_AS_IS = "use-as-is"
    REPAIR = "repair"
    REWORK = "rework"
    SCRAP = "scrap"
    RETURN = "return"

    @property
    def needs_waiver(self) -> bool:
        """Whether the unit still does not conform afterwards, so that only a waiver can close the requirement."""
        return self is Disposition.USE_AS_IS


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitName:
    """A unit under test, as the register of units has it."""

    part: Text
    serial: Text


@dataclass(frozen=True, slots=True, kw_only=True)
class Action:
    """What was done about a nonconformance, and on which day it was complete."""

    text: Text
    date: Day


@dataclass(frozen=True, slots=True, kw_only=True)
class Nonconformance:
    """A nonconformance report.

    Attributes:
        id: its number.
        title: what is wrong, in one line.
        date: the day on which it was found.
        by: who wrote it; someone else must approve it.
        requirements: the requirements that are not met.
        units: the units that do not conform.
        run: the run that found it, if one did.
        check: the parameter whose check failed, if one did.
        cause: why it happened.
        disposition: what becomes of the units; None while undecided.
        action: what was done; None as long as it is not complete.
    """

    id: _Number
    title: Text
    date: Day
    by: Text
    requirements: tuple[Text, ...]
    units: tuple[UnitName, ...]
    run: AnyText = ""
    check: AnyText = ""
    cause: AnyText = ""
    disposition: Disposition | None = None
    action: Action | None = None

    @property
    def complete(self) -> bool:
        """Whether it has a disposition and the action taken, so that it can be approved."""
        return self.disposition is not None and (self.disposition.needs_waiver or self.action is not None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Waiver:
    """A request that a requirement need not be met by some units.

    Attributes:
        id: its number.
        title: what is accepted, in one line.
        date: the day of the request.
        until: the last day on which it counts.
        by: who requests it; someone else must approve it.
        requirement: the requirement.
        rev: its revision.
        fingerprint: its fingerprint, as its lock and the audit give it.
        units: the units that need not meet it.
        reason: why that is acceptable.
        nonconformance: the report that it belongs to, if there is one.
    """

    id: _WaiverNumber
    title: Text
    date: Day
    until: Day
    by: Text
    requirement: Text
    rev: int
    fingerprint: _Digest
    units: tuple[UnitName, ...]
    reason: Text
    nonconformance: AnyText = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedDocument:
    """A document by its path in the folder of fixtures, and its SHA-256."""

    file: Text
    sha256: _FileDigest


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """A statement that a requirement is met, or is not, by analysis, inspection or review.

    Attributes:
        id: its number.
        title: what was done, in one line.
        method: how: by `analysis`, `inspection` or `review`.
        date: the day on which it was complete.
        by: who did it.
        role: in what role, such as thermal analyst.
        requirement: the requirement.
        rev: its revision.
        fingerprint: its fingerprint, as its lock and the audit give it.
        verdict: `PASS`, `FAIL` or `INCONCLUSIVE`.
        statement: what was found, in a sentence or more.
        documents: what shows it.
        units: the units that it speaks of; an inspection is of units.
        witness: who was present, if the requirement asks for somebody.
    """

    id: _VerificationNumber
    title: Text
    method: _Shown
    date: Day
    by: Text
    role: Text
    requirement: Text
    rev: int
    fingerprint: _Digest
    verdict: _Verdict
    statement: Text
    documents: tuple[NamedDocument, ...]
    units: tuple[UnitName, ...] = ()
    witness: AnyText = ""


Filing = Nonconformance | Waiver | Verification


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """What is approved of a report, a waiver or a verification: its number, its author, its content by its hash."""

    of: Filing

    @property
    def content(self) -> bytes:
        """Its content as canonical JSON; what is left out or empty is not part of it."""
        return canonical(_told(asdict(self.of)))

    @property
    def sha256(self) -> str:
        """SHA-256 of its content: what approvals name."""
        return hashlib.sha256(self.content).hexdigest()


def _told(value: Any) -> Any:  # noqa: ANN401 - whatever a record holds
    if isinstance(value, dict):
        return {key: _told(item) for key, item in value.items() if item not in ("", (), None)}
    return [_told(item) for item in value] if isinstance(value, tuple | list) else value


@dataclass(frozen=True, slots=True, kw_only=True)
class Records:
    """The registers of a workspace, by number."""

    nonconformances: Mapping[str, Nonconformance] = field(default_factory=dict)
    waivers: Mapping[str, Waiver] = field(default_factory=dict)
    verifications: Mapping[str, Verification] = field(default_factory=dict)

    @property
    def every(self) -> tuple[Filing, ...]:
        """All of them."""
        return (*self.nonconformances.values(), *self.waivers.values(), *self.verifications.values())

    def find(self, number: str) -> Filing | None:
        """Return what has a number, None if nothing has."""
        return self.nonconformances.get(number) or self.waivers.get(number) or self.verifications.get(number)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Nonconformances:
    nonconformances: tuple[Nonconformance, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Waivers:
    waivers: tuple[Waiver, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Verifications:
    verifications: tuple[Verification, ...]


_Found = TypeVar("_Found", bound=Nonconformance | Waiver | Verification)
_Problems = Iterator[tuple[Keys, str]]


def load_records(
    fixtures: Path,
    findings: Findings,
    *,
    requirements: Mapping[str, str] | None = None,
    duts: Mapping[str, Dut] | None = None,
) -> Records:
    """Read the registers and add what is wrong to the findings; a workspace need not have them.

    Args:
        fixtures: the folder of fixtures.
        findings: where all errors are noted.
        requirements: the kind of every requirement by its id; None if names of requirements are not compared.
        duts: the units by serial number; None if names of units are not compared.
    """
    known = _Known(requirements, duts)
    first = _read(fixtures / NONCONFORMANCES, findings, _Nonconformances)
    reports = _by_number(first, "nonconformances", first.model.nonconformances, findings, known.of) if first else {}
    second = _read(fixtures / WAIVERS, findings, _Waivers)

    def of_waiver(waiver: Waiver) -> _Problems:
        yield from known.of(waiver)
        if waiver.nonconformance and waiver.nonconformance not in reports:
            yield ("nonconformance",), f"there is no report '{waiver.nonconformance}'{_near(waiver, reports)}"

    waivers = _by_number(second, "waivers", second.model.waivers, findings, of_waiver) if second else {}
    third = _read(fixtures / VERIFICATIONS, findings, _Verifications)
    shown = _by_number(third, "verifications", third.model.verifications, findings, known.of) if third else {}
    return Records(nonconformances=reports, waivers=waivers, verifications=shown)


def _near(waiver: Waiver, reports: Mapping[str, Nonconformance]) -> str:
    return did_you_mean(waiver.nonconformance, reports)


_Model = TypeVar("_Model")


def _read(path: Path, findings: Findings, model: type[_Model]) -> Document[_Model] | None:
    if not path.exists():
        return None
    schema = f"hil/{path.name.removesuffix('.yaml')}/1"
    return read_document(path, f"{path.parent.name}/{path.name}", findings, model, schema=schema)


def _by_number(
    document: Document[Any],
    key: str,
    items: tuple[_Found, ...],
    findings: Findings,
    problems: Callable[[_Found], Iterator[tuple[Keys, str]]],
) -> dict[str, _Found]:
    found: dict[str, _Found] = {}
    names: set[str] = set()
    for index, item in enumerate(items):
        at: Keys = (key, index)
        if item.id and item.id.casefold() in names:
            findings.add(document.place((*at, "id")), f"{item.id} is in the register twice")
        names.add(item.id.casefold())
        found.setdefault(item.id, item)
        for place, problem in problems(item):
            findings.add(document.place((*at, *place)), f"{item.id}: {problem}")
    return found


class _Known:
    """What a report, a waiver or a verification may name."""

    def __init__(self, requirements: Mapping[str, str] | None, duts: Mapping[str, Dut] | None) -> None:
        self._requirements, self._duts = requirements, duts

    def of(self, item: Filing) -> _Problems:
        """Yield the errors of an item: key and sentence."""
        for keys, day in _days(item):
            if day and not is_date(day):
                yield keys, f"the date {day} does not exist"
        if not item.units and not (isinstance(item, Verification) and item.method != _INSPECTION):
            yield ("units",), "name at least one unit, with part and serial number"
        for index, unit in enumerate(item.units):
            yield from ((("units", index), problem) for problem in self._unit(unit))
        if isinstance(item, Waiver | Verification):
            yield from ((("requirement",), problem) for problem in self._requirement(item.requirement))
            yield from _of_waiver(item) if isinstance(item, Waiver) else _of_verification(item)
            return
        if not item.requirements:
            yield ("requirements",), "name at least one requirement"
        if item.check and not item.run:
            yield ("check",), "name the run, too, whose check failed"
        for index, name in enumerate(item.requirements):
            yield from ((("requirements", index), problem) for problem in self._requirement(name))

    def _requirement(self, name: str) -> Iterator[str]:
        if self._requirements is None or not name:
            return
        if name not in self._requirements:
            yield f"there is no requirement '{name}'{did_you_mean(name, self._requirements)}"
        elif self._requirements[name] == "parent":
            yield f"{name} is met by the requirements below it: name those"

    def _unit(self, unit: UnitName) -> Iterator[str]:
        if self._duts is None or not unit.serial:
            return
        dut = self._duts.get(unit.serial)
        if dut is None:
            yield f"there is no unit '{unit.serial}'{did_you_mean(unit.serial, self._duts)}"
        elif dut.part != unit.part:
            yield f"{unit.serial} is of the part {dut.part}, not {unit.part}"


def _of_waiver(item: Waiver) -> _Problems:
    if item.until < item.date:
        yield ("until",), f"it counts until {item.until}, and was asked for on {item.date}"


def _of_verification(item: Verification) -> _Problems:
    if not item.documents:
        yield ("documents",), "name at least one document, with file and sha256: nothing is shown without one"
    for index, each in enumerate(item.documents):
        parts = each.file.split("/")
        if each.file and (".." in parts or "" in parts or "\\" in each.file):
            yield ("documents", index, "file"), f"'{each.file}' must be a path below the folder of fixtures"
        if each.sha256 == _OF_NOTHING:
            yield ("documents", index, "sha256"), f"this is the SHA-256 of an empty file: {each.file} shows nothing"
    if item.witness and " ".join(item.witness.casefold().split()) == " ".join(item.by.casefold().split()):
        yield ("witness",), f"{item.witness.strip()} did it, and cannot be the witness of it"


def _days(item: Filing) -> Iterator[tuple[Keys, str]]:
    yield ("date",), item.date
    if isinstance(item, Waiver):
        yield ("until",), item.until
    elif isinstance(item, Nonconformance) and item.action is not None:
        yield ("action", "date"), item.action.date
