"""The lock of a plan: which meaning each revision of a requirement has.

`requirements.lock.json` is committed beside the plan. A meaning that changes without a new revision, a
revision that changes without a new meaning, and a requirement that vanishes are errors, for the run and
for the command that writes the lock.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import lru_cache
from pathlib import Path
from typing import Literal

from hil.documents.canonical import JsonError, digest, parse_strict
from hil.documents.declared import Invalid, read_json
from hil.documents.findings import Findings
from hil.documents.node import Place
from hil.documents.text import is_there, read_bytes
from hil.model.notation import Path as Keys
from hil.requirements.requirement import Requirement

__all__ = ["LOCK", "Change", "ChangeKind", "Locked", "changes", "check_lock", "lock_text", "locked_revs", "read_lock"]

LOCK = "requirements.lock.json"
"""The file of a plan's lock, in its folder."""

_FORMAT = 1
_SHORT = 60
_KEPT = 64
"""How many contents of files are remembered."""
_NONE = "nothing"
_TAKE_BACK = "restore it from version control"  # the command refuses it, too: it would lose its contents
_RELOCK = "and the next `hil requirements lock` writes them"


class ChangeKind(StrEnum):
    """What happened to a requirement since it was locked."""

    ADDED = "added"
    REMOVED = "removed"
    SEMANTIC = "semantic"
    EDITORIAL = "editorial"


