"""Reads `requirements.yaml` into requirements, with everything that is wrong in one entry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

from hil.documents.findings import Findings
from hil.documents.node import Place
from hil.documents.reader import MappingReader, read_document
from hil.requirements.requirement import Decision, Document, Kind, Limit, Method, Records, Requirement
from hil.requirements.units import check_unit

__all__ = ["RequirementFile", "read_requirements"]

_SCHEMA = "hil/requirements/1"
_ID = "[A-Z][A-Z0-9]*(-[A-Z0-9]+)*-[0-9]{2,5}"
_NAME = "[A-Za-z_][A-Za-z0-9_]*"
_LEVELS = ("part", "equipment", "subsystem", "element", "segment", "system")
_STAGES = ("qualification", "acceptance", "pre-launch", "in-orbit", "post-landing")
_PLAN_KINDS = (Kind.LIMIT, Kind.RECORD, Kind.CHARACTERISE)


@dataclass(frozen=True, slots=True, kw_only=True)
class RequirementFile:
    """What one `requirements.yaml` holds; `part_numbers` are those that the plan is for, empty where it is for any."""

    path: str
    plan: str
    document: Document
    part_numbers: tuple[str, ...] = ()
    requirements: tuple[Requirement, ...]


def read_requirements(file: Path, shown: str, plan: str, findings: Findings) -> RequirementFile | None:
    """Return what the file holds; None where it cannot be read at all, with the reason among the findings.

    Args:
        file: where it is.
        shown: its path as shown to a person.
        plan: the plan it belongs to; empty for the requirements of the workspace.
        findings: where everything that is wrong is noted.
    """
    reader = read_document(file, shown, findings, schema=_SCHEMA)
    if reader is None:
        return None
    document = _document(reader.child("document"))
    part_numbers = _part_numbers(reader) if plan else ()
    entries = reader.children("requirements", required=True)
    requirements = tuple(_requirement(entry, plan) for entry in entries)
    if not entries and reader.has("requirements"):
        findings.add(reader.place("requirements"), "there are no requirements here")
    reader.done()
    return RequirementFile(
        path=shown, plan=plan, document=document, part_numbers=part_numbers, requirements=requirements
    )


def _part_numbers(reader: MappingReader) -> tuple[str, ...]:
    if not reader.has("part_numbers"):
        return ()
    before, parts = len(reader.findings), reader.texts("part_numbers", ())
    if len(reader.findings) == before and not parts:
        wrong = "'part_numbers' must name those that the plan is for; leave it out of a plan for any"
        reader.findings.add(reader.place("part_numbers"), wrong)
    return parts


def _document(reader: MappingReader | None) -> Document:
    if reader is None:
        return Document()
    document = Document(id=reader.text("id"), issue=reader.text("issue", ""), title=reader.text("title", ""))
    reader.done()
    return document


def _requirement(reader: MappingReader, plan: str) -> Requirement:
    kinds = _PLAN_KINDS if plan else (*_PLAN_KINDS, Kind.PARENT)
    kind = reader.text("kind", choices=kinds) if plan else reader.text("kind", Kind.PARENT, choices=kinds)
    method = (
        reader.text("method", choices=tuple(Method)) if plan else reader.text("method", "test", choices=tuple(Method))
    )
    requirement = Requirement(
        id=reader.text("id", pattern=_ID),
        rev=reader.integer("rev", minimum=1),
        text=reader.text("text"),
        kind=Kind(kind) if kind else Kind.PARENT,
        method=Method(method) if method else Method.TEST,
        plan=plan,
        source=reader.text("source", ""),
        parents=reader.texts("parents", ()),
        level=reader.text("level", "", choices=_LEVELS),
        stage=reader.text("stage", "", choices=_STAGES),
        limits=tuple(_limit(entry) for entry in reader.children("limits")),
        records=_records(reader.child("records")),
        over=_over(reader.child("over")),
        withdrawn=reader.flag("withdrawn", False),
        anomaly=reader.text("anomaly", ""),
        rationale=reader.text("rationale", ""),
        place=reader.place("id"),
    )
    _check(requirement, reader)
    reader.done()
    return requirement


def _check(requirement: Requirement, reader: MappingReader) -> None:
    add, who, kind = reader.findings.add, requirement.id, requirement.kind
    if kind is Kind.LIMIT and not requirement.limits:
        add(reader.place("limits"), f"{who} is of kind limit and has no limits")
    if kind is Kind.RECORD and requirement.records is None:
        add(reader.place("records"), f"{who} is of kind record and has no records")
    if kind is Kind.RECORD and requirement.limits:
        add(reader.place("limits"), f"{who} is of kind record and has limits, make it of kind limit")
    if kind is Kind.CHARACTERISE and not requirement.limits:
        add(reader.place("limits"), f"{who} is of kind characterise, name its parameters and units under limits")
    for limit in requirement.limits:
        if kind is Kind.CHARACTERISE and limit.bounded:
            add(reader.place("limits"), f"'{limit.parameter}' of {who} has a bound, make it of kind limit")
        if kind is Kind.LIMIT and not limit.bounded:
            add(reader.place("limits"), f"'{limit.parameter}' of {who} needs min, max or equals")
    _check_once(reader.place("limits"), reader, "parameter", [limit.parameter for limit in requirement.limits])
    _check_once(reader.place("parents"), reader, "parent", list(requirement.parents))


def _limit(reader: MappingReader) -> Limit:
    before = len(reader.findings)
    # A word is found or not: no uncertainty applies to it.
    usual = Decision.SIMPLE if reader.has("equals") else Decision.GUARDED
    decision = reader.text("decision", usual, choices=tuple(Decision))
    limit = Limit(
        parameter=reader.text("parameter", pattern=_NAME),
        of=reader.texts("of", ()),
        unit=reader.text("unit", ""),
        minimum=reader.decimal("min", None),
        maximum=reader.decimal("max", None),
        equals=reader.text("equals", None),
        decision=Decision(decision) if decision else usual,
        min_tur=reader.decimal("min_tur", None),
    )
    _check_once(reader.place("of"), reader, "name", list(limit.of))
    _check_some(reader, "of", limit.of)
    if len(reader.findings) == before:
        _check_limit(limit, reader)
    reader.done()
    return limit


def _check_limit(limit: Limit, reader: MappingReader) -> None:
    add, what = reader.findings.add, f"'{limit.parameter}'"
    numbers = limit.minimum is not None or limit.maximum is not None
    if limit.equals is not None and (numbers or limit.unit or limit.min_tur):
        add(reader.place("equals"), f"{what} equals a word, so it has no unit, min, max or min_tur")
        return
    if numbers and not limit.unit:
        add(reader.node, f"{what} has a limit and no unit, write unit: '1' for a plain number")
    wrong = check_unit(limit.unit) if limit.unit else None
    if wrong:
        add(reader.place("unit"), wrong)
    if limit.minimum is not None and limit.maximum is not None and Decimal(limit.minimum) > Decimal(limit.maximum):
        add(reader.place("min"), f"min {limit.minimum} of {what} is above max {limit.maximum}")
    if limit.min_tur is not None:
        if limit.minimum is None or limit.maximum is None:
            add(reader.place("min_tur"), f"min_tur of {what} needs both min and max")
        if not Decimal(limit.min_tur) > 0:
            add(reader.place("min_tur"), f"min_tur of {what} must be above zero")


def _records(reader: MappingReader | None) -> Records | None:
    if reader is None:
        return None
    records = Records(
        recording=reader.text("recording", pattern=_NAME),
        channels=reader.texts("channels"),
        rate_hz=reader.frequency("rate", None),
        duration_s=reader.duration("duration", None),
        max_gap_s=reader.duration("max_gap", None),
    )
    _check_records(records, reader)
    reader.done()
    return records


def _check_records(records: Records, reader: MappingReader) -> None:
    """Find what any recording would meet, or none."""
    _check_once(reader.place("channels"), reader, "channel", list(records.channels))
    _check_some(reader, "channels", records.channels)
    for key, seconds in (("duration", records.duration_s), ("max_gap", records.max_gap_s)):
        if seconds == 0:
            reader.findings.add(reader.place(key), f"'{key}' of records must be longer than zero")


def _over(reader: MappingReader | None) -> dict[str, tuple[str, ...]]:
    if reader is None:
        return {}
    names = reader.keys()
    over = {name: reader.texts(name) for name in names}
    for name, values in over.items():
        if not values:
            reader.findings.add(reader.place(name), f"over '{name}' needs at least one value")
        _check_once(reader.place(name), reader, "value", list(values))
    return over


def _check_some(reader: MappingReader, key: str, names: Sequence[str]) -> None:
    if reader.has(key) and not names:
        reader.findings.add(reader.place(key), f"'{key}' needs at least one name")


def _check_once(place: Place, reader: MappingReader, what: str, names: list[str]) -> None:
    for name in dict.fromkeys(name for name in names if name and names.count(name) > 1):
        reader.findings.add(place, f"duplicate {what} '{name}'")
