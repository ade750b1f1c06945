"""What belongs together on the page: checks of one parameter, headline figures, and cases that went alike."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from hil.evidence.events import Check
from hil.model.verdict import Verdict, worst
from hil.report.drawing.checks import bounds_of, draw_bars, points_of
from hil.report.numbers import span
from hil.report.page.as_run import Placed, check_row, derived_from, ids, limit_of
from hil.report.page.view import CaseGroup, CaseName, CaseView, CheckGroup, CheckRow, Headline, RecordingRow

__all__ = ["case_groups", "check_groups", "headlines"]

_MANY = 3


def check_groups(events: Iterable[Placed], names: Mapping[str, CaseName]) -> tuple[CheckGroup, ...]:
    """Return every check among the events by requirement, parameter and limit, in order of appearance."""
    groups: dict[object, list[tuple[Placed, Check]]] = {}
    for each in events:
        if isinstance(each.event, Check):
            check = each.event
            key = (check.requirement, check.parameter, limit_of(check), check.decision)
            groups.setdefault(key, []).append((each, check))
    ordered = sorted(groups.values(), key=lambda found: found[0][1].requirement)
    return tuple(_group(found, names) for found in ordered)


def headlines(events: Iterable[Placed]) -> tuple[Headline, ...]:
    """Return what the plans put on the first page: of checks of one name that which lies nearest its limit."""
    groups: dict[str, list[Check]] = {}
    for each in events:
        if isinstance(each.event, Check) and each.event.headline and each.counted:
            groups.setdefault(each.event.headline, []).append(each.event)
    return tuple(_headline(name, checks) for name, checks in groups.items())


def case_groups(cases: Sequence[CaseView]) -> tuple[CaseGroup, ...]:
    """Return the cases that began; neighbours that differ in their parameters only, and went alike, are one.

    A case that is not good, was tried again, or has something to explain stands alone.
    """
    groups: list[list[CaseView]] = []
    for case in cases:
        if not case.begun:
            continue
        if groups and _alike(groups[-1][0], case):
            groups[-1].append(case)
        else:
            groups.append([case])
    return tuple(_case_group(members) for members in groups)


def _alike(one: CaseView, other: CaseView) -> bool:
    return all(
        case.result.verdict.good and not case.attempts and not case.result.reasons for case in (one, other)
    ) and (_outline(one) == _outline(other))


def _outline(case: CaseView) -> object:
    steps = tuple((row.number, row.title, row.count, len(row.exchanges)) for row in case.steps)
    function = case.result.case.partition("[")[0]
    return function, case.result.verdict, tuple(sorted(case.result.requirements.items())), case.used, steps


def _case_group(members: Sequence[CaseView]) -> CaseGroup:
    first = members[0]
    if len(members) == 1:
        return CaseGroup(cases=(first,), steps=first.steps, recordings=first.recordings, graphics=first.graphics)
    return CaseGroup(
        cases=tuple(members),
        steps=tuple(replace(row, exchanges=(), recordings=()) for row in first.steps),
        recordings=_recordings(members),
        graphics=tuple(
            replace(graphic, title=f"{_variant(case)}: {graphic.title}")
            for case in members
            for graphic in case.graphics
        ),
    )


def _recordings(members: Sequence[CaseView]) -> tuple[RecordingRow, ...]:
    """Return the recordings of several cases; those that are alike share a row, with the numbers of their files."""
    groups: dict[object, list[RecordingRow]] = {}
    for row in (row for case in members for row in case.recordings):
        groups.setdefault(replace(row, id="", ids=(), gap="", count=0), []).append(row)
    return tuple(_recording(rows) for rows in groups.values())


def _recording(rows: Sequence[RecordingRow]) -> RecordingRow:
    gaps = list(dict.fromkeys(row.gap for row in rows))
    numbers = [name.partition("-")[0] for row in rows for name in row.ids]
    return replace(
        rows[0],
        id=ids([f"{each}-*" for each in numbers]),
        count=sum(row.count for row in rows),
        gap=gaps[0] if len(gaps) == 1 else "see results.json",
    )


def _variant(case: CaseView) -> str:
    """Return the parameters of a case, as its id has them."""
    return case.result.case.partition("[")[2].rstrip("]") or case.result.case


def _headline(name: str, checks: Sequence[Check]) -> Headline:
    margins = [check for check in checks if check.margin is not None]
    verdict = worst(check.verdict for check in checks)
    bad = [check for check in checks if not check.verdict.good]
    shown = (bad or sorted(margins, key=_nearness) or list(checks))[0]
    row = check_row(shown)
    numbers = [check.value for check in checks if isinstance(check.value, int | float)]
    several = len(checks) > 1
    spanned = several and not margins and not bad and len(numbers) == len(checks)
    if spanned:
        value = span(min(numbers), max(numbers), shown.unit, 4)
        among = f"{len(checks)} values"
    else:
        value = row.value
        among = f"closest to the limit, of {len(checks)}" if several and margins and not bad else ""
        if several and bad:
            among = f"{len(bad)} of {len(checks)} not good"
    return Headline(
        name=name,
        value=value,
        at="" if spanned else row.at,
        among=among,
        limit=row.limit,
        verdict=verdict,
        requirement=shown.requirement,
    )


def _nearness(check: Check) -> float:
    """Return the margin as a part of what the limit allows: checks of one name may have limits of many sizes."""
    edges = [float(edge) for edge in (check.limit.min, check.limit.max) if edge is not None]
    allowed = (edges[1] - edges[0]) / 2.0 if len(edges) == 2 else abs(sum(edges))
    return (check.margin or 0.0) / (allowed or 1.0)


def _group(found: Sequence[tuple[Placed, Check]], names: Mapping[str, CaseName]) -> CheckGroup:
    checks = [check for _, check in found]
    bars = draw_bars(points_of(checks), bounds_of(checks[0]))
    rows = [
        replace(check_row(check, names.get(placed.case), placed.attempt), bar=bar)
        for (placed, check), bar in zip(found, bars, strict=True)
    ]
    shared = [sentence for sentence in rows[0].closes_nothing if all(sentence in row.closes_nothing for row in rows)]
    return CheckGroup(
        requirement=checks[0].requirement,
        parameter=checks[0].parameter,
        limit=rows[0].limit,
        decision=rows[0].decision,
        rows=tuple(_own(row, shared) for row in _alike_rows(rows, checks)),
        instruments=", ".join(dict.fromkeys(name for check in checks for name in check.instruments)),
        derived_from=derived_from(name for check in checks for name in check.provenance or ()),
        closes_nothing=tuple(shared),
        drawn=any(bars),
        listed=_listed(rows, shared),
    )


def _listed(rows: Sequence[CheckRow], shared: Sequence[str]) -> bool:
    """Return whether rows have a place in a list: of one step, recorded, and none with more to say than its value."""
    plain = all(
        row.verdict is Verdict.RECORDED
        and not (row.limit or row.reason or row.coverage or _own(row, shared).closes_nothing)
        for row in rows
    )
    return plain and len(rows) > _MANY and len({(row.case, row.step, row.attempt) for row in rows}) == 1


def _alike_rows(rows: Sequence[CheckRow], checks: Sequence[Check]) -> Sequence[CheckRow]:
    """Return one row for what several recordings had to be and are, and any other rows as they are."""
    met = all(
        check.verdict is Verdict.RECORDED and row.limit and not check.at
        for row, check in zip(rows, checks, strict=True)
    )
    if len(rows) < _MANY or not met:
        return rows
    numbers = [check.value for check in checks if isinstance(check.value, int | float)]
    value = rows[0].value
    if len(numbers) == len(checks):
        value = span(min(numbers), max(numbers), checks[0].unit, 4)
    least = min(range(len(rows)), key=lambda place: checks[place].margin or 0.0)
    return [
        replace(
            rows[0], at=f"{len(rows)} recordings", value=value, margin=rows[least].margin, named=None, case="", step=""
        )
    ]


def _own(row: CheckRow, shared: Sequence[str]) -> CheckRow:
    return replace(row, closes_nothing=tuple(each for each in row.closes_nothing if each not in shared))
