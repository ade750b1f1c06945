"""Channels over time: a panel per unit, with the limits of that unit behind them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from hil.report.drawing.axes import TITLE, Panel, draw_limits
from hil.report.drawing.scales import Band, Scale, finite, spread
from hil.report.drawing.sheet import WIDTH, Sheet, plain, polyline, width_of
from hil.report.material import Trace

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["decimate", "draw_traces"]

_ABOVE, _BELOW, _BETWEEN, _HEIGHT = 260, 380, 180, 1_200
_ENTRY = 150  # the height of one name beside a panel
_NAME = 24
_KINDS = 4  # of colours, and of dashes: together they tell sixteen channels apart
_TIMES = ((7200.0, 3600.0, "h"), (300.0, 60.0, "min"))


def decimate(
    times: NDArray[np.float64], values: NDArray[np.float64], points: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return at most about `points` samples that keep the lowest and highest of every stretch.

    Args:
        times: instants, shape (n,).
        values: samples, shape (n,); NaN stays a hole only where a whole stretch is NaN.
        points: how many samples may remain, at least 2.
    """
    import numpy as np  # noqa: PLC0415 - slow to import

    size = len(values)
    stretch = -(-size // max(points // 2, 1))
    if size <= points or stretch < 2:
        return times, values
    whole = size // stretch * stretch
    rows = values[:whole].reshape(-1, stretch)
    holes = np.isnan(rows)
    pierced = bool(holes.any())  # weeks of samples are copied for holes only if there are some
    low = np.argmin(np.where(holes, np.inf, rows) if pierced else rows, axis=1)
    high = np.argmax(np.where(holes, -np.inf, rows) if pierced else rows, axis=1)
    base = np.arange(0, whole, stretch)
    rest = np.arange(whole, size)
    kept = np.unique(np.concatenate([base + low, base + high, rest[:1], rest[-1:]]))
    return times[kept], values[kept]


def draw_traces(title: str, traces: Sequence[Trace], bands: Sequence[Band]) -> str:
    """Return the channels over time as SVG, one panel per unit, with the limit bands of that unit behind them."""
    panels = [[trace for trace in traces if trace.unit == unit] for unit in dict.fromkeys(t.unit for t in traces)]
    begin, end = spread([time for trace in traces for time in _ends(trace)], 0.01)
    scale, word = next(((size, name) for long, size, name in _TIMES if end - begin > long), (1.0, "s"))
    ranges = [_range(own, [band for band in bands if band.unit == own[0].unit]) for own in panels]
    named = [width_of(plain(trace.name, _NAME)) + 520 for own in panels if len(own) > 1 for trace in own]
    right = WIDTH - max(named, default=120)
    left = 340 + max(width_of(label) for low, high in ranges for _, label in _ticks(low, high))
    across = Scale(low=begin / scale, high=end / scale, first=left, last=right)
    sheet, top = Sheet(), _ABOVE
    sheet.text("title", (left, TITLE), plain(title))
    for own, (low, high) in zip(panels, ranges, strict=True):
        bottom = top + max(_HEIGHT, _ENTRY * len(own))
        panel = Panel(x=across, y=Scale(low=low, high=high, first=bottom, last=top))
        draw_limits(sheet, panel, [band for band in bands if band.unit == own[0].unit], upright=False)
        panel.across(sheet, 9, labelled=own is panels[-1], title=across.titled(f"bench time / {word}"))
        panel.upward(sheet, _ticks(low, high), grid=True)
        unit = panel.y.titled(own[0].unit) or "1"
        panel.named(sheet, f"{own[0].name} / {unit}" if len(own) == 1 else unit)
        _lines(sheet, panel, own, scale)
        top = bottom + _BETWEEN
    return sheet.svg(title, top - _BETWEEN + _BELOW)


def _ends(trace: Trace) -> list[float]:
    ends = [float(trace.times[0]), float(trace.times[-1])] if len(trace.times) else []
    return [end for end in ends if finite(end) is not None]


def _range(traces: Sequence[Trace], bands: Sequence[Band]) -> tuple[float, float]:
    """Return the ends of the upward axis: every value is within, and every limit too."""
    edges = [edge for band in bands for edge in band.edges]
    extremes = [
        float(end) for trace in traces for known in (_drawable(trace.values),) if known.any()
        for end in (trace.values[known].min(), trace.values[known].max())
    ]  # fmt: skip
    return spread([*edges, *extremes], 0.06)


def _drawable(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    import numpy as np  # noqa: PLC0415 - slow to import

    return np.isfinite(values) & (np.abs(values) < 1e300)


def _ticks(low: float, high: float) -> list[tuple[float, str]]:
    return Scale(low=low, high=high, first=0, last=1).ticks(6)


def _lines(sheet: Sheet, panel: Panel, traces: Sequence[Trace], scale: float) -> None:
    for place, trace in enumerate(traces):
        kind = f"line c{place % _KINDS} d{(place + place // _KINDS) % _KINDS}"
        sheet.path(kind, _path(panel, trace, scale))
        if len(traces) > 1:
            left, line = panel.x.last + 120, panel.y.last + 60 + _ENTRY * place
            sheet.line(kind, (left, line), (left + 260, line))
            sheet.text("begin", (left + 320, line + 40), plain(trace.name, _NAME))


def _path(panel: Panel, trace: Trace, scale: float) -> str:
    """Return the steps of a channel's line, interrupted where there is no number."""
    import numpy as np  # noqa: PLC0415 - slow to import

    known = _drawable(trace.values) & _drawable(trace.times)
    x, y = (np.zeros(len(known), dtype=np.int64) for _ in range(2))
    for axis, values, places in ((panel.x, trace.times / scale, x), (panel.y, trace.values, y)):
        share = (values[known] - axis.low) / (axis.high - axis.low)
        places[known] = np.rint(axis.first + share * (axis.last - axis.first))
    cuts = np.flatnonzero(np.diff(known)) + 1
    runs = pairwise([0, *cuts.tolist(), len(known)])
    return "".join(polyline(_bends(x[begin:end], y[begin:end])) for begin, end in runs if end > begin and known[begin])


def _bends(x: NDArray[np.int64], y: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Return the places of a line without those that it passes anyway on a level stretch."""
    import numpy as np  # noqa: PLC0415 - slow to import

    kept = np.ones(len(x), dtype=bool)
    kept[1:-1] = (y[1:-1] != y[:-2]) | (y[1:-1] != y[2:])
    return list(zip(x[kept].tolist(), y[kept].tolist(), strict=True))
