"""The Allan plot: deviations with their intervals and the fitted model, the same bytes for the same numbers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from hil.cli.analyses.allan_text import NAMES, Axis, called
from hil.cli.analyses.drawing import COLOURS, MARKS, save
from hil.model.errors import Refused

__all__ = ["draw"]

_MODELLED = ("overlapping", "total")  # the fitted Allan deviation is also what the total one expects


def draw(path: Path, axes: Sequence[Axis]) -> None:
    """Draw the Allan deviations of some axes of one unit.

    Args:
        path: what to write; its ending, .svg or .png, says the format.
        axes: what to draw, all with one estimator.

    Raises:
        Refused: another ending, nothing to draw, or a file that cannot be written.
    """
    drawn = [axis for axis in axes if axis.curve.deviation.any()]
    if not drawn:
        raise Refused(f"{path}: there is no deviation above zero to draw", "look at the columns' remarks")
    save(path, lambda: _figure(drawn))


def _figure(drawn: Sequence[Axis]) -> Figure:
    figure = Figure(figsize=(7.0, 5.0), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    for place, axis in enumerate(drawn):
        curve, colour = axis.curve, COLOURS[place % len(COLOURS)]
        seen = curve.deviation > 0.0
        tau, deviation = curve.tau[seen], curve.deviation[seen]
        # With very few degrees of freedom and little confidence an interval may lie beside its estimate.
        reach = [(deviation - curve.low[seen]).clip(0.0), (curve.high[seen] - deviation).clip(0.0)]
        mark = MARKS[place % len(MARKS)]
        axes.errorbar(
            tau, deviation, yerr=reach, fmt=mark, color=colour, markersize=4, capsize=2, label=called(axis.name)
        )
        if axis.model.fitted.size and curve.estimator in _MODELLED:
            axes.plot(axis.model.curve.tau, axis.model.fitted, color=colour, linewidth=1)
    curve = drawn[0].curve
    lines = ", lines: fitted noise" if curve.estimator in _MODELLED else ""
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("averaging time [s]")
    axes.set_ylabel(f"{NAMES[curve.estimator]} deviation [{curve.unit}]")
    axes.set_title(f"bars: {curve.confidence:.4g} confidence{lines}", fontsize="small", loc="right")
    axes.grid(visible=True, which="both", color="#dddddd", linewidth=0.5)
    axes.legend()
    return figure
