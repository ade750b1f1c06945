"""Reads a criteria file: which candidates are compared, and by which figures of their packages."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path as File
from typing import Annotated

from hil.documents.declared import Document, read_document
from hil.documents.findings import Findings
from hil.documents.suggest import did_you_mean
from hil.model.notation import NAMED, ByName, Flag, Path, Text, number, one_of
from hil.requirements.units import check_unit, compatible

__all__ = ["Candidate", "Cell", "Criteria", "Criterion", "load_criteria"]

_SCHEMA = "hil/selection/1"
_Weight = Annotated[float, number(0.001, 1000)]
_Combine = Annotated[str, one_of("worst", "mean")]
_Wrong = Iterator[tuple[Path, str]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """What can be selected, and how checks of it are recognised.

    Attributes:
        name: its name.
        roles: what it can be used as, such as `gyroscope`.
        instances: its instances in the wiring of a bench: a check of `gyroscope.lsm.x` is of instance `lsm`. Several
            are several units, each of which needs its figures. Without one, checks name the axis alone.
        duts: serial numbers; only runs of these units are of the candidate. Any run, if it has none.
        part: a part number; only runs of such units are of the candidate.
    """

    name: Text = field(default="", metadata=NAMED)
    roles: tuple[Text, ...]
    instances: tuple[Text, ...] = ()
    duts: tuple[Text, ...] = ()
    part: Text = ""

    def members(self, role: str, axes: tuple[str, ...]) -> tuple[str, ...]:
        """Return what the checks of its axes in a role are `of`."""
        prefixes = tuple(f"{role}.{instance}" for instance in self.instances) or ("",)
        return tuple(f"{prefix}.{axis}".strip(".") for prefix in prefixes for axis in axes or ("",))


@dataclass(frozen=True, slots=True, kw_only=True)
class Criterion:
    """One criterion for all candidates: whose figures have the smallest magnitude.

    Attributes:
        name: what a table calls it, such as `Lowest noise`.
        parameter: the parameter of the checks.
        units: the unit of the figures by role; candidates are compared within a role.
        axes: the axes that a candidate needs a figure of, each; empty if the checks are of no axis.
        combine: whether the worst axis counts, or the mean of their magnitudes.
        weight: how much it counts overall, from 0.001 to 1000.
        plan: only checks of this plan, if it is given.
        unaliased: whether figures count only if their recording took at least two samples per period of the highest
            frequency that the sensor's filter passes.
    """

    name: Text = field(default="", metadata=NAMED)
    parameter: Text
    units: Mapping[str, Text]
    axes: tuple[Text, ...] = ()
    combine: _Combine = "worst"
    weight: _Weight = 1.0
    plan: Text = ""
    unaliased: Flag = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Criteria:
    """A criteria file.

    Attributes:
        title: what the selection is for.
        confidence: at which two candidates are told apart.
        candidates: by name in the order of the file.
        criteria: likewise.
    """

    title: Text
    confidence: Annotated[float, number(0.5, 0.9999)] = 0.95
    candidates: Annotated[tuple[Candidate, ...], ByName()]
    criteria: Annotated[tuple[Criterion, ...], ByName()]

    def cells(self) -> Iterator[Cell]:
        """Yield every criterion for each of its roles: what a table has a cell for, by rows."""
        for role in self.roles:
            for criterion in self.criteria:
                if role in criterion.units:
                    its = tuple(each for each in self.candidates if role in each.roles)
                    yield Cell(role=role, criterion=criterion, candidates=its)

    @property
    def wanted(self) -> frozenset[tuple[str, str]]:
        """Parameter and axis of every figure that counts."""
        return frozenset(
            (cell.criterion.parameter, member)
            for cell in self.cells()
            for candidate in cell.candidates
            for member in candidate.members(cell.role, cell.criterion.axes)
        )

    @property
    def roles(self) -> tuple[str, ...]:
        """The roles in the order in which the criteria name them."""
        return tuple(dict.fromkeys(role for each in self.criteria for role in each.units))


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """A criterion for the candidates of one role."""

    role: str
    criterion: Criterion
    candidates: tuple[Candidate, ...]

    @property
    def unit(self) -> str:
        """The unit of its figures."""
        return self.criterion.units[self.role]


def load_criteria(file: File, shown: str) -> Criteria:
    """Return what a criteria file says.

    Args:
        file: where it is.
        shown: its path as shown to a person.

    Raises:
        ConfigurationError: with all errors in it.
    """
    findings = Findings()
    document = read_document(file, shown, findings, Criteria, schema=_SCHEMA)
    if document is not None:
        for path, message in _problems(document):
            if document.is_sound(path):
                findings.add(document.place(path), message)
    return findings.require(document).model


def _problems(document: Document[Criteria]) -> _Wrong:
    its = document.model
    if len(its.candidates) < 2:
        yield ("candidates",), "a selection needs 2 candidates at least"
    if not its.criteria:
        yield ("criteria",), "a selection needs a criterion"
    yield from _of_candidates(its)
    yield from _twice(its)
    played = {role for each in its.candidates for role in each.roles}
    for criterion in its.criteria:
        at: Path = ("criteria", criterion.name)
        for role, unit in criterion.units.items():
            if role not in played:
                yield (*at, "units", role), f"no candidate has the role '{role}'{did_you_mean(role, played)}"
            if problem := check_unit(unit):
                yield (*at, "units", role), problem
            elif compatible(unit, "degC"):
                yield (*at, "units", role), "temperatures have no magnitude to compare, name a difference in K"
        if not criterion.units:
            yield (*at, "units"), "a criterion needs a unit for one role at least"
        if len(set(criterion.axes)) < len(criterion.axes):
            yield (*at, "axes"), "an axis is named twice"


def _of_candidates(its: Criteria) -> _Wrong:
    compared = set(its.roles)
    known: dict[tuple[str, str], str] = {}
    for each in its.candidates:
        at: Path = ("candidates", each.name)
        if not (each.instances or each.duts or each.part):
            yield at, f"candidate {each.name}: give instances, duts or a part, so that its checks are known"
        for index, role in enumerate(each.roles):
            if role not in compared:
                yield (
                    (*at, "roles", index),
                    f"no criterion has a unit for the role '{role}'{did_you_mean(role, compared)}",
                )
        for role in each.roles:
            for instance in each.instances:
                for dut in each.duts or (each.part,):
                    first = known.setdefault((f"{role}.{instance}", dut), each.name)
                    if first != each.name:
                        yield (*at, "instances"), f"{role}.{instance} is of candidate {first} already"


def _twice(its: Criteria) -> _Wrong:
    """Yield what a candidate names twice: a mean of its axes would count one figure twice."""
    for each in its.candidates:
        for key in ("roles", "instances", "duts"):
            if len(set(named := getattr(each, key))) < len(named):
                yield ("candidates", each.name, key), f"one of the {key} of candidate {each.name} is named twice"
