"""The Allan plot: deviations with their intervals and the fitted model, the same bytes for the same numbers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from hil.analysis.allan.results import NoiseModel
from hil.model.errors import Refused

__all__ = ["draw"]

_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")  # told apart by all eyes (Okabe, Ito)
_MARKS = ("o", "s", "^", "D", "v", "P")


def draw(path: Path, models: Mapping[str, NoiseModel]) -> None:
    """Draw the Allan deviations of some axes of one unit.

    Args:
        path: what to write; its ending, .svg or .png, says the format.
        models: what to draw, by the name of the axis.

    Raises:
        Refused: another ending, nothing to draw, or a file that cannot be written.
    """
    form = path.suffix.lower().lstrip(".")
    if form not in {"svg", "png"}:
        raise Refused(f"{path}: a plot is .svg or .png", "choose one of these endings")
    drawn = {name: model for name, model in models.items() if model.curve.deviation.any()}
    if not drawn:
        raise Refused(f"{path}: there is no deviation above zero to draw", "look at the columns' remarks")
    with mpl.rc_context({"svg.hashsalt": "hil", "svg.fonttype": "path", "path.simplify": False}):
        figure = _figure(drawn)
        canvas = FigureCanvasSVG(figure) if form == "svg" else FigureCanvasAgg(figure)
        try:
            if isinstance(canvas, FigureCanvasSVG):
                canvas.print_svg(path, metadata={"Date": None})
            else:
                canvas.print_png(path, metadata={"Software": None})
        except OSError as error:
            raise Refused(f"{path}: {error.strerror}", "choose a place that can be written") from None


def _figure(models: Mapping[str, NoiseModel]) -> Figure:
    figure = Figure(figsize=(7.0, 5.0), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    for place, (name, model) in enumerate(models.items()):
        curve, colour = model.curve, _COLOURS[place % len(_COLOURS)]
        seen = curve.deviation > 0.0
        tau, deviation = curve.tau[seen], curve.deviation[seen]
        reach = [deviation - curve.low[seen], curve.high[seen] - deviation]
        mark = _MARKS[place % len(_MARKS)]
        axes.errorbar(tau, deviation, yerr=reach, fmt=mark, color=colour, markersize=4, capsize=2, label=name)
        if model.fitted.size:
            axes.plot(curve.tau, model.fitted, color=colour, linewidth=1)
    curve = next(iter(models.values())).curve
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("averaging time [s]")
    axes.set_ylabel(f"overlapping Allan deviation [{curve.unit}]")
    axes.set_title(f"bars: {curve.confidence:.4g} confidence, lines: fitted noise", fontsize="small", loc="right")
    axes.grid(visible=True, which="both", color="#dddddd", linewidth=0.5)
    axes.legend()
    return figure
