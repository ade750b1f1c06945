"""Charts that a plan chose for the first page: points with their bars, models, residuals and limits."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

from hil.documents.text import counted
from hil.evidence.events import Chart, ChartCurve, ChartLimit
from hil.report.drawing.panel import (
    DISC,
    WIDTH,
    Graphic,
    LogScale,
    Panel,
    Scale,
    Sheet,
    finite,
    legend_height,
    plain,
    polyline,
    spread,
    width_of,
)

__all__ = ["chart_graphics", "draw_chart"]

_HEIGHT, _RESIDUALS, _BETWEEN = 1_350, 560, 170
_ABOVE, _BELOW = 60, 380
_KINDS = 4
_FINE = 64  # parts of a limit that is not level
_NAME = 24
_MANY = 40  # points of a curve, from which on they are small
_SMALL = "m-16 0a16 16 0 1 0 32 0a16 16 0 1 0-32 0z"

Pair = tuple[float, float]


def chart_graphics(charts: Sequence[Chart]) -> tuple[Graphic, ...]:
    """Return the charts in order of appearance; those of one title and of the same axes are one.

    If a case was tried several times, the last curve of a name counts.
    """
    groups: dict[object, list[Chart]] = {}
    for chart in charts:
        groups.setdefault((chart.title, chart.x, chart.y, chart.log), []).append(chart)
    return tuple(
        Graphic(title=members[0].title, described=_told(merged), svg=draw_chart(merged))
        for members in groups.values()
        for merged in [_merged(members)]
    )


def draw_chart(chart: Chart) -> str:
    """Return a chart as SVG: the curves over their limits, and a panel of residuals below if there are any."""
    curves = list(zip(_kinds([curve.name for curve in chart.curves]), chart.curves, strict=True))
    known = [pair for curve in chart.curves for pair in _values(curve, log=chart.log)]
    upper, lower = ([each for each in chart.limits if each.residual is below] for below in (False, True))
    across = _ends([x for x, _ in known], 0.03, log=chart.log)
    upward = _ends(_heights(chart.curves, known, upper, across, log=chart.log), 0.07, log=chart.log)
    residuals = [each for curve in chart.curves for each in curve.residual if finite(each) is not None]
    below = _ends([*(each for each in residuals if each is not None), *_edges(lower)], 0.12, log=False)
    labels = [
        *_scale(upward, 0, 1, log=chart.log).ticks(6),
        *(_scale(below, 0, 1, log=False).ticks(3) if residuals else ()),
    ]
    left = 320 + max((width_of(label) for _, label in labels), default=0)
    names = [plain(curve.name, _NAME) for curve in chart.curves] if len(chart.curves) > 1 else []
    top = _ABOVE + legend_height(names, WIDTH - left - 100)
    last = max((width_of(label) for _, label in _scale(across, 0, 1, log=chart.log).ticks(6)[-1:]), default=0)
    x = _scale(across, left, WIDTH - max(100, last // 2 + 20), log=chart.log)
    main = Panel(x=x, y=_scale(upward, top + _HEIGHT, top, log=chart.log))
    sheet = Sheet()
    main.legend(sheet, [(_mark(kind), name) for (kind, _), name in zip(curves, names, strict=False)])
    _draw(sheet, main, curves, upper, residual=False, labelled=not residuals, chart=chart)
    bottom = top + _HEIGHT
    if residuals:
        panel = Panel(x=x, y=_scale(below, bottom + _BETWEEN + _RESIDUALS, bottom + _BETWEEN, log=False))
        left_over = [
            (kind, ChartCurve(name=curve.name, x=curve.x, y=curve.residual)) for kind, curve in curves if curve.residual
        ]
        _draw(sheet, panel, left_over, lower, residual=True, labelled=True, chart=chart)
        bottom += _BETWEEN + _RESIDUALS
    return sheet.svg(chart.title, bottom + _BELOW)


def _merged(members: Sequence[Chart]) -> Chart:
    curves = {curve.name: curve for chart in members for curve in chart.curves}
    limits = dict.fromkeys(limit for chart in members for limit in chart.limits)
    first = members[0]
    return Chart(
        case=first.case,
        step=first.step,
        title=first.title,
        x=first.x,
        y=first.y,
        curves=tuple(curves.values()),
        limits=tuple(limits),
        log=first.log,
        lines=", ".join(dict.fromkeys(each.lines for each in members if each.lines)),
    )


def _told(chart: Chart) -> str:
    """Return what a chart shows, for the caption."""
    parts = []
    if any(curve.expanded for curve in chart.curves):
        parts.append("bars are expanded uncertainties")
    if any(curve.model_x for curve in chart.curves):
        parts.append(f"lines are {chart.lines or 'the model'}")
    if any(curve.residual for curve in chart.curves):
        parts.append("residuals are below")
    if chart.limits:
        named = ", ".join(dict.fromkeys(f"{each.requirement} {each.parameter}" for each in chart.limits))
        parts.append(f"the dashed line is the limit of {named}")
    points = sum(len(curve.x) for curve in chart.curves)
    told = f"{counted(points, 'point')}; {'; '.join(parts)}" if parts else counted(points, "point")
    return f"{told}."


def _draw(
    sheet: Sheet,
    panel: Panel,
    curves: Sequence[tuple[int, ChartCurve]],
    limits: Sequence[ChartLimit],
    *,
    residual: bool,
    labelled: bool,
    chart: Chart,
) -> None:
    for limit in limits:
        for edge, open_end in ((limit.max, panel.y.low), (limit.min, panel.y.high)):
            if edge is not None:
                _limit(sheet, panel, limit, edge, open_end)
    unit = panel.x.titled("" if chart.x.unit == "1" else chart.x.unit)
    panel.across(sheet, 6, labelled=labelled, title=" / ".join(part for part in (chart.x.name, unit) if part))
    panel.upward(sheet, panel.y.ticks(3 if residual else 6), grid=True)
    scaled = panel.y.titled("" if chart.y.unit == "1" else chart.y.unit)
    panel.named(sheet, " / ".join(part for part in ("residual" if residual else chart.y.name, scaled) if part))
    for kind, curve in curves:
        _curve(sheet, panel, kind, curve)


def _curve(sheet: Sheet, panel: Panel, kind: int, curve: ChartCurve) -> None:
    log = isinstance(panel.y, LogScale)
    for known, run in groupby(zip(curve.model_x, curve.model_y, strict=True), lambda pair: _drawable(pair, log=log)):
        if known:
            line = polyline((panel.x.at(x), panel.y.at(y)) for x, y in run if x is not None and y is not None)
            sheet.path(_line(kind), line)
    bars = curve.expanded or (None,) * len(curve.x)
    for x, y, bar in zip(curve.x, curve.y, bars, strict=True):
        if x is None or y is None or not _drawable((x, y), log=log):
            continue
        place, middle = panel.x.at(x), panel.y.at(y)
        if bar is not None:
            sheet.path(
                _line(kind), f"M{place} {panel.y.at(y - bar if not log or y > bar else y)}V{panel.y.at(y + bar)}"
            )
        sheet.path(_mark(kind), f"M{place} {middle}{DISC if len(curve.x) <= _MANY else _SMALL}")


def _kinds(names: Sequence[str]) -> Sequence[int]:
    """Return the kind of each curve: in pairs such as `x heating` and `x cooling` one colour, filled and hollow."""
    whose, which = ([*dict.fromkeys(name.rpartition(" ")[place] for name in names)] for place in (0, 2))
    if "" in whose or not 1 < len(whose) <= _KINDS or len(which) != 2:
        return range(len(names))
    parts = [name.rpartition(" ") for name in names]
    return [whose.index(first) + _KINDS * which.index(last) for first, _, last in parts]


def _line(kind: int) -> str:
    return f"line c{kind % _KINDS} d{kind // _KINDS % _KINDS}"


def _mark(kind: int) -> str:
    """Return the class of a curve's points: from the fifth one on they are hollow, so that colours can repeat."""
    return f"mark{' hollow' if kind // _KINDS % 2 else ''} k{kind % _KINDS}"