@dataclass(frozen=True, slots=True, kw_only=True)
class Locked:
    """What the lock says of one requirement; meaning and explanation are empty if it was written without."""

    rev: int
    fingerprint: str
    wording: str = ""
    meaning: Mapping[str, object] = field(default_factory=dict)
    explanation: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Lock:
    """`requirements.lock.json`."""

    format: Literal[1]
    requirements: dict[str, Locked]


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One difference between a plan and its lock; `fields` are sentences, one per field: which, old, new."""

    id: str
    kind: ChangeKind
    detail: str
    fields: tuple[str, ...] = ()


def read_lock(plan: Path, shown: str, findings: Findings) -> dict[str, Locked] | None:
    """Return the lock of a plan by id; None if there is none or it cannot be read."""
    file = plan / LOCK
    named = f"{shown}/{LOCK}"
    if not is_there(file) or (data := read_bytes(file, named, findings)) is None:
        return None
    try:
        locked_revs(data)
        locked = read_json(data, _Lock).requirements
    except JsonError as error:
        place = Place(path=named, line=error.line, column=error.column)
        findings.add(place, f"cannot be read: {error.bare}; {_TAKE_BACK}")
        return None
    except Invalid as error:
        wrong: list[Keys] = [error.problems[0].path]
    else:
        # A meaning is checked by the fingerprint beside it.
        written = ((id_, each) for id_, each in locked.items() if each.meaning)
        lost = (id_ for id_, each in written if digest(each.meaning, finite=True) != each.fingerprint)
        wrong = [("requirements", id_, "fingerprint") for id_ in lost]
        if not wrong:
            return locked
    place = _place(data.decode(), named, wrong[0])
    findings.add(place, f"is not a lock of format {_FORMAT} as it was written; {_TAKE_BACK}")
    return None


@lru_cache(maxsize=_KEPT)
def locked_revs(data: bytes) -> dict[str, tuple[object, object]]:
    """Return fingerprint and revision of every requirement in a lock; runs of one plan have the same file.

    Raises:
        JsonError: for what is not strict JSON.
    """
    content = parse_strict(data)
    locked = content.get("requirements") if isinstance(content, dict) else None
    each = locked.items() if isinstance(locked, dict) else ()
    return {name: (told.get("fingerprint"), told.get("rev")) for name, told in each if isinstance(told, dict)}


def _place(text: str, named: str, keys: Keys) -> Place:
    """Return where the value at some keys begins, found by searching for one key after the other."""
    at = 0
    for key in keys:
        if found := re.compile(rf"{re.escape(json.dumps(key, ensure_ascii=False))}\s*:\s*").search(text, at):
            at = found.end()
    return Place(path=named, line=text.count("\n", 0, at) + 1, column=at - text.rfind("\n", 0, at))


def check_lock(
    plan: Path, shown: str, requirements: Sequence[Requirement], findings: Findings, *, writing: bool = False
) -> None:
    """Note everything in which a plan and its lock disagree.

    Args:
        plan: the plan's folder.
        shown: the plan's path as shown to a person.
        requirements: what the plan's file says now.
        findings: where it is noted.
        writing: whether the lock is about to be written, so that new entries are allowed.
    """
    before = len(findings)
    locked = read_lock(plan, shown, findings)
    if locked is None:
        if not writing and len(findings) == before:
            findings.add(Place(path=f"{shown}/{LOCK}"), f"the plan is not locked, {_rerun(shown)}")
        return
    present = {item.id for item in requirements}
    for item in requirements:
        was = locked.get(item.id)
        message = _came_back(item, was) or _disagreement(item, was, shown, writing=writing)
        if message:
            findings.add(item.place, message)
    for id_ in locked:
        if id_ not in present:
            place = Place(path=f"{shown}/{LOCK}")
            findings.add(place, f"{id_} was removed from the plan, keep it there with `withdrawn: true`")


def lock_text(requirements: Sequence[Requirement]) -> str:
    """Return the text of the lock file for these requirements."""
    entries = {
        item.id: {
            "fingerprint": item.fingerprint,
            "rev": item.rev,
            "wording": item.wording,
            "meaning": item.meaning,
            "explanation": item.explanation,
        }
        for item in requirements
    }
    return json.dumps({"format": _FORMAT, "requirements": entries}, indent=2, sort_keys=True, ensure_ascii=False) + "\n"


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
        return Change(id=item.id, kind=ChangeKind.SEMANTIC, detail=new, fields=_changed_fields(item, was))
    if item.wording != was.wording or item.rev != was.rev:
        rev = f"rev {was.rev} -> {item.rev} without a new meaning" if item.rev != was.rev else f"rev {item.rev}"
        return Change(id=item.id, kind=ChangeKind.EDITORIAL, detail=rev, fields=_changed_fields(item, was))
    return None


def _came_back(item: Requirement, was: Locked | None) -> str:
    """Return that a requirement is no longer withdrawn, an empty string if it never was, or still is."""
    if was is None or item.withdrawn or not was.explanation.get("withdrawn"):
        return ""
    return f"{item.id} was withdrawn, and its id is never reused: keep `withdrawn: true`, and take a new id"


def _disagreement(item: Requirement, was: Locked | None, shown: str, *, writing: bool) -> str:
    """Return what is wrong between a requirement and its lock, an empty string if nothing is."""
    if was is None:
        return "" if writing else f"{item.id} is not locked, {_rerun(shown)}"
    if item.rev < was.rev:
        return f"the rev of {item.id} went back from {was.rev} to {item.rev}, revisions only grow"
    changed = item.fingerprint != was.fingerprint
    if item.rev == was.rev and changed:
        return f"{_what_changed(item, was)}: raise `rev` to {was.rev + 1}, then {_rerun(shown)}"
    if item.rev == was.rev:
        return ""
    if not changed:
        return f"the rev of {item.id} went from {was.rev} to {item.rev}, but its meaning is the same: set it back"
    return "" if writing else f"rev {item.rev} of {item.id} is not locked, {_rerun(shown)}"


def _what_changed(item: Requirement, was: Locked) -> str:
    fields = (_shortened(text) for text in _fields(was.meaning, item.meaning) if was.meaning)
    told = "; ".join(fields)
    return f"the meaning of {item.id} changed without a new rev" + (f" ({told})" if told else "")


def _changed_fields(item: Requirement, was: Locked) -> tuple[str, ...]:
    """Return the changed fields, with old and new value."""
    if not was.meaning:
        return (f"which fields is not known: the lock was written without them, {_RELOCK}",)
    found = [*_fields(was.meaning, item.meaning), *_fields(was.explanation, item.explanation)]
    if not found and item.wording != was.wording:
        found.append("text: spacing only")
    return tuple(found)


def _fields(before: Mapping[str, object], now: Mapping[str, object]) -> Iterator[str]:
    old, new = dict(_flat(before)), dict(_flat(now))
    for name in sorted({*old, *new}):
        if old.get(name) != new.get(name):
            yield f"{name}: {old.get(name, _NONE)} -> {new.get(name, _NONE)}"


def _flat(value: object, name: str = "") -> Iterator[tuple[str, str]]:
    """Yield every field below a value by its dotted name, as JSON writes it; limits are named by their parameter."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _flat(inner, f"{name}.{key}" if name else str(key))
    elif isinstance(value, Sequence) and not isinstance(value, str) and all(_is_limit(item) for item in value):
        for item in value:
            yield from _flat({k: v for k, v in item.items() if k != "parameter"}, f"{name}.{item['parameter']}")
    elif value is not None:
        yield name, json.dumps(value, ensure_ascii=False)


def _is_limit(value: object) -> bool:
    return isinstance(value, Mapping) and "parameter" in value


def _shortened(text: str) -> str:
    name, _, _ = text.partition(":")
    return text if len(text) <= _SHORT else name


def _rerun(shown: str) -> str:
    return f"run `hil requirements lock {shown}`"
