"""What panels of every kind share: grid, ticks, titles, and limits behind the values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hil.report.drawing.scales import Band, Scale
from hil.report.drawing.sheet import Sheet, plain

__all__ = ["TITLE", "Panel", "draw_limits"]

TITLE = 140
"""The line on which a drawing's title stands, in units from its top."""

_TICK = 35
_WORDS = 40  # how far below its middle line a text stands


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
        """Write what the left axis is, upright at the drawing's edge."""
        sheet.text("mid", (120, (self.y.first + self.y.last) // 2), plain(words, 24), upright=True)


def draw_limits(sheet: Sheet, panel: Panel, bands: Sequence[Band], *, upright: bool) -> None:
    """Draw what is allowed as an area, and its edges as dashed lines; an open side goes to the axis' end.

    Args:
        sheet: what to draw on.
        panel: where.
        bands: the limits, in the unit of the axis that they belong to.
        upright: whether they belong to the lower axis.
    """
    scale, other = (panel.x, panel.y) if upright else (panel.y, panel.x)
    for band in bands:
        low, high = (
            scale.at(end if edge is None else edge) for edge, end in ((band.low, scale.low), (band.high, scale.high))
        )
        corner, opposite = (low, other.first), (high, other.last)
        sheet.area("band", *((corner, opposite) if upright else (corner[::-1], opposite[::-1])))
    for edge in dict.fromkeys(edge for band in bands for edge in band.edges):
        begin, end = (scale.at(edge), other.first), (scale.at(edge), other.last)
        sheet.line("limit", *((begin, end) if upright else (begin[::-1], end[::-1])))
