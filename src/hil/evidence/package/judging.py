"""Rejudging: whether a check's verdict follows from its value, its uncertainty and the frozen limit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache

from hil.evidence.events import Check
from hil.evidence.results.facts import Catalogue, FrozenLimit, FrozenRequirement
from hil.model.figure import Figure, FigureStatus
from hil.model.verdict import Verdict
from hil.requirements.decision import Judgement, judge
from hil.requirements.requirement import Decision, Kind, Limit
from hil.requirements.units import UnitError, convert

__all__ = ["judge_again"]

_LAST_DIGITS = 1e-9
_NOTHING = FrozenRequirement()
_STATUSES = frozenset(FigureStatus)


def judge_again(check: Check, catalogue: Catalogue) -> Iterator[str]:
    """Yield a sentence for everything in a check's event that does not follow from value, uncertainty and catalogue.

    A good verdict must follow exactly. One that is not good may also come from what the event does not record: a device
    that fell silent, the analysis' own status, a value beyond the last digit written. A requirement that only asks for
    data is RECORDED if its figures pass.

    Args:
        check: the event; value, uncertainty and degrees of freedom combine figure and instruments.
        catalogue: the frozen requirements, with their limits.
    """
    name = f"{check.requirement} {check.parameter}"
    entry = catalogue.get(check.requirement, _NOTHING)
    frozen = _frozen_limit(check, entry)
    written = _written_limit(check)
    if check.requirement not in catalogue:
        yield f"{name}: field 'requirement': the frozen catalogue has no such requirement"
    if frozen is not None:
        yield from _against_catalogue(name, written, frozen)
    if unfit := list(_unfit(check, frozen or written)):
        yield from (f"{name}: {sentence}" for sentence in unfit)
        return
    again = _judge(check, frozen or written)
    due = Verdict.RECORDED if entry.kind == Kind.RECORD and again.verdict is Verdict.PASS else again.verdict
    if check.doubts or (check.uncovered and written.bounded and written.decision is Decision.GUARDED):
        due = Verdict.INCONCLUSIVE
    verdict = check.verdict
    if verdict is not due and (verdict.good or not _may_be_worse(check, again)):
        yield f"{name}: field 'verdict' is {verdict}, and its value gives {due} {again.reason}".rstrip()
    tolerance = _tolerance(check, again)
    for field, was, right, apart in (
        ("expanded", check.expanded, again.expanded, tolerance),
        ("margin", check.margin, again.margin, tolerance),
        ("tur", check.tur, again.tur, 0.0),
    ):
        if field == "tur" and check.value is None:
            continue  # earlier versions wrote one for a value that is not a number
        if not _same(was, right, apart):
            yield f"{name}: field '{field}' is {was}, and its value gives {right}"


def _unfit(check: Check, limit: Limit) -> Iterator[str]:
    """Yield a sentence for every invalid field without which nothing can be judged."""
    if check.uncertainty is not None and not check.uncertainty >= 0:
        yield f"field 'uncertainty' is {check.uncertainty}, and must not be negative"
    if check.dof is not None and not check.dof > 0:
        yield f"field 'dof' is {check.dof}, and must be above zero"
    if check.status and check.status not in _STATUSES:
        yield f"field 'status' is '{check.status}', and must be one of {', '.join(FigureStatus)}"
    for side, bound in (("min", check.limit.min), ("max", check.limit.max)):
        if bound is not None and not _is_number(bound):
            yield f"field 'limit.{side}' is '{bound}', and must be a number"
    if not isinstance(check.value, str) and limit.unit and limit.equals is None:
        try:
            convert(0.0, check.unit, limit.unit)
        except UnitError as error:
            yield f"field 'unit' is '{check.unit}', and the limit is in {limit.unit}: {error}"


@lru_cache
def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _judge(check: Check, limit: Limit) -> Judgement:
    if isinstance(check.value, str):
        return judge(check.value, limit)
    figure = Figure(
        value=math.nan if check.value is None else check.value,
        unit=check.unit,
        uncertainty=check.uncertainty,
        dof=math.inf if check.dof is None else check.dof,
        status=FigureStatus(check.status or FigureStatus.MEASURED),
    )
    return judge(figure, limit)


def _may_be_worse(check: Check, again: Judgement) -> bool:
    if check.value is None or (check.verdict is Verdict.INCONCLUSIVE and check.status is None):
        return True
    return again.margin is not None and abs(again.margin) <= _tolerance(check, again)


def _tolerance(check: Check, again: Judgement) -> float:
    """Return the tolerance for figures in the limit's unit: they are written with 12 digits."""
    bounds = [float(side) for side in (check.limit.min, check.limit.max) if side is not None]
    value = again.value if isinstance(again.value, float) and math.isfinite(again.value) else 0.0
    return _LAST_DIGITS * max(abs(number) for number in (value, again.expanded or 0.0, *bounds))


def _written_limit(check: Check) -> Limit:
    bounds = check.limit
    return _limit(check.parameter, check.limit_unit, bounds.min, bounds.max, bounds.equals, check.decision)


@lru_cache
def _limit(
    parameter: str, unit: str, minimum: str | None, maximum: str | None, equals: str | None, decision: Decision
) -> Limit:
    return Limit(parameter=parameter, unit=unit, minimum=minimum, maximum=maximum, equals=equals, decision=decision)


def _frozen_limit(check: Check, entry: FrozenRequirement) -> Limit | None:
    return next((_of_frozen(each) for each in entry.limits if each.parameter == check.parameter), None)


@lru_cache
def _of_frozen(limit: FrozenLimit) -> Limit:
    return limit.limit


_OF_LIMIT = {
    "minimum": "limit.min",
    "maximum": "limit.max",
    "equals": "limit.equals",
    "unit": "limit_unit",
    "decision": "decision",
}
"""Names of a limit's fields that differ in a check's event."""


def _against_catalogue(name: str, written: Limit, frozen: Limit) -> Iterator[str]:
    if written == frozen:
        return
    for attribute, field in _OF_LIMIT.items():
        if getattr(written, attribute) != getattr(frozen, attribute):
            was, due = getattr(written, attribute), getattr(frozen, attribute)
            yield f"{name}: field '{field}' is {was}, and the catalogue has {due}"


def _same(written: float | None, again: float | None, tolerance: float) -> bool:
    if written is None or again is None:
        return written is again
    return math.isclose(written, again, rel_tol=_LAST_DIGITS, abs_tol=tolerance)
