"""Checks of one parameter: a row each, with its uncertainty, over the limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hil.model.verdict import Verdict
from hil.report.drawing.axes import TITLE, Panel, draw_limits
from hil.report.drawing.scales import Band, Scale, spread
from hil.report.drawing.sheet import WIDTH, Sheet, plain, width_of

__all__ = ["Point", "draw_points"]

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


def _ends(point: Point) -> tuple[float, ...]:
    return (point.value,) if point.expanded is None else (point.value - point.expanded, point.value + point.expanded)


def _mark(sheet: Sheet, scale: Scale, line: int, point: Point) -> None:
    if point.expanded is not None:
        low, high = (scale.at(end) for end in _ends(point))
        cap = f"m0-{_CAP}v{2 * _CAP}"
        sheet.path(_BARS.get(point.verdict, "bar open"), f"M{low} {line}H{high}M{low} {line}{cap}M{high} {line}{cap}")
    kind, outline = _MARKS.get(point.verdict, _OPEN)
    sheet.path(kind, f"M{scale.at(point.value)} {line}{outline}")
