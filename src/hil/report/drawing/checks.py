"""Checks as small drawings beside their values: where each lies within its limits, on one scale for a parameter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hil.evidence.events import Check
from hil.model.verdict import Verdict
from hil.report.drawing.panel import DISC, Band, Scale, Sheet, finite, plain, spread

__all__ = ["Point", "bounds_by_case", "bounds_of", "draw_bars", "points_of", "short"]

_WIDE, _HIGH = 1_500, 200
_MARGIN = 60
_CAP = 28
# A shape per verdict, so that they differ without colour: a disc, a diamond, a cross, and a square for the open ones.
_MARKS = {
    Verdict.PASS: ("mark good", DISC),
    Verdict.RECORDED: ("mark neutral", "m0-42l42 42l-42 42l-42-42z"),
    Verdict.FAIL: ("mark bad", "m-46-26l20-20l26 26l26-26l20 20l-26 26l26 26l-20 20l-26-26l-26 26l-20-20l26-26z"),
}
_OPEN = ("mark open", "m-32-32h64v64h-64z")
_BARS = {Verdict.PASS: "bar good", Verdict.RECORDED: "bar neutral", Verdict.FAIL: "bar bad"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One check in a drawing: its label, value, expanded uncertainty and verdict."""

    label: str
    value: float
    expanded: float | None
    verdict: Verdict


def points_of(checks: Sequence[Check]) -> tuple[Point | None, ...]:
    """Return the checks of one parameter as points; None for what cannot be drawn.

    That is a word, a value that is not finite, a criterion of a recording, and a count that is zero throughout.
    """
    if not any(finite(check.value) or check.expanded for check in checks) or all(map(_of_recording, checks)):
        return (None,) * len(checks)
    return tuple(None if isinstance(check.value, str) else _point(check) for check in checks)


def bounds_by_case(checks: Sequence[Check]) -> dict[str, list[Band]]:
    """Return the limits of the checks of each case that values in the unit of the check can be drawn over."""
    found: dict[str, list[Band]] = {}
    for check in checks:
        if (band := bounds_of(check)) is not None:
            found.setdefault(check.case, []).append(band)
    return found


def bounds_of(check: Check) -> Band | None:
    """Return the limit of a check as a band in the unit of its value, or None where it has no such limit."""
    low, high = finite(check.limit.min), finite(check.limit.max)
    if (low is None and high is None) or check.limit_unit not in {"", check.unit}:
        return None
    return Band(unit=check.unit, low=low, high=high)


def draw_bars(points: Sequence[Point | None], band: Band | None) -> tuple[str, ...]:
    """Return each check of one parameter as SVG over the limit band, all on one scale; empty without a point.

    Args:
        points: the checks.
        band: their limits.
    """
    edges = band.edges if band else ()
    ends = [end for point in points if point for end in _ends(point)]
    if not ends or (not edges and len(points) < 2):
        return ("",) * len(points)
    low, high = spread([*ends, *edges], 0.08)
    scale = Scale(low=low, high=high, first=_MARGIN, last=_WIDE - _MARGIN)
    return tuple(_drawn(point, band, scale) if point else "" for point in points)


def short(case: str) -> str:
    """Return the name of a case without its file."""
    return case.rsplit("::", 1)[-1]


def _drawn(point: Point, band: Band | None, scale: Scale) -> str:
    sheet = Sheet()
    middle = _HIGH // 2
    if band:
        low, high = (
            scale.at(end if edge is None else edge) for edge, end in ((band.low, scale.low), (band.high, scale.high))
        )
        sheet.area("band", (low, 0), (high, _HIGH))
        for edge in band.edges:
            sheet.line("limit", (scale.at(edge), 0), (scale.at(edge), _HIGH))
    sheet.line("grid", (scale.first, middle), (scale.last, middle))
    _mark(sheet, scale, middle, point)
    return sheet.svg(f"{plain(point.label)}: {point.verdict}", _HIGH, _WIDE)


def _of_recording(check: Check) -> bool:
    """Return whether a check judges a recording itself: its length and rate are as planned."""
    return bool(bounds_of(check)) and check.verdict is Verdict.RECORDED


def _point(check: Check) -> Point | None:
    value = finite(check.value)
    same = check.limit_unit in {"", check.unit}
    return value if value is None else Point(
        label=check.at or check.of or check.parameter,
        value=value,
        expanded=(finite(check.expanded) or None) if same else None,  # of zero there is nothing to draw
        verdict=check.verdict,
    )  # fmt: skip


def _ends(point: Point) -> tuple[float, ...]:
    return (point.value,) if point.expanded is None else (point.value - point.expanded, point.value + point.expanded)


def _mark(sheet: Sheet, scale: Scale, line: int, point: Point) -> None:
    if point.expanded is not None:
        low, high = (scale.at(end) for end in _ends(point))
        cap = f"m0-{_CAP}v{2 * _CAP}"
        sheet.path(_BARS.get(point.verdict, "bar open"), f"M{low} {line}H{high}M{low} {line}{cap}M{high} {line}{cap}")
    kind, outline = _MARKS.get(point.verdict, _OPEN)
    sheet.path(kind, f"M{scale.at(point.value)} {line}{outline}")
