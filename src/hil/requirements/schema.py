"""Reads `requirements.yaml` into requirements, with everything that is wrong in one file."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import lru_cache
from pathlib import Path as File

from hil.documents import declared
from hil.documents.findings import Findings
from hil.documents.node import Place
from hil.documents.text import read_bytes
from hil.model.notation import Path, Text
from hil.requirements.requirement import Decision, Document, Kind, Limit, PlannedRequirement, Records, Requirement
from hil.requirements.units import check_unit

__all__ = ["REQUIREMENTS", "RequirementFile", "parse_requirements", "read_requirements"]

REQUIREMENTS = "requirements.yaml"
"""The file of requirements, in the folder of a plan or of all testplans."""

_SCHEMA = "hil/requirements/1"
_UNSEEN = re.compile(
    "[\xad\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180f\u206a-\u206f\u3164\ufe00-\ufe0f\uffa0\U000e0000-\U000e0fff]"
)
"""Letters, selectors and tags that show nothing: what every YAML file must not hold is refused before."""
_KEPT = 64
"""How many contents of files are remembered."""

_Wrong = Iterator[tuple[Path, str]]
"""What is wrong, and at which path of the file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Workspace:
    """`testplans/requirements.yaml`."""

    document: Document | None = None
    requirements: tuple[Requirement, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Plan:
    """`testplans/<plan>/requirements.yaml`."""

    document: Document | None = None
    part_numbers: tuple[Text, ...] = ()
    requirements: tuple[PlannedRequirement, ...]


_Read = declared.Document[_Plan] | declared.Document[_Workspace]


@dataclass(frozen=True, slots=True, kw_only=True)
class RequirementFile:
    """What one `requirements.yaml` holds; `part_numbers` are those that the plan is for, empty if it is for any."""

    path: str
    plan: str
    document: Document
    part_numbers: tuple[str, ...] = ()
    requirements: tuple[Requirement, ...]


def read_requirements(file: File, shown: str, plan: str, findings: Findings) -> RequirementFile | None:
    """Return what the file holds; None if it cannot be read at all, with the reason among the findings.

    Args:
        file: where it is.
        shown: its path as shown to a person.
        plan: the plan it belongs to; empty for the requirements of the workspace.
        findings: where all errors are noted.
    """
    data = read_bytes(file, shown, findings)
    return None if data is None else parse_requirements(data, shown, plan, findings)


def parse_requirements(data: bytes, shown: str, plan: str, findings: Findings) -> RequirementFile | None:
    """Return what the content of a file holds, as `read_requirements` does; equal contents are read once.

    A workspace and the packages of its runs hold the same files many times. Who does not show places leaves `shown`
    empty.
    """
    sound = _sound(data, plan)
    if sound is None:
        return _parsed(data, shown, plan, findings)
    if not shown:
        return sound
    placed = (
        replace(item, place=Place(path=shown, line=item.place.line, column=item.place.column))
        for item in sound.requirements
    )
    return replace(sound, path=shown, requirements=tuple(placed))


@lru_cache(maxsize=_KEPT)
def _sound(data: bytes, plan: str) -> RequirementFile | None:
    """Return what the content of a file holds; None if anything is wrong with it."""
    findings = Findings()
    found = _parsed(data, "", plan, findings)
    return None if findings else found


def _parsed(data: bytes, shown: str, plan: str, findings: Findings) -> RequirementFile | None:
    read: _Read | None
    if plan:
        read = declared.parse_document(data, shown, findings, _Plan, schema=_SCHEMA)
    else:
        read = declared.parse_document(data, shown, findings, _Workspace, schema=_SCHEMA)
    if read is None:
        return None
    for path, message in _problems(read):
        findings.add(read.place(path), message)
    return RequirementFile(
        path=shown,
        plan=plan,
        document=read.model.document or Document(id=""),
        part_numbers=read.model.part_numbers if isinstance(read.model, _Plan) else (),
        requirements=tuple(_placed(read, index, plan) for index in range(len(read.model.requirements))),
    )


def _placed(read: _Read, index: int, plan: str) -> Requirement:
    """Return a requirement that knows where it stands, and whose limits on words are judged without uncertainty."""
    at: Path = ("requirements", index)
    found = read.model.requirements[index]
    simple = [
        replace(limit, decision=Decision.SIMPLE)
        if limit.equals is not None and not read.has((*at, "limits", place, "decision"))
        else limit
        for place, limit in enumerate(found.limits)
    ]
    return replace(found, plan=plan, place=read.place((*at, "id")), limits=tuple(simple))


def _problems(read: _Read) -> _Wrong:
    parts = ("part_numbers",)
    if read.is_sound(parts) and read.has(parts) and isinstance(read.model, _Plan) and not read.model.part_numbers:
        yield parts, "'part_numbers' must name those that the plan is for; leave it out of a plan for any"
    if read.is_sound(("requirements",)) and not read.model.requirements:
        yield ("requirements",), "there are no requirements here"
    for index, item in enumerate(read.model.requirements):
        at: Path = ("requirements", index)
        if read.is_sound((*at, "kind")):
            yield from (each for each in _kind_problems(at, item) if not read.follows(each[0]))
        yield from _once((*at, "limits"), "parameter", [limit.parameter for limit in item.limits])
        yield from _once((*at, "parents"), "parent", item.parents)
        for place, limit in enumerate(item.limits):
            inner = (*at, "limits", place)
            yield from _names(read, (*inner, "of"), "name", limit.of)
            if read.is_sound(inner):
                yield from _limit_problems(inner, limit)
        yield from _other_problems(read, at, item)


def _other_problems(read: _Read, at: Path, item: Requirement) -> _Wrong:
    if unseen := _UNSEEN.search(item.text):
        yield (*at, "text"), f"the text holds character U+{ord(unseen[0]):04X}, which is invisible: remove it"
    if item.records is not None:
        yield from _names(read, (*at, "records", "channels"), "channel", item.records.channels)
        yield from _length_problems(read, (*at, "records"), item.records)
    for name, values in item.over.items():
        if not values and read.is_sound((*at, "over", name)):
            yield (*at, "over", name), f"over '{name}' needs at least one value"
        yield from _once((*at, "over", name), "value", values)


def _kind_problems(at: Path, item: Requirement) -> _Wrong:
    who, kind = item.id, item.kind
    limits = (*at, "limits")
    if kind is Kind.LIMIT and not item.limits:
        yield limits, f"{who} is of kind limit and has no limits"
    if kind is Kind.RECORD and item.records is None:
        yield (*at, "records"), f"{who} is of kind record and has no records"
    if kind is Kind.RECORD and item.limits:
        yield limits, f"{who} is of kind record and has limits, make it of kind limit"
    if kind is Kind.CHARACTERISE and not item.limits:
        yield limits, f"{who} is of kind characterise, name its parameters and units under limits"
    for limit in item.limits:
        if kind is Kind.CHARACTERISE and limit.bounded:
            yield limits, f"'{limit.parameter}' of {who} has a bound, make it of kind limit"
        if kind is Kind.LIMIT and not limit.bounded:
            yield limits, f"'{limit.parameter}' of {who} needs min, max or equals"


def _limit_problems(at: Path, limit: Limit) -> _Wrong:
    what = f"'{limit.parameter}'"
    numbers = limit.minimum is not None or limit.maximum is not None
    if limit.equals is not None and (numbers or limit.unit or limit.min_tur):
        yield (*at, "equals"), f"{what} equals a word, so it has no unit, min, max or min_tur"
        return
    if numbers and not limit.unit:
        yield at, f"{what} has a limit and no unit, write unit: '1' for a plain number"
    wrong = check_unit(limit.unit) if limit.unit else None
    if wrong:
        yield (*at, "unit"), wrong
    if limit.minimum is not None and limit.maximum is not None and Decimal(limit.minimum) > Decimal(limit.maximum):
        yield (*at, "min"), f"min {limit.minimum} of {what} is above max {limit.maximum}"
    same = limit.minimum is not None and limit.maximum is not None and Decimal(limit.minimum) == Decimal(limit.maximum)
    if same and limit.decision is Decision.GUARDED:
        told = "no value with an uncertainty is between; write decision: simple for a count"
        yield (*at, "min"), f"min and max of {what} are the same: {told}"
    if limit.min_tur is not None:
        if limit.minimum is None or limit.maximum is None:
            yield (*at, "min_tur"), f"min_tur of {what} needs both min and max"
        if not Decimal(limit.min_tur) > 0:
            yield (*at, "min_tur"), f"min_tur of {what} must be above zero"


def _length_problems(read: _Read, at: Path, records: Records) -> _Wrong:
    for key, seconds in (("duration", records.duration_s), ("max_gap", records.max_gap_s)):
        if seconds == 0 and read.is_sound((*at, key)):
            yield (*at, key), f"'{key}' of records must be longer than zero"


def _names(read: _Read, at: Path, what: str, names: Sequence[str]) -> _Wrong:
    if not names and read.has(at) and read.is_sound(at):
        yield at, f"'{at[-1]}' needs at least one name"
    yield from _once(at, what, names)


def _once(at: Path, what: str, names: Iterable[str]) -> _Wrong:
    listed = list(names)
    if len(listed) == len({*listed}):
        return
    for name in dict.fromkeys(name for name in listed if name and listed.count(name) > 1):
        yield at, f"duplicate {what} '{name}'"