def _limit(sheet: Sheet, panel: Panel, limit: ChartLimit, edge: float, open_end: float) -> None:
    """Draw one side of a limit as a dashed line, with the allowed range shaded where the limit is level."""
    x = panel.x
    if not limit.power:
        other = limit.min if edge == limit.max and limit.min is not None else open_end
        if edge == limit.max or limit.max is None:
            sheet.area("band", (x.first, panel.y.at(edge)), (x.last, panel.y.at(other)))
        sheet.line("limit", (x.first, panel.y.at(edge)), (x.last, panel.y.at(edge)))
        return
    ratio = x.high / x.low if x.low > 0 else 0.0
    where = [x.low * ratio ** (part / _FINE) for part in range(_FINE + 1)] if ratio else []
    sheet.path("limit", polyline((x.at(each), panel.y.at(edge * each**limit.power)) for each in where) if where else "")


def _values(curve: ChartCurve, *, log: bool) -> Iterator[Pair]:
    for x, y in (*zip(curve.x, curve.y, strict=True), *zip(curve.model_x, curve.model_y, strict=True)):
        if x is not None and y is not None and _drawable((x, y), log=log):
            yield x, y


def _drawable(pair: tuple[float | None, float | None], *, log: bool) -> bool:
    return all(each is not None and finite(each) is not None and (each > 0 or not log) for each in pair)


def _heights(
    curves: Iterable[ChartCurve], known: Iterable[Pair], limits: Sequence[ChartLimit], across: Pair, *, log: bool
) -> list[float]:
    """Return what the left axis has to cover: values, their bars, and all limits."""
    ends = [y for _, y in known]
    for curve in curves:
        for y, bar in zip(curve.y, curve.expanded, strict=False):
            if y is not None and bar is not None:
                ends += [end for end in (y - bar, y + bar) if end > 0 or not log]
    ends += _edges([each for each in limits if not each.power])
    if log:
        ends += [
            edge * end**each.power
            for each in limits
            if each.power
            for edge in _edges([each])
            for end in across
            if end > 0
        ]
    return ends


def _edges(limits: Iterable[ChartLimit]) -> list[float]:
    return [edge for each in limits for edge in (each.min, each.max) if edge is not None]


def _ends(values: Sequence[float], margin: float, *, log: bool) -> Pair:
    if not log:
        return spread(values, margin)
    low, high = min(values, default=1.0), max(values, default=10.0)
    if high <= low * 1.01:
        return low / 3, high * 3
    factor = (high / low) ** margin
    return low / factor, high * factor


def _scale(ends: Pair, first: int, last: int, *, log: bool) -> Scale:
    return (LogScale if log else Scale)(low=ends[0], high=ends[1], first=first, last=last)
