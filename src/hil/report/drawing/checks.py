"""Checks as charts: one for each parameter, a row a check with its uncertainty over the limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hil.evidence.events import Check
from hil.model.verdict import Verdict
from hil.report.drawing.panel import (
    TITLE,
    WIDTH,
    Band,
    Graphic,
    Panel,
    Scale,
    Sheet,
    draw_limits,
    finite,
    plain,
    spread,
    width_of,
)
from hil.report.sentences import counted

__all__ = ["Point", "bounds_by_case", "charts", "draw_points", "short"]

_MOST_ROWS = 40  # of one chart
_ABOVE, _BELOW, _ROW = 260, 380, 200
_CAP = 28
_LABEL = 44
# A shape per verdict, so that they differ without colour: a disc, a diamond, a cross, and a square for the open ones.
_MARKS = {
    Verdict.PASS: ("mark good", "m-34 0a34 34 0 1 0 68 0a34 34 0 1 0-68 0z"),
    Verdict.RECORDED: ("mark neutral", "m0-42l42 42l-42 42l-42-42z"),
    Verdict.FAIL: ("mark bad", "m-46-26l20-20l26 26l26-26l20 20l-26 26l26 26l-20 20l-26-26l-26 26l-20-20l26-26z"),
}
_OPEN = ("mark open", "m-32-32h64v64h-64z")
_BARS = {Verdict.PASS: "bar good", Verdict.RECORDED: "bar neutral", Verdict.FAIL: "bar bad"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One check in a chart: its label, value, expanded uncertainty and verdict."""

    label: str
    value: float
    expanded: float | None
    verdict: Verdict


def charts(checks: Sequence[Check]) -> tuple[Graphic, ...]:
    """Return a chart for each parameter that has a limit or was checked more than once, in order of appearance.

    What a recording had to be is in the table: its length and rate are as planned, and nothing to look at.
    """
    groups: dict[tuple[str, str, str], list[Check]] = {}
    for check in checks:
        if finite(check.value) is not None and not isinstance(check.value, str):
            groups.setdefault((check.requirement, check.parameter, check.unit), []).append(check)
    return tuple(
        graphic
        for (requirement, parameter, unit), members in groups.items()
        if (_bounds(members[0]) or len(members) > 1) and not _of_recordings(members)
        for graphic in _chart(requirement, parameter, unit, members)
    )


def bounds_by_case(checks: Sequence[Check]) -> dict[str, list[Band]]:
    """Return the limits of the checks of each case that values in the unit of the check can be drawn over."""
    found: dict[str, list[Band]] = {}
    for check in checks:
        if (band := _bounds(check)) is not None:
            found.setdefault(check.case, []).append(band)
    return found


def _bounds(check: Check) -> Band | None:
    """Return the limit of a check as a band in the unit of its value, or None where it has no such limit."""
    low, high = finite(check.limit.min), finite(check.limit.max)
    if (low is None and high is None) or check.limit_unit not in {"", check.unit}:
        return None
    return Band(unit=check.unit, low=low, high=high)


def draw_points(title: str, parameter: str, points: Sequence[Point], band: Band) -> str:
    """Return checks of one parameter as SVG: a row each, with its uncertainty, over the limit band.

    Args:
        title: what stands above.
        parameter: what stands at the axis, before the unit.
        points: the checks, from the top; at least one.
        band: their limits and their unit.
    """
    labels = [plain(point.label, _LABEL) for point in points]
    left = 180 + max(width_of(label) for label in labels)
    ends = [end for point in points for end in _ends(point)]
    low, high = spread([*ends, *band.edges], 0.05)
    bottom = _ABOVE + _ROW * max(len(points), 2)
    # Rows count downwards, so they lie on the negative side of an axis that runs upwards.
    panel = Panel(
        x=Scale(low=low, high=high, first=left, last=WIDTH - 120),
        y=Scale(low=0.5 - max(len(points), 2), high=0.5, first=bottom, last=_ABOVE),
    )
    unit = panel.x.titled("" if band.unit == "1" else plain(band.unit, _LABEL))
    sheet = Sheet()
    sheet.text("title", (left, TITLE), plain(title))
    if band.edges:
        draw_limits(sheet, panel, [band], upright=True)
    panel.across(sheet, 8, labelled=True, title=" / ".join(part for part in (plain(parameter, _LABEL), unit) if part))
    panel.upward(sheet, [(-float(row), label) for row, label in enumerate(labels)], grid=False)
    for row, point in enumerate(points):
        _mark(sheet, panel.x, panel.y.at(-row), point)
    return sheet.svg(title, bottom + _BELOW)


def short(case: str) -> str:
    """Return the name of a case without its file."""
    return case.rsplit("::", 1)[-1]


def _of_recordings(members: Sequence[Check]) -> bool:
    return all(_bounds(check) and check.verdict is Verdict.RECORDED for check in members)


def _chart(requirement: str, parameter: str, unit: str, members: Sequence[Check]) -> list[Graphic]:
    title = f"{requirement} {parameter}"
    several = len({check.case for check in members}) > 1
    points = [_point(check, several=several) for check in members]
    band = _bounds(members[0]) or Band(unit=unit, low=None, high=None)
    parts = [points[first : first + _MOST_ROWS] for first in range(0, len(points), _MOST_ROWS)]
    return [
        Graphic(
            title=title,
            described=_told(title, part, band),
            svg=draw_points(title, parameter, part, band),
        )
        for part in parts
    ]


def _told(title: str, points: Sequence[Point], band: Band) -> str:
    """Return what a chart shows: how many checks, and what bars, lines and shade mean where there are any."""
    within = "" if band.unit in {"", "1"} else f" in {band.unit}"
    barred = sum(point.expanded is not None for point in points)
    bars = "; bars are expanded uncertainties" if barred else ""
    some = f", known of {barred}" if 0 < barred < len(points) else ""
    limits = "; dashed lines are limits, the shade is what they allow" if band.edges else ""
    return f"{counted(len(points), 'check')} of {title}{within}{bars}{some}{limits}."


def _point(check: Check, *, several: bool) -> Point:
    same = check.limit_unit in {"", check.unit}
    labels = (check.of or "", short(check.case) if several else "")
    return Point(
        label=" · ".join(label for label in labels if label) or check.parameter,
        value=finite(check.value) or 0.0,
        expanded=(finite(check.expanded) or None) if same else None,  # of zero there is nothing to draw
        verdict=check.verdict,
    )


def _ends(point: Point) -> tuple[float, ...]:
    return (point.value,) if point.expanded is None else (point.value - point.expanded, point.value + point.expanded)


def _mark(sheet: Sheet, scale: Scale, line: int, point: Point) -> None:
    if point.expanded is not None:
        low, high = (scale.at(end) for end in _ends(point))
        cap = f"m0-{_CAP}v{2 * _CAP}"
        sheet.path(_BARS.get(point.verdict, "bar open"), f"M{low} {line}H{high}M{low} {line}{cap}M{high} {line}{cap}")
    kind, outline = _MARKS.get(point.verdict, _OPEN)
    sheet.path(kind, f"M{scale.at(point.value)} {line}{outline}")
