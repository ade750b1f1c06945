"""What holds over all plans of a workspace: ids are unique, parents exist and do not run in circles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hil.documents.findings import Findings
from hil.documents.suggest import did_you_mean
from hil.requirements.requirement import Requirement
from hil.requirements.schema import RequirementFile

__all__ = ["check_workspace"]


def check_workspace(asked: Sequence[RequirementFile], others: Sequence[RequirementFile], findings: Findings) -> None:
    """Note duplicate ids, dangling parents and cycles that touch the asked files."""
    mine = [item for file in asked for item in file.requirements if item.id]
    foreign = [item for file in others for item in file.requirements if item.id]
    _check_unique(mine, foreign, findings)
    known = {item.id: item for item in (*foreign, *mine)}
    for item in mine:
        for parent in item.parents:
            if parent not in known:
                findings.add(item.place, f"parent '{parent}' of {item.id} does not exist{did_you_mean(parent, known)}")
    _check_cycles(known, [item.id for item in mine], findings)


def _check_unique(mine: Sequence[Requirement], foreign: Sequence[Requirement], findings: Findings) -> None:
    first: dict[str, Requirement] = {}
    for item in foreign:
        first.setdefault(item.id.casefold(), item)
    for item in mine:
        other = first.setdefault(item.id.casefold(), item)
        if other is not item:
            where = f"{other.place.path}:{other.place.line}"
            like = "" if other.id == item.id else f" as '{other.id}'"
            findings.add(item.place, f"duplicate requirement id '{item.id}', already at {where}{like}")


def _check_cycles(known: Mapping[str, Requirement], start: Sequence[str], findings: Findings) -> None:
    """Walk upwards without recursion; chains of parents may be as long as the catalogue."""
    finished: set[str] = set()
    for origin in start:
        path: list[str] = []
        on_path: set[str] = set()
        pending = [(origin, False)]
        while pending:
            current, leaving = pending.pop()
            if leaving:
                path.pop()
                on_path.discard(current)
                finished.add(current)
            elif current in on_path:
                cycle = [*path[path.index(current) :], current]
                findings.add(known[current].place, f"parents run in a circle: {' -> '.join(cycle)}")
            elif current not in finished and current in known:
                path.append(current)
                on_path.add(current)
                pending.append((current, True))
                pending.extend((parent, False) for parent in known[current].parents)
