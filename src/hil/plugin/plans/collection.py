"""Collection: turns pytest items into planned cases, and finds everything that is wrong with them."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterator, Mapping, Sequence

import pytest

from hil.documents.suggest import did_you_mean
from hil.documents.text import one_line
from hil.executive.setup.configuration import Configuration, Request
from hil.executive.setup.head import LEFT_OUT, PlannedCase
from hil.model.errors import ConfigurationError, Finding, Refused
from hil.plugin.plans.fixture_names import name_findings
from hil.plugin.plans.literals import returned_lines, written_checks
from hil.plugin.plans.markers import KNOWN
from hil.plugin.plans.plan_sources import lost_cases
from hil.requirements.catalogue import Catalogue

__all__ = ["plan_cases", "skipped_cases"]

_OF_PYTEST = ("filterwarnings", "tryfirst", "trylast")
_LONGEST_S = 3600.0


def plan_cases(items: Sequence[pytest.Item], configuration: Configuration) -> dict[str, PlannedCase]:
    """Return every case by its node id.

    Args:
        items: everything collected from the plans.
        configuration: what the run is made of.

    Raises:
        ConfigurationError: with every marker that does not fit the catalogue, every gap in `over`, every name that
            nothing provides, and every duplicate case id.
    """
    findings = list(_twice(items))
    findings += [finding for item in items for finding in _item_findings(item, configuration)]
    findings += [finding for item in items for finding in name_findings(item, configuration)]
    findings += [finding for item in items for finding in _marker_findings(item, configuration.catalogue)]
    findings += [finding for item in items for finding in _check_findings(item, configuration.catalogue)]
    findings += _uncovered(items, configuration.catalogue)
    findings += lost_cases(items, configuration)
    if findings:
        # A parametrised case is one function: an error in it is reported once.
        raise ConfigurationError(tuple(dict.fromkeys(findings)))
    return {item.nodeid: _planned(item) for item in items}


def skipped_cases(planned: Mapping[str, PlannedCase], request: Request) -> dict[str, str]:
    """Return the cases that the command line skips, or leaves out by selecting others, with the reason.

    A name without parameters is the function with all of its cases. If a case is named in both ways, its own reason
    counts.

    Raises:
        Refused: if a name is not a case, is ambiguous, or has no reason, or if no case is left.
    """
    only = {case for asked in request.only for case in _named_cases(planned, asked, "run")}
    skipped = {case: LEFT_OUT for case in planned if only and case not in only}
    for asked, reason in request.skips.items():
        if not reason.strip():
            raise Refused(f"there is no reason to skip '{asked}'", "say why, it is part of the evidence: --reason")
        found = _named_cases(planned, asked, "skip")
        single = found == [case for case in planned if _is_named(case, asked)]
        skipped |= {case: reason for case in found if single or skipped.get(case, LEFT_OUT) == LEFT_OUT}
    if only and skipped.keys() == planned.keys():
        raise Refused("every case of --only is skipped as well", "leave out one of --only and --skip")
    return skipped


def _named_cases(planned: Mapping[str, PlannedCase], asked: str, to: str) -> list[str]:
    """Return the case of this name, or the cases of the function."""
    found = [case for case in planned if _is_named(case, asked)]
    found = found or [case for case in planned if _is_named(_function_of(case), asked)]
    if len({_function_of(case) for case in found}) == 1:
        return found
    names = {name for case in planned for name in (_own_name(case), _own_name(_function_of(case)))}
    what = "no case" if not found else "several cases"
    raise Refused(f"{what} '{asked}' to {to}{did_you_mean(asked, sorted(names))}", "name it as hil plan shows it")


def _is_named(case: str, asked: str) -> bool:
    return case == asked or case.endswith((f"::{asked}", f"/{asked}"))


def _function_of(case: str) -> str:
    """Return a node id without the case's parameters, which may contain anything."""
    place, _, within = case.partition("::")
    return f"{place}::{within.partition('[')[0]}"


def _own_name(case: str) -> str:
    """Return the short name of a case: its function, with the parameters."""
    return case[len(_function_of(case).rpartition("::")[0]) + 2 :]


def _planned(item: pytest.Item) -> PlannedCase:
    doc = getattr(getattr(item, "function", None), "__doc__", "") or ""
    return PlannedCase(
        id=item.nodeid,
        title=doc.strip().partition("\n")[0],
        plan=item.path.parent.name,
        requirements=_requirements(item),
        max_duration_s=_max_duration_s(item) or _LONGEST_S,
        repeatable=_repeatable(item) or "",
        fixtures=frozenset(getattr(item, "fixturenames", ())),
        item=item,
    )


def _repeatable(item: pytest.Item) -> str | None:
    """Return the marker's reason, empty if there is no marker, None if it gives no reason."""
    mark = item.get_closest_marker("repeatable")
    if mark is None:
        return ""
    reason = mark.args[0] if len(mark.args) == 1 and not mark.kwargs else None
    return one_line(reason.strip()) if isinstance(reason, str) and reason.strip() else None


