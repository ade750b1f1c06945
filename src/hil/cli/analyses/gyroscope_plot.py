"""The plot of a calibration: bias and scale over temperature, the same bytes for the same numbers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hil.analysis.gyroscope.calibrate import CalibrationReport
from hil.analysis.gyroscope.fitting import Fit
from hil.cli.analyses.drawing import COLOURS, MARKS, save

__all__ = ["draw"]


def draw(path: Path, report: CalibrationReport) -> None:
    """Draw bias and, where it was measured, scale of all axes over temperature.

    Args:
        path: what to write; its ending, .svg or .png, says the format.
        report: what to draw.

    Raises:
        Refused: another ending, or a file that cannot be written.
    """
    parts = [("bias", report.calibration.unit, report.bias)]
    if report.scale:
        parts.append(("scale", "1", report.scale))
    save(path, lambda: _figure(parts))


def _figure(parts: list[tuple[str, str, Mapping[str, Fit]]]) -> Figure:
    figure = Figure(figsize=(7.0, 3.5 * len(parts)), dpi=120, layout="constrained")
    for place, (what, unit, fits) in enumerate(parts):
        axes = figure.add_subplot(len(parts), 1, place + 1)
        for number, (name, fitted) in enumerate(fits.items()):
            _line(axes, name, fitted, number)
        axes.set_xlabel("temperature [degC]")
        axes.set_ylabel(f"{what} [{unit}]")
        axes.grid(visible=True, color="#dddddd", linewidth=0.5)
        axes.legend()
    return figure


def _line(axes: Axes, name: str, fitted: Fit, number: int) -> None:
    polynomial, colour = fitted.polynomial, COLOURS[number % len(COLOURS)]
    axes.plot(fitted.temperature, fitted.value, MARKS[number % len(MARKS)], color=colour, markersize=4, label=name)
    grid = np.linspace(polynomial.low, polynomial.high, 101)
    axes.plot(grid, polynomial.at(grid), color=colour, linewidth=1)
    if polynomial.covariance is not None:
        spread = np.array([polynomial.figure(where).uncertainty for where in grid.tolist()])
        middle = polynomial.at(grid)
        axes.fill_between(grid, middle - spread, middle + spread, color=colour, alpha=0.2, linewidth=0)
