"""The plot of a gyroscope over temperature: bias and scale, and their residuals from the polynomials."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hil.analysis.gyroscope.calibrate import CalibrationReport
from hil.analysis.gyroscope.fitting import Fit
from hil.cli.analyses.plots import COLOURS, MARKS, save

__all__ = ["draw"]


def draw(path: Path, report: CalibrationReport) -> None:
    """Draw bias and, where it was measured, scale of all axes over temperature, with their residuals below.

    Args:
        path: what to write; its suffix, .svg or .png, sets the format.
        report: what to draw.

    Raises:
        Refused: another suffix, or a file that cannot be written.
    """
    parts = [("bias", report.calibration.unit, report.bias)]
    if report.scale:
        parts.append(("scale", "1", report.scale))
    save(path, lambda: _drawn(parts))


def _drawn(parts: list[tuple[str, str, Mapping[str, Fit]]]) -> Figure:
    figure = Figure(figsize=(7.0, 5.0 * len(parts)), dpi=120, layout="constrained")
    panels = figure.subplots(2 * len(parts), 1, height_ratios=[3, 2] * len(parts))
    for place, (what, unit, fits) in enumerate(parts):
        above, below = panels[2 * place : 2 * place + 2]
        above.sharex(below)
        above.tick_params(labelbottom=False)
        for number, (name, fitted) in enumerate(fits.items()):
            _line(above, below, name, fitted, number)
        above.set_ylabel(f"{what} [{unit}]")
        above.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False, fontsize="small")
        below.set_ylabel(f"residual [{unit}]")
        below.set_xlabel("temperature [degC]")
        for axes in (above, below):
            axes.grid(visible=True, color="#dddddd", linewidth=0.5)
    panels[0].set_title("lines: polynomials; shaded: their standard uncertainty", fontsize="small", loc="right")
    return figure


def _line(above: Axes, below: Axes, name: str, fitted: Fit, number: int) -> None:
    polynomial, colour, mark = fitted.polynomial, COLOURS[number % len(COLOURS)], MARKS[number % len(MARKS)]
    above.plot(fitted.temperature, fitted.value, mark, color=colour, markersize=4, label=name)
    below.plot(fitted.temperature, fitted.residual, mark, color=colour, markersize=4)
    grid = np.linspace(polynomial.low, polynomial.high, 101)
    middle = polynomial.at(grid)
    above.plot(grid, middle, color=colour, linewidth=1)
    below.axhline(0.0, color="black", linewidth=0.8)
    if polynomial.covariance is not None:
        spread = np.array([polynomial.figure(where).uncertainty for where in grid.tolist()])
        above.fill_between(grid, middle - spread, middle + spread, color=colour, alpha=0.2, linewidth=0)
        below.fill_between(grid, -spread, spread, color=colour, alpha=0.12, linewidth=0)