def _max_duration_s(item: pytest.Item) -> float | None:
    """Return the marker's duration, NaN if it is not a duration, None if there is no marker."""
    mark = item.get_closest_marker("max_duration")
    if mark is None:
        return None
    seconds = mark.args[0] if len(mark.args) == 1 and not mark.kwargs else None
    return float(seconds) if isinstance(seconds, int | float) and not isinstance(seconds, bool) else math.nan


def _requirements(item: pytest.Item) -> tuple[str, ...]:
    marks = item.iter_markers("requirement")
    return tuple(dict.fromkeys(str(name) for mark in marks for name in mark.args))


def _item_findings(item: pytest.Item, configuration: Configuration) -> Iterator[Finding]:
    """Yield what would stop this case, or leave it out of the evidence, once the bench is armed."""
    path, line, _ = item.location
    if item.path.parent not in configuration.plans:
        yield _at(path, line, "cases belong in the folder of their plan, not below it, so that they are evidence")
    seconds = _max_duration_s(item)
    if seconds is not None and not 0 < seconds < math.inf:
        yield _at(path, line, f"max_duration of {item.name} takes one number of seconds above zero")
    if _repeatable(item) is None:
        yield _at(path, line, f"repeatable of {item.name} takes one reason why it may be repeated")
    for mark in item.iter_markers():
        if mark.name not in (*KNOWN, *_OF_PYTEST):
            known = did_you_mean(mark.name, KNOWN) or f"; a case can have {', '.join(KNOWN)}"
            yield _at(path, line, f"unknown marker '{mark.name}'{known}")
    if any(mark.kwargs or not mark.args for mark in item.iter_markers("requirement")):
        yield _at(path, line, f"requirement of {item.name} takes ids and nothing else")
    function = inspect.unwrap(getattr(item, "function", item.runtest))
    if inspect.isgeneratorfunction(function) or inspect.iscoroutinefunction(function):
        yield _at(path, line, f"{item.name} would be called and never run: a case neither yields nor awaits")
    for found in returned_lines(getattr(item, "function", item.runtest)):
        case = _own_name(_function_of(item.nodeid))
        message = f"what {case} returns is ignored: give it to `check`, or return nothing"
        yield Finding(path=path, line=found, column=1, message=message)


def _twice(items: Sequence[pytest.Item]) -> Iterator[Finding]:
    """Yield every case with a duplicate id: joined parameters may read alike."""
    seen: set[str] = set()
    for item in items:
        if item.nodeid in seen:
            path, line, _ = item.location
            yield _at(path, line, f"there are two cases '{item.name}': give their parameters ids that differ")
        seen.add(item.nodeid)


def _marker_findings(item: pytest.Item, catalogue: Catalogue) -> Iterator[Finding]:
    path, line, _ = item.location
    for name in _requirements(item):
        if name not in catalogue.ids:
            yield _at(path, line, f"unknown requirement '{name}'{did_you_mean(name, catalogue.ids)}")
        elif catalogue.requirement(name).withdrawn:
            yield _at(path, line, f"requirement '{name}' is withdrawn, remove it from the marker of {item.name}")


def _check_findings(item: pytest.Item, catalogue: Catalogue) -> Iterator[Finding]:
    """Yield what is wrong with the literal checks in the case's code."""
    marked = [name for name in _requirements(item) if name in catalogue.ids]
    for written in written_checks(getattr(item, "function", item.runtest)):
        message = ""
        if written.requirement not in marked:
            hint = did_you_mean(written.requirement, marked)
            message = f"'{written.requirement}' is not among the requirements of this case's marker{hint}"
        else:
            limits = {limit.parameter: limit for limit in catalogue.requirement(written.requirement).limits}
            limit = limits.get(written.parameter)
            if limit is None:
                hint = did_you_mean(written.parameter, limits)
                message = f"{written.requirement} has no parameter '{written.parameter}'{hint}"
            elif written.of is not None and written.of not in limit.of:
                hint = did_you_mean(written.of, limit.of)
                message = f"{written.requirement} {written.parameter} is not evaluated of '{written.of}'{hint}"
        if message:
            yield Finding(path=item.location[0], line=written.line, column=written.column, message=message)


def _uncovered(items: Sequence[pytest.Item], catalogue: Catalogue) -> Iterator[Finding]:
    """Yield what a requirement wants covered `over` case parameters and no planned case covers."""
    for name in catalogue.ids:
        requirement = catalogue.requirement(name)
        marked = [item for item in items if name in _requirements(item)]
        for parameter, values in requirement.over.items():
            covered = {str(_parameters(item).get(parameter)) for item in marked}
            missing = [value for value in values if value not in covered]
            if missing and marked:
                path, line, _ = marked[0].location
                yield _at(path, line, f"{name} wants every {parameter}, no case covers {', '.join(missing)}")


def _parameters(item: pytest.Item) -> Mapping[str, object]:
    callspec = getattr(item, "callspec", None)
    return callspec.params if callspec else {}


def _at(path: str, line: int | None, message: str) -> Finding:
    return Finding(path=path, line=(line or 0) + 1, column=1, message=message)
