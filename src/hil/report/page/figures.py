"""Drawings for the page: inline SVG, small, the same bytes for the same numbers."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any, Self

from hil.model.verdict import Verdict
from hil.report.material import Trace

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Band", "Point", "decimate", "draw_points", "draw_traces", "finite"]

_Axes = Any  # matplotlib publishes no types
_WIDTH = 7.2  # inches: the text width of an A4 page
_ABOVE, _BELOW, _BETWEEN = 0.28, 0.48, 0.14
_CHARACTER = 0.068  # the width of one, on average and generously
_LONGEST_NAME, _LONGEST_LABEL = 24, 44
# Colours that the page replaces by its own, so that a drawing follows dark, light and print.
_INK, _FAINT, _BAND, _LIMIT = "#010203", "#010204", "#010205", "#010206"
_LINES = ("#010211", "#010212", "#010213", "#010214")
_GOOD, _BAD, _OPEN = "#010221", "#010222", "#010223"
_VARIABLES = {
    _INK: "var(--ink)",
    _FAINT: "var(--rule)",
    _BAND: "var(--band)",
    _LIMIT: "var(--limit)",
    **{colour: f"var(--line-{place})" for place, colour in enumerate(_LINES, 1)},
    _GOOD: "var(--good)",
    _BAD: "var(--bad)",
    _OPEN: "var(--open)",
}
_DASHES = ((None, None), (5, 1.5), (1.5, 1.5), (6, 1.5, 1.5, 1.5))
_MARKS = {Verdict.PASS: ("o", _GOOD), Verdict.RECORDED: ("D", _INK), Verdict.FAIL: ("X", _BAD)}
_STYLE = {
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "svg.fonttype": "none",  # text stays text: it can be searched, and its size is the reader's
    "font.family": "DejaVu Sans",
    "font.size": 8.0,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "axes.edgecolor": _INK,
    "axes.labelcolor": _INK,
    "axes.titlecolor": _INK,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": False,
    "axes.formatter.useoffset": False,
    "grid.color": _FAINT,
    "grid.linewidth": 0.5,
    "xtick.color": _INK,
    "ytick.color": _INK,
    "text.color": _INK,
    "text.parse_math": False,  # a name may hold a dollar sign
    "path.simplify": True,
    "path.simplify_threshold": 0.25,
    "legend.frameon": False,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """Limits to be drawn behind channels of the same unit; None is open on that side."""

    unit: str
    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One check in a chart: its label, value, expanded uncertainty and verdict."""

    label: str
    value: float
    expanded: float | None
    verdict: Verdict


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
    low = np.argmin(np.where(np.isnan(rows), np.inf, rows), axis=1)
    high = np.argmax(np.where(np.isnan(rows), -np.inf, rows), axis=1)
    base = np.arange(0, whole, stretch)
    rest = np.arange(whole, size)
    kept = np.unique(np.concatenate([base + low, base + high, rest[:1], rest[-1:]]))
    return times[kept], values[kept]


def draw_traces(title: str, traces: Sequence[Trace], bands: Sequence[Band]) -> str:
    """Return the channels over time as SVG, one panel per unit, with the limit bands of that unit behind them."""
    units = list(dict.fromkeys(trace.unit for trace in traces))
    shared = [trace for trace in traces if sum(other.unit == trace.unit for other in traces) > 1]
    right = max((0.55 + _CHARACTER * len(_plain(trace.name, _LONGEST_NAME)) for trace in shared), default=0.15)
    with _Sheet(rows=len(units), height=1.3, left=0.75, right=right) as sheet:
        scale, word = _time_unit(traces)
        for axes, unit in zip(sheet.axes, units, strict=True):
            own = [trace for trace in traces if trace.unit == unit]
            _panel(axes, own, scale)
            _bands(axes, [band for band in bands if band.unit == unit])
            axes.set_ylabel(_plain(f"{own[0].name} / {unit or 1}" if len(own) == 1 else unit or "1", _LONGEST_NAME))
        sheet.axes[0].set_title(_plain(title))
        sheet.axes[-1].set_xlabel(f"bench time / {word}")
        return sheet.svg(title)


def draw_points(title: str, points: Sequence[Point], band: Band) -> str:
    """Return checks of one parameter as SVG: a row each, with its uncertainty, over the limit band."""
    labels = [_plain(point.label, _LONGEST_LABEL) for point in points]
    left = 0.25 + _CHARACTER * max(len(label) for label in labels)
    with _Sheet(rows=1, height=0.2 * max(len(points), 2), left=left, right=0.15) as sheet:
        axes = sheet.axes[0]
        for row, point in enumerate(points):
            marker, colour = _MARKS.get(point.verdict, ("s", _OPEN))
            axes.errorbar(
                [point.value], [row], xerr=point.expanded, fmt=marker, color=colour, markersize=5, capsize=2.5, lw=1.0
            )
        _bands(axes, [band], vertical=True)
        axes.set_yticks(range(len(points)), labels)
        axes.set_ylim(len(points) - 0.5, -0.5)
        axes.grid(visible=False, axis="y")
        axes.set_xlabel(_plain(band.unit) or "1")
        axes.set_title(_plain(title))
        return sheet.svg(title)


