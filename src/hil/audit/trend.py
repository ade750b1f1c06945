"""The checks of one parameter from run to run: by requirement, member and case, with their statistics."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import msgspec
import numpy as np

from hil.audit.tables import guarded
from hil.clock.wall import seconds_of
from hil.evidence.durable import read_plain
from hil.evidence.events.cases import Bounds
from hil.evidence.folder import RESULTS
from hil.evidence.runs import RunSummary
from hil.requirements.units import UnitError, convert, scale

__all__ = [
    "CONFIDENCE",
    "Line",
    "Point",
    "Spread",
    "Trend",
    "as_csv",
    "line",
    "parameters",
    "points",
    "spread",
]

CONFIDENCE = 0.95
"""Of the interval of a slope."""

_SECONDS_PER_DAY = 86_400.0
_LEAST = 3  # points at as many times: a slope and one degree of freedom


class _Checked(msgspec.Struct, frozen=True):
    requirement: str
    parameter: str
    of: str | None
    value: float | str | None
    unit: str
    uncertainty: float | None
    dof: float | None
    expanded: float | None
    limit: Bounds
    limit_unit: str
    decision: str
    verdict: str


class _Case(msgspec.Struct, frozen=True):
    case: str
    checks: tuple[_Checked, ...] = ()


class _Said(msgspec.Struct, frozen=True):
    cases: tuple[_Case, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One check of one run.

    Attributes:
        run: the run at a glance.
        case: the case that made the check.
        requirement: the requirement.
        parameter: the parameter.
        of: the member of the limit's denominator; empty without one.
        value: a number in `unit`, a word, or None for a number that is not finite.
        unit: of value, uncertainty and expanded.
        uncertainty: combined standard uncertainty, None if unknown.
        dof: degrees of freedom of the uncertainty, None if infinite or unknown.
        expanded: expanded uncertainty, None if unknown.
        limit: the limit at that time, in `limit_unit`.
        limit_unit: its unit.
        decision: its decision rule.
        verdict: the verdict.
    """

    run: RunSummary
    case: str
    requirement: str
    parameter: str
    of: str
    value: float | str | None
    unit: str
    uncertainty: float | None
    dof: float | None
    expanded: float | None
    limit: Bounds
    limit_unit: str
    decision: str
    verdict: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Trend:
    """The checks of one requirement, member and case, in the order of their runs, and in one unit where that can be.

    Attributes:
        requirement: the requirement.
        of: the member of the limit's denominator; empty without one.
        case: the case.
        unit: the unit of all numbers.
        points: the checks.
    """

    requirement: str
    of: str
    case: str
    unit: str
    points: tuple[Point, ...]


class Spread(NamedTuple):
    """The scatter of numbers: their count, mean, and standard deviation, None for a single one."""

    size: int
    mean: float
    deviation: float | None


class Line(NamedTuple):
    """A straight line over the time of runs: change per day, and the ends of its interval."""

    slope: float
    low: float
    high: float


def points(runs: Iterable[RunSummary], parameter: str, told: Callable[[str], None]) -> Iterator[Point]:
    """Yield every check of a parameter that sealed runs made.

    Args:
        runs: the runs, each sealed and looked at.
        parameter: the parameter.
        told: called with a sentence for a package whose results cannot be read.
    """
    for run in runs:
        try:
            said = msgspec.json.decode(read_plain(run.folder / RESULTS), type=_Said)
        except (OSError, msgspec.MsgspecError) as error:
            told(f"{run.folder.name}: its results cannot be read: {error}")
            continue
        for case in said.cases:
            for check in case.checks:
                if check.parameter == parameter:
                    facts = {**msgspec.structs.asdict(check), "of": check.of or ""}
                    yield Point(run=run, case=case.case, **facts)


def parameters(runs: Iterable[RunSummary]) -> set[str]:
    """Return every parameter that sealed runs checked, as far as their results can be read."""
    found: set[str] = set()
    for run in runs:
        with suppress(OSError, msgspec.MsgspecError):
            said = msgspec.json.decode(read_plain(run.folder / RESULTS), type=_Said)
            found |= {check.parameter for case in said.cases for check in case.checks}
    return found


def trends(found: Iterable[Point]) -> tuple[Trend, ...]:
    """Return checks by requirement, member and case; numbers are in the newest limit's unit where they convert.

    Those that do not convert make series of their own, each in the unit of its own newest limit.
    """
    by: dict[tuple[str, str, str], list[Point]] = {}
    for each in found:
        by.setdefault((each.requirement, each.case, each.of), []).append(each)
    made = []
    for (requirement, case, of), items in sorted(by.items()):
        for unit, group in _by_unit(items):
            made.append(Trend(requirement=requirement, of=of, case=case, unit=unit, points=group))
    return tuple(made)


