"""A sheet of paper for one drawing: SVG elements in whole units, with the page's colours by class."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

__all__ = ["WIDTH", "Sheet", "plain", "polyline", "width_of"]

WIDTH = 7_200
"""Of every drawing, in units: ten to a pixel, so that whole numbers are fine enough."""

_CHARACTER = 62  # the width of one, on average and generously
_SHORTEST = 20  # a line that would be a point is drawn this long


class Sheet:
    """The elements of one drawing, in the order in which they lie upon each other.

    What they look like is in the page's style sheet, under `.drawing`.
    """

    def __init__(self) -> None:
        self._parts: list[str] = []

    def path(self, kind: str, steps: str) -> None:
        """Add an outline or a line of the given class; nothing where it has no steps."""
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

    def svg(self, title: str, height: int) -> str:
        """Return the drawing as an element that can stand inside an HTML page."""
        told = escape(plain(title), quote=True)
        return (
            f'<svg class="drawing" role="img" aria-label="{told}" viewBox="0 0 {WIDTH} {height}">'
            f"{''.join(self._parts)}</svg>"
        )


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
    """Return the text without what no drawing can show, shortened in the middle."""
    shown = "".join(character if character.isprintable() else "\N{REPLACEMENT CHARACTER}" for character in words)
    return shown if len(shown) <= longest else f"{shown[: longest // 2]}…{shown[-longest // 2 + 1 :]}"


def width_of(words: str) -> int:
    """Return the room that a text takes, about."""
    return _CHARACTER * len(words)