def _panel(axes: _Axes, traces: Sequence[Trace], scale: float) -> None:
    for place, trace in enumerate(traces):
        line = place % len(_LINES)
        (drawn,) = axes.plot(
            trace.times / scale, trace.values, color=_LINES[line], lw=0.9, label=_plain(trace.name, _LONGEST_NAME)
        )
        if _DASHES[line][0] is not None:
            drawn.set_dashes(_DASHES[line])
    if len(traces) > 1:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7.5, handlelength=2.4, borderaxespad=0.2)
    axes.margins(x=0.01)


def _bands(axes: _Axes, bands: Sequence[Band], *, vertical: bool = False) -> None:
    """Draw what is allowed, and its edges, behind what is drawn already; an open side goes to the axis' end."""
    span, line = (axes.axvspan, axes.axvline) if vertical else (axes.axhspan, axes.axhline)
    for band in bands:
        for edge in (band.low, band.high):
            if edge is not None:
                line(edge, color=_LIMIT, lw=0.9, dashes=(4, 2), zorder=1)
    first, last = axes.get_xlim() if vertical else axes.get_ylim()
    for band in bands:
        if band.low is not None or band.high is not None:
            low, high = (first if band.low is None else band.low), (last if band.high is None else band.high)
            span(low, high, color=_BAND, lw=0, zorder=0)
    (axes.set_xlim if vertical else axes.set_ylim)(first, last)


def _time_unit(traces: Sequence[Trace]) -> tuple[float, str]:
    longest = max((float(trace.times[-1]) for trace in traces if len(trace.times)), default=0.0)
    return (3600.0, "h") if longest > 7200 else (60.0, "min") if longest > 300 else (1.0, "s")


def _plain(text: str, longest: int = 90) -> str:
    """Return the text without what no drawing can show, shortened in the middle."""
    shown = "".join(character if character.isprintable() else "\N{REPLACEMENT CHARACTER}" for character in text)
    return shown if len(shown) <= longest else f"{shown[: longest // 2]}…{shown[-longest // 2 + 1 :]}"


class _Sheet:
    """A figure of its own, without pyplot's global state, drawn in our style.

    Args:
        rows: how many panels it has.
        height: of one panel, in inches.
        left: room for the labels of its rows, in inches.
        right: room for its legend, in inches.
    """

    def __init__(self, *, rows: int, height: float, left: float, right: float) -> None:
        import matplotlib as mpl  # noqa: PLC0415 - slow to import

        self._style = mpl.rc_context({**_STYLE, "svg.hashsalt": "hil"})
        self._rows, self._height, self._left, self._right = rows, height, left, right

    def __enter__(self) -> Self:
        from matplotlib.backends.backend_svg import FigureCanvasSVG  # noqa: PLC0415 - slow to import
        from matplotlib.figure import Figure  # noqa: PLC0415 - slow to import

        self._style.__enter__()
        # Margins are in inches and counted from the text: a layout engine takes longer than all the drawing.
        inner = self._rows * self._height + (self._rows - 1) * _BETWEEN
        whole = _ABOVE + inner + _BELOW
        self._figure = Figure(figsize=(_WIDTH, whole))
        self._figure.subplots_adjust(
            left=self._left / _WIDTH,
            right=1 - self._right / _WIDTH,
            bottom=_BELOW / whole,
            top=1 - _ABOVE / whole,
            hspace=_BETWEEN / self._height,
        )
        self._canvas = FigureCanvasSVG(self._figure)
        self.axes = list(self._figure.subplots(self._rows, 1, sharex=True, squeeze=False)[:, 0])
        return self

    def __exit__(self, *failure: object) -> None:
        self._style.__exit__(None, None, None)

    def svg(self, title: str) -> str:
        """Return the drawing as an element that can stand inside an HTML page."""
        stream = io.StringIO()
        nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
        self._canvas.print_svg(stream, metadata=nothing)
        self._figure.clear()
        return _inline(stream.getvalue(), title)


def _inline(svg: str, title: str) -> str:
    """Strip what only a file needs, shorten numbers, and take the page's colours."""
    body = svg[svg.index("<svg") :]
    body = re.sub(r'\sxmlns(:xlink)?="[^"]*"', "", body)
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    body = re.sub(r"<style.*?</style>", "", body, flags=re.DOTALL)
    body = re.sub(r"<!--.*?-->", "", body, flags=re.DOTALL)
    body = re.sub(r'\sid="(?![mp][0-9a-f]{10}")[^"]*"', "", body)
    body = re.sub(r'(?<=[\s"(,])-?\d+\.\d{3,}', lambda match: f"{float(match[0]):.2f}", body)
    body = re.sub(r"\s*\n\s*", " ", body)
    for colour, variable in _VARIABLES.items():
        body = body.replace(colour, variable)
    described = escape(_plain(title), quote=True)
    return re.sub(r"<svg [^>]*>", lambda match: _opening(match[0], described), body, count=1).strip()


def _opening(tag: str, described: str) -> str:
    box = re.search(r'viewBox="[^"]*"', tag)
    return f'<svg role="img" aria-label="{described}" {box[0] if box else ""}>'


def finite(value: object) -> float | None:
    """Return a number that can be drawn, or None."""
    if isinstance(value, str):
        try:
            value = float(value)
        except ValueError:
            return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value)
