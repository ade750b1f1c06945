"""Paper for drawings: SVG in whole units, axes with round numbers at their ticks, and limits behind the values.

The same numbers give the same bytes wherever a drawing is made.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from html import escape

from hil.report.numbers import prefixed

__all__ = [
    "DISC",
    "WIDTH",
    "Band",
    "Graphic",
    "LogScale",
    "Panel",
    "Scale",
    "Sheet",
    "draw_limits",
    "finite",
    "legend_height",
    "legend_rows",
    "plain",
    "polyline",
    "spread",
    "width_of",
]

WIDTH = 3_600
"""Of every drawing, in units: ten to a pixel. Two fit side by side on paper, and one on a telephone with its words."""

_CHARACTER = 62  # average width of a character, generously
_SHORTEST = 20  # a line that would be a point is drawn this long
_TICK = 35
_ENTRY = 150  # the height of one row of a legend
_SPARE = 120  # by which words beside a panel may be longer than it is high
_KEY = 400  # what a legend's entry takes beside its words
DISC = "m-34 0a34 34 0 1 0 68 0a34 34 0 1 0-68 0z"
"""The outline of a point, from its middle."""
_WORDS = 40  # how far below its middle line a text stands
_TALLEST = "240mm"  # on a page of paper
_LARGEST = 1e300  # beyond it a difference could be infinite
_NARROWEST = 1e-9  # of the largest value: less is float noise, and ticks would coincide
_EXACT = Context(prec=60)
_ROUND = (1, 2, 5, 10)
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, slots=True, kw_only=True)
class Graphic:
    """A drawing as SVG text, with its title and a text alternative."""

    title: str
    described: str
    svg: str


class Sheet:
    """The elements of one drawing, from bottom to top.

    What they look like is in the page's style sheet, under `.drawing`.
    """

    def __init__(self) -> None:
        self._parts: list[str] = []

    def path(self, kind: str, steps: str) -> None:
        """Add an outline or a line of the given class; nothing if it has no steps."""
        if steps:
            self._parts.append(f'<path class="{kind}" d="{steps}"/>')

    def line(self, kind: str, begin: tuple[int, int], end: tuple[int, int]) -> None:
        """Add a straight line."""
        self.path(kind, f"M{begin[0]} {begin[1]}L{end[0]} {end[1]}")

    def area(self, kind: str, corner: tuple[int, int], opposite: tuple[int, int]) -> None:
        """Add a filled rectangle between two corners."""
        (left, right), (top, bottom) = sorted((corner[0], opposite[0])), sorted((corner[1], opposite[1]))
        self.path(kind, f"M{left} {top}H{right}V{bottom}H{left}z")

    def text(self, kind: str, place: tuple[int, int], words: str, *, upright: bool = False) -> None:
        """Add text at a place; upright text reads from below."""
        turned = f' transform="rotate(-90 {place[0]} {place[1]})"' if upright else ""
        self._parts.append(f'<text class="{kind}" x="{place[0]}" y="{place[1]}"{turned}>{escape(words)}</text>')

    def svg(self, title: str, height: int, width: int = WIDTH) -> str:
        """Return the drawing as an element that can stand inside an HTML page.

        The style sheet keeps drawings low on paper. One that is much taller than wide, as with a legend of many
        channels, would become too narrow to be read, and may take a page.
        """
        told = escape(plain(title), quote=True)
        tall = f' style="max-height:{_TALLEST}"' if height > 1.5 * width else ""
        return (
            f'<svg class="drawing" role="img" aria-label="{told}" viewBox="0 0 {width} {height}"{tall}>'
            f"{''.join(self._parts)}</svg>"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """Limits to be drawn behind values of the same unit; None is open on that side.

    Attributes:
        unit: of the limits.
        low: the least value.
        high: the largest value.
        channel: the channel that they apply to, empty for every one of that unit.
        windows: the intervals in which they count, in seconds; empty if always.
    """

    unit: str
    low: float | None
    high: float | None
    channel: str = ""
    windows: tuple[tuple[float, float], ...] = ()

    @property
    def edges(self) -> tuple[float, ...]:
        """The limits that are set."""
        return tuple(edge for edge in (self.low, self.high) if edge is not None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """A linear axis: `low` is drawn at `first`, `high` at `last`, in units of the drawing."""

    low: float
    high: float
    first: int
    last: int

    def at(self, value: float) -> int:
        """Return the position of a value; a value outside the axis is drawn at its end."""
        share = (min(max(value, self.low), self.high) - self.low) / (self.high - self.low)
        return round(self.first + share * (self.last - self.first))

    @property
    def exponent(self) -> int:
        """The power of ten that the labels leave to the axis' title: a multiple of three, 0 for ordinary numbers."""
        size = math.floor(math.log10(max(abs(self.low), abs(self.high))))
        return 0 if -3 <= size < 6 else 3 * (size // 3)

    def ticks(self, most: int) -> list[tuple[float, str]]:
        """Return about `most` round values within the axis at most, and at least two, each with its label."""
        low, high = Decimal(repr(self.low)), Decimal(repr(self.high))
        rough = _EXACT.divide(high - low, Decimal(most))
        sizes = [Decimal(digit).scaleb(rough.adjusted()) for digit in _ROUND]
        wider = next(place for place, size in enumerate(sizes) if size >= rough)
        for step in (sizes[wider], sizes[wider - 1] if wider else sizes[0] / 2):
            first = int(_EXACT.divide(low, step).to_integral_value(ROUND_CEILING))
            last = int(_EXACT.divide(high, step).to_integral_value(ROUND_FLOOR))
            if last > first:  # one value alone shows no scale
                break
        places = max(0, self.exponent - step.adjusted())
        found = (_EXACT.multiply(step, Decimal(number)) for number in range(first, last + 1))
        return [(float(value), f"{_EXACT.scaleb(value, -self.exponent):.{places}f}") for value in found]

    def titled(self, unit: str) -> str:
        """Return the unit with the power of ten that the labels leave out."""
        left, known = prefixed(unit, self.exponent)
        if not left:
            return known
        power = f"10{str(left).translate(_SUPERSCRIPT)}"
        return f"({power} {known})" if known else power


@dataclass(frozen=True, slots=True, kw_only=True)
class LogScale(Scale):
    """A logarithmic axis between two values above zero."""

    def at(self, value: float) -> int:
        """Return the position of a value above zero; a value outside the axis is drawn at its end."""
        low, high = math.log10(self.low), math.log10(self.high)
        share = (math.log10(min(max(value, self.low), self.high)) - low) / (high - low)
        return round(self.first + share * (self.last - self.first))

    @property
    def exponent(self) -> int:
        """The labels are powers of ten themselves."""
        return 0

    def ticks(self, most: int) -> list[tuple[float, str]]:
        """Return the powers of ten within the axis, or about `most` of them at most; if there is only one, more."""
        first, last = math.ceil(math.log10(self.low) - 1e-9), math.floor(math.log10(self.high) + 1e-9)
        if last - first < 1:
            digits = [(digit, size) for size in range(first - 1, last + 1) for digit in (1, 2, 5)]
            near = [float(f"{digit}e{size}") for digit, size in digits]
            return [(value, f"{value:g}") for value in near if self.low <= value <= self.high]
        step = -(-(last - first + 1) // most)
        return [(float(f"1e{size}"), _power(size)) for size in range(first, last + 1, step)]


def _power(size: int) -> str:
    return f"{10**size:g}" if 0 <= size < 5 else f"10{str(size).translate(_SUPERSCRIPT)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """A rectangle with an axis below and one at its left; `y` runs upwards."""

    x: Scale
    y: Scale

    def across(self, sheet: Sheet, most: int, *, labelled: bool, title: str) -> None:
        """Draw the lower axis: its grid, and its ticks with labels where it is `labelled`."""
        bottom, top = self.y.first, self.y.last
        for value, label in self.x.ticks(most):
            place = self.x.at(value)
            sheet.line("grid", (place, bottom), (place, top))
            sheet.line("axis", (place, bottom), (place, bottom + _TICK))
            if labelled:
                sheet.text("mid", (place, bottom + _TICK + 115), label)
        sheet.line("axis", (self.x.first, bottom), (self.x.last, bottom))
        if labelled:
            sheet.text("mid", ((self.x.first + self.x.last) // 2, bottom + _TICK + 265), title)

    def upward(self, sheet: Sheet, ticks: Sequence[tuple[float, str]], *, grid: bool) -> None:
        """Draw the left axis with these ticks."""
        left, right = self.x.first, self.x.last
        for value, label in ticks:
            place = self.y.at(value)
            if grid:
                sheet.line("grid", (left, place), (right, place))
            sheet.line("axis", (left - _TICK, place), (left, place))
            sheet.text("end", (left - _TICK - 25, place + _WORDS), label)
        sheet.line("axis", (left, self.y.first), (left, self.y.last))

    def named(self, sheet: Sheet, words: str) -> None:
        """Write what the left axis is, upright at the drawing's edge; name and unit apart where the panel is low."""
        name, slash, unit = words.partition(" / ")
        low = slash and width_of(words) > self.y.first - self.y.last + _SPARE
        lines = [(95, name), (215, unit)] if low else [(120, words)]
        for edge, part in lines:
            sheet.text("mid", (edge, (self.y.first + self.y.last) // 2), plain(part, 30), upright=True)

    def legend(self, sheet: Sheet, entries: Sequence[tuple[str, str]]) -> None:
        """Write what each kind of line is above the panel, in rows from the left; see `legend_rows`."""
        rows = legend_rows([name for _, name in entries], self.x.last - self.x.first)
        kinds = iter(entries)
        for place, row in enumerate(rows):
            line, left = self.y.last - 90 - _ENTRY * (len(rows) - 1 - place), self.x.first
            for name in row:
                kind = next(kinds)[0]
                if kind.startswith("mark"):
                    sheet.path(kind, f"M{left + 110} {line}{DISC}")
                else:
                    sheet.line(kind, (left, line), (left + 220, line))
                sheet.text("begin", (left + 270, line + _WORDS), name)
                left += _KEY + width_of(name)


def legend_rows(names: Sequence[str], width: int) -> list[list[str]]:
    """Return names as rows of a legend that are not wider than this."""
    rows: list[list[str]] = []
    room = 0
    for name in names:
        if not rows or room + _KEY + width_of(name) > width:
            rows.append([])
            room = 0
        rows[-1].append(name)
        room += _KEY + width_of(name)
    return rows


def legend_height(names: Sequence[str], width: int) -> int:
    """Return the room that a legend takes."""
    return _ENTRY * len(legend_rows(names, width)) + 40 if names else 0


def draw_limits(sheet: Sheet, panel: Panel, bands: Sequence[Band]) -> None:
    """Draw the allowed range as an area, and its edges as dashed lines, where the limits count.

    An open side goes to the axis' end.

    Args:
        sheet: what to draw on.
        panel: where.
        bands: the limits, in the unit of the left axis; their windows in that of the lower one.
    """
    edges: dict[str, None] = {}
    for band in bands:
        low, high = (
            panel.y.at(end if edge is None else edge)
            for edge, end in ((band.low, panel.y.low), (band.high, panel.y.high))
        )
        for begin, end in band.windows or ((panel.x.low, panel.x.high),):
            left, right = panel.x.at(begin), panel.x.at(end)
            if right > left:
                sheet.area("band", (left, low), (right, high))
                edges.update({f"M{left} {panel.y.at(edge)}H{right}": None for edge in band.edges})
    sheet.path("limit", "".join(edges))


def spread(values: Iterable[float], margin: float) -> tuple[float, float]:
    """Return the ends of an axis for these finite values, with a margin as a share of what they span.

    Without values, or where all are alike, it is an axis around them that shows where they lie.
    """
    known = list(values) or [0.0]
    low, high = min(known), max(known)
    size = max(abs(low), abs(high))
    if high - low <= _NARROWEST * size:
        wide = 0.05 * size or 1.0
        return low - wide, high + wide
    return low - margin * (high - low), high + margin * (high - low)


def finite(value: object) -> float | None:
    """Return a number that can be drawn, or None."""
    if isinstance(value, str):
        try:
            value = float(value)
        except ValueError:
            return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < _LARGEST:
        return None
    return float(value)


def polyline(places: Iterable[tuple[int, int]]) -> str:
    """Return the steps of a line through these places; one place alone is a short line."""
    ahead = iter(places)
    x, y = next(ahead)
    parts = [f"M{x} {y}"]
    for next_x, next_y in ahead:
        parts.append(f"{'' if len(parts) > 1 else 'l'}{next_x - x} {next_y - y}")
        x, y = next_x, next_y
    if len(parts) == 1:
        return f"M{x - _SHORTEST // 2} {y}h{_SHORTEST}"
    return f"{parts[0]}{' '.join(parts[1:])}"


def plain(words: str, longest: int = 90) -> str:
    """Return the text without characters that no drawing can show, truncated if it is too long."""
    shown = "".join(character if character.isprintable() else "\N{REPLACEMENT CHARACTER}" for character in words)
    return shown if len(shown) <= longest else f"{shown[: longest - 1].rstrip()}…"


def width_of(words: str) -> int:
    """Return the room that a text takes, about."""
    return _CHARACTER * len(words)
