"""How the analyses draw: colours, marks, and files with the same bytes for the same numbers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from hil.model.errors import Refused

__all__ = ["COLOURS", "MARKS", "save"]

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Colours that all eyes tell apart (Okabe and Ito)."""

MARKS = ("o", "s", "^", "D", "v", "P")
"""Marks in the same order."""


def save(path: Path, make: Callable[[], Figure]) -> None:
    """Write a figure without dates and random names.

    Args:
        path: what to write; its ending, .svg or .png, says the format.
        make: makes the figure, under the settings that it is written with.

    Raises:
        Refused: another ending, or a file that cannot be written.
    """
    form = path.suffix.lower().lstrip(".")
    if form not in {"svg", "png"}:
        raise Refused(f"{path}: a plot is .svg or .png", "choose one of these endings")
    with mpl.rc_context({"svg.hashsalt": "hil", "svg.fonttype": "path", "path.simplify": False}):
        figure = make()
        canvas = FigureCanvasSVG(figure) if form == "svg" else FigureCanvasAgg(figure)
        try:
            if isinstance(canvas, FigureCanvasSVG):
                canvas.print_svg(path, metadata={"Date": None})
            else:
                canvas.print_png(path, metadata={"Software": None})
        except OSError as error:
            raise Refused(f"{path}: {error.strerror}", "choose a place that can be written") from None