def _by_unit(items: Sequence[Point]) -> Iterator[tuple[str, tuple[Point, ...]]]:
    """Yield the checks that convert into one unit, that of the newest first."""
    while items:
        newest = items[-1]
        unit = newest.limit_unit or newest.unit
        if _in_unit(newest, unit) is None:
            unit = newest.unit
        converted = [(each, _in_unit(each, unit)) for each in items]
        together = tuple(point for _, point in converted if point is not None) or (newest,)
        yield unit, together
        items = [each for each, point in converted if point is None and each is not newest]


def _in_unit(point: Point, unit: str) -> Point | None:
    """Return a check in another unit, its limit too; None where one of them does not convert."""
    if not isinstance(point.value, float) and point.value is not None:
        return point
    try:
        factor = scale(point.unit, unit)
        return replace(
            point,
            unit=unit,
            value=None if point.value is None else convert(point.value, point.unit, unit),
            uncertainty=None if point.uncertainty is None else point.uncertainty * factor,
            expanded=None if point.expanded is None else point.expanded * scale(point.limit_unit or point.unit, unit),
            limit=_limit_in(point.limit, point.limit_unit or unit, unit),
            limit_unit=unit,
        )
    except UnitError:
        return None


def _limit_in(limit: Bounds, was: str, unit: str) -> Bounds:
    if was == unit:
        return limit
    ends = (None if end is None else f"{convert(float(end), was, unit):.12g}" for end in (limit.min, limit.max))
    return Bounds(**dict(zip(("min", "max"), ends, strict=True)), equals=limit.equals)


def spread(values: Sequence[float]) -> Spread:
    """Return number, mean and standard deviation s = sqrt(sum (x - mean)^2 / (n - 1)) of at least one number."""
    data = np.asarray(values, dtype=float)
    if data.size == 1 or np.ptp(data) == 0:  # a mean of equal numbers need not be one of them to the last digit
        return Spread(data.size, float(data[0]), 0.0 if data.size > 1 else None)
    return Spread(data.size, float(data.mean()), float(data.std(ddof=1)))


def line(found: Sequence[Point]) -> Line | None:
    """Return the straight line of numbers over the beginnings of their runs, by least squares.

    Slope b = Sxy / Sxx, u(b) = s / sqrt(Sxx), s^2 = sum of squared residuals / (n - 2), interval by Student's t with
    n - 2 degrees of freedom. It takes the scatter about the line as independent from point to point, and does not weigh
    by the uncertainties.

    Returns:
        None with fewer than three numbers at different times, or where all of them are within less than a day.
    """
    from scipy import special  # noqa: PLC0415 - start-up stays light

    numbers = [
        (seconds_of(each.run.began), each.value) for each in found if each.run.began and isinstance(each.value, float)
    ]
    moments = {when for when, _ in numbers}
    if len(moments) < _LEAST or max(moments) - min(moments) < _SECONDS_PER_DAY:
        return None
    when, what = np.array(numbers, dtype=float).T
    days = (when - when.mean()) / _SECONDS_PER_DAY
    square = float(np.sum(days**2))
    slope = float(np.sum(days * (what - what.mean()))) / square
    rest = what - what.mean() - slope * days
    error = math.sqrt(float(np.sum(rest**2)) / (when.size - 2) / square)
    reach = error * float(special.stdtrit(when.size - 2, 0.5 + CONFIDENCE / 2.0))
    return Line(slope, slope - reach, slope + reach)


_COLUMNS = (
    "requirement", "parameter", "of", "case", "run", "began", "dut", "bench", "source", "purpose", "deviates", "value",
    "unit", "uncertainty", "dof", "expanded", "min", "max", "equals", "limit unit", "decision", "verdict",
)  # fmt: skip


def as_csv(found: Iterable[Trend]) -> str:
    """Return a line per check as CSV; no cell of it is a formula to a spreadsheet.

    The uncertainty is a standard uncertainty, the expanded one what the verdict was judged with.
    """
    written = io.StringIO()
    lines = csv.writer(written, lineterminator="\n")
    lines.writerow(_COLUMNS)
    for each in (point for item in found for point in item.points):
        run = each.run
        cells = (
            each.requirement, each.parameter, each.of, each.case, run.folder.name, run.began, run.dut, run.bench,
            run.source, run.purpose, "yes" if run.deviates else "no", each.value, each.unit, each.uncertainty, each.dof,
            each.expanded, each.limit.min, each.limit.max, each.limit.equals, each.limit_unit, each.decision,
            each.verdict,
        )  # fmt: skip
        lines.writerow(map(_cell, cells))
    return written.getvalue()


def _cell(value: object) -> str:
    """Return a number as it is, and a text as a cell that is no formula; limits are numbers in texts."""
    if not isinstance(value, str):
        return "" if value is None else repr(value)
    try:
        float(value)
    except ValueError:
        return guarded(value)
    return value
