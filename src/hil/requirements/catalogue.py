"""The catalogue: every requirement of the selected plans, checked against the whole workspace."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from hil.documents.canonical import digest
from hil.documents.findings import Findings, shown
from hil.documents.suggest import did_you_mean
from hil.documents.text import is_there
from hil.model.errors import HilError
from hil.requirements.lock import check_lock
from hil.requirements.requirement import Document, Limit, Requirement
from hil.requirements.schema import REQUIREMENTS, RequirementFile, read_requirements

__all__ = ["Catalogue", "UnknownParameterOfRequirement", "UnknownRequirement", "load_catalogue"]


class UnknownRequirement(HilError, KeyError):
    """An id that the catalogue does not hold."""


class UnknownParameterOfRequirement(HilError, KeyError):
    """A parameter for which a requirement has no limit."""


class Catalogue:
    """The requirements of the selected plans, in the order of the plans and their files.

    Args:
        files: what the selected plans hold.
        parents: the requirements of the workspace, by id, that those serve.
    """

    def __init__(self, files: Sequence[RequirementFile], parents: Mapping[str, Requirement]) -> None:
        self._files = {file.plan: file for file in files}
        self._requirements = {item.id: item for file in files for item in file.requirements}
        self._parents = dict(parents)

    @property
    def ids(self) -> tuple[str, ...]:
        """Every id of the selected plans, including withdrawn ones."""
        return tuple(self._requirements)

    @property
    def plans(self) -> tuple[str, ...]:
        """The selected plans."""
        return tuple(self._files)

    @property
    def above(self) -> tuple[Requirement, ...]:
        """The readable requirements outside the selected plans: the workspace's, and those of other plans."""
        return tuple(self._parents.values())

    @property
    def digest(self) -> str:
        """SHA-256 over the fingerprints of the selected plans."""
        return digest({item.id: item.fingerprint for item in self._requirements.values()})

    def requirement(self, requirement_id: str) -> Requirement:
        """Return the requirement of that id.

        Raises:
            UnknownRequirement: with the nearest id.
        """
        if requirement_id not in self._requirements:
            asked = ", ".join(self._files) or "no plan"
            suggestion = did_you_mean(requirement_id, self._requirements)
            raise UnknownRequirement(
                f"there is no requirement '{requirement_id}' in {asked}{suggestion}",
                "use an id of the plan's requirements.yaml",
            )
        return self._requirements[requirement_id]

    def of_plan(self, plan: str) -> tuple[Requirement, ...]:
        """Return the requirements of one selected plan."""
        return self._files[plan].requirements

    def document(self, plan: str) -> Document:
        """Return the document that one selected plan's requirements stand for."""
        return self._files[plan].document

    def part_numbers(self, plan: str) -> tuple[str, ...]:
        """Return the part numbers that one selected plan is for, none if it is for any."""
        return self._files[plan].part_numbers

    def limit(self, requirement_id: str, parameter: str) -> Limit:
        """Return the limit of a requirement's parameter.

        Raises:
            UnknownRequirement: with the nearest id.
            UnknownParameterOfRequirement: with the nearest parameter.
        """
        limits = {limit.parameter: limit for limit in self.requirement(requirement_id).limits}
        if parameter not in limits:
            known = ", ".join(limits) or "none"
            raise UnknownParameterOfRequirement(
                f"{requirement_id} has no parameter '{parameter}'{did_you_mean(parameter, limits)}", f"it has {known}"
            )
        return limits[parameter]

    def fingerprint(self, requirement_id: str) -> str:
        """Return the fingerprint of a requirement's meaning."""
        return self.requirement(requirement_id).fingerprint

    def parent(self, requirement_id: str) -> Requirement | None:
        """Return the requirement that others serve, None if only its id is known."""
        return self._parents.get(requirement_id) or self._requirements.get(requirement_id)


def load_catalogue(root: Path, plans: Sequence[Path], *, locked: bool = True) -> Catalogue:
    """Return the catalogue of some plans of a workspace.

    Ids are compared over every plan of the workspace. What else is wrong in a plan that was not asked
    for is not this run's business.

    Args:
        root: the workspace.
        plans: plan folders; relative ones are below the workspace.
        locked: whether the lock files must agree; only the commands about locks go without.

    Raises:
        ConfigurationError: with all errors.
    """
    findings = Findings()
    root = root.resolve()
    asked = list(dict.fromkeys((root / plan).resolve() for plan in plans))
    mine = {folder: file for folder in asked if (file := _read(folder, root, findings))}
    others = _read_around(asked, root, findings)
    _check_workspace(tuple(mine.values()), others, findings)
    if locked and not findings:
        for folder, file in mine.items():
            check_lock(folder, shown(folder, root), file.requirements, findings)
    findings.raise_if_any()
    return Catalogue(tuple(mine.values()), {item.id: item for file in others for item in file.requirements})


def _read(plan: Path, root: Path, findings: Findings) -> RequirementFile | None:
    file = plan / REQUIREMENTS
    return read_requirements(file, shown(file, root), plan.name, findings)


def _read_around(asked: Sequence[Path], root: Path, findings: Findings) -> tuple[RequirementFile, ...]:
    """Return the requirements of the workspace and of the plans that are not selected."""
    around = []
    for testplans in dict.fromkeys(plan.parent for plan in asked):
        above = testplans / REQUIREMENTS
        if is_there(above):
            around.append(read_requirements(above, shown(above, root), "", findings))
        beside = sorted(file.parent for file in testplans.glob(f"*/{REQUIREMENTS}"))
        around.extend(_read_other(plan, root, findings) for plan in beside if plan not in asked)
    return tuple(file for file in around if file is not None)


def _read_other(plan: Path, root: Path, findings: Findings) -> RequirementFile | None:
    of_other = Findings()
    file = _read(plan, root, of_other)
    if file is None:
        # If a file cannot be read at all, uniqueness of its ids is unknown.
        for finding in of_other:
            findings.repeat(finding)
    return file


def _check_workspace(asked: Sequence[RequirementFile], others: Sequence[RequirementFile], findings: Findings) -> None:
    """Note duplicate ids, dangling parents and cycles that touch the selected files."""
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
                findings.add(known[current].place, f"parents form a circle: {' -> '.join(cycle)}")
            elif current not in finished and current in known:
                path.append(current)
                on_path.add(current)
                pending.append((current, True))
                pending.extend((parent, False) for parent in known[current].parents)
