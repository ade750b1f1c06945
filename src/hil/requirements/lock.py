"""The lock of a plan: which meaning each revision of a requirement has.

`requirements.lock.json` is committed beside the plan. A meaning that changes without a new revision, a
revision that changes without a new meaning, and a requirement that vanishes are errors, for the run and
for the command that writes the lock.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from hil.documents.canonical import JsonError, parse_strict
from hil.documents.findings import Findings
from hil.documents.node import Place
from hil.requirements.layout import LOCK
from hil.requirements.requirement import Requirement

__all__ = ["Change", "ChangeKind", "Locked", "changes", "check_lock", "lock_text", "read_lock"]

_FORMAT = 1


class ChangeKind(StrEnum):
    """What happened to a requirement since it was locked."""

    ADDED = "added"
    REMOVED = "removed"
    SEMANTIC = "semantic"
    EDITORIAL = "editorial"


@dataclass(frozen=True, slots=True, kw_only=True)
class Locked:
    """What the lock says of one requirement."""

    rev: int
    fingerprint: str
    wording: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One difference between a plan and its lock."""

    id: str
    kind: ChangeKind
    detail: str


def read_lock(plan: Path, shown: str, findings: Findings) -> dict[str, Locked] | None:
    """Return the lock of a plan by id; None where there is none or it cannot be read."""
    file = plan / LOCK
    place = Place(path=f"{shown}/{LOCK}")
    if not file.exists():
        return None
    try:
        locked = _parse(parse_strict(file.read_bytes()))
    except (JsonError, OSError) as error:
        findings.add(place, f"cannot be read: {error}; {_rerun(shown)}")
        return None
    if locked is None:
        findings.add(place, f"is not a lock of format {_FORMAT}; {_rerun(shown)}")
    return locked


def check_lock(
    plan: Path, shown: str, requirements: Sequence[Requirement], findings: Findings, *, writing: bool = False
) -> None:
    """Note everything in which a plan and its lock disagree.

    Args:
        plan: the plan's folder.
        shown: the plan's path as shown to a person.
        requirements: what the plan's file says now.
        findings: where it is noted.
        writing: whether the lock is about to be written, so that what is new may be.
    """
    before = len(findings)
    locked = read_lock(plan, shown, findings)
    if locked is None:
        if not writing and len(findings) == before:
            findings.add(Place(path=f"{shown}/{LOCK}"), f"the plan is not locked, {_rerun(shown)}")
        return
    present = {item.id for item in requirements}
    for item in requirements:
        message = _disagreement(item, locked.get(item.id), shown, writing=writing)
        if message:
            findings.add(item.place, message)
    for id_ in locked:
        if id_ not in present:
            place = Place(path=f"{shown}/{LOCK}")
            findings.add(place, f"{id_} was removed from the plan, keep it there with `withdrawn: true`")


def lock_text(requirements: Sequence[Requirement]) -> str:
    """Return the text of the lock file for these requirements."""
    entries = {
        item.id: {"fingerprint": item.fingerprint, "rev": item.rev, "wording": item.wording} for item in requirements
    }
    return json.dumps({"format": _FORMAT, "requirements": entries}, indent=2, sort_keys=True) + "\n"


def changes(locked: Mapping[str, Locked], requirements: Sequence[Requirement]) -> tuple[Change, ...]:
    """Return what changed since the lock was written, by id."""
    found = []
    present = {item.id: item for item in requirements}
    for id_ in sorted({*locked, *present}):
        if id_ not in locked:
            found.append(Change(id=id_, kind=ChangeKind.ADDED, detail=f"rev {present[id_].rev}"))
        elif id_ not in present:
            found.append(Change(id=id_, kind=ChangeKind.REMOVED, detail=f"was rev {locked[id_].rev}"))
        else:
            change = _change(present[id_], locked[id_])
            if change:
                found.append(change)
    return tuple(found)


def _change(item: Requirement, was: Locked) -> Change | None:
    if item.fingerprint != was.fingerprint:
        new = f"rev {was.rev} -> {item.rev}" if item.rev != was.rev else f"still rev {item.rev}, a new rev is needed"
        return Change(id=item.id, kind=ChangeKind.SEMANTIC, detail=new)
    if item.wording != was.wording or item.rev != was.rev:
        rev = f"rev {was.rev} -> {item.rev} without a new meaning" if item.rev != was.rev else f"rev {item.rev}"
        return Change(id=item.id, kind=ChangeKind.EDITORIAL, detail=rev)
    return None


def _disagreement(item: Requirement, was: Locked | None, shown: str, *, writing: bool) -> str:
    """Return what is wrong between a requirement and its lock, an empty string where nothing is."""
    if was is None:
        return "" if writing else f"{item.id} is not locked, {_rerun(shown)}"
    if item.rev < was.rev:
        return f"the rev of {item.id} went back from {was.rev} to {item.rev}, revisions only grow"
    changed = item.fingerprint != was.fingerprint
    if item.rev == was.rev:
        return f"the meaning of {item.id} changed without a new rev, make it rev {was.rev + 1}" if changed else ""
    if not changed:
        return f"the rev of {item.id} went from {was.rev} to {item.rev} and its meaning is the same, set it back"
    return "" if writing else f"rev {item.rev} of {item.id} is not locked, {_rerun(shown)}"


def _rerun(shown: str) -> str:
    return f"run `hil requirements lock {shown}`"


def _parse(document: object) -> dict[str, Locked] | None:
    if not isinstance(document, dict) or document.get("format") != _FORMAT:
        return None
    entries = document.get("requirements")
    if not isinstance(entries, dict):
        return None
    locked = {}
    for id_, entry in entries.items():
        if not isinstance(entry, dict):
            return None
        rev, fingerprint, wording = entry.get("rev"), entry.get("fingerprint"), entry.get("wording", "")
        if not (type(rev) is int and isinstance(fingerprint, str) and isinstance(wording, str)):
            return None
        locked[id_] = Locked(rev=rev, fingerprint=fingerprint, wording=wording)
    return locked
