"""The plot of `hil analyse magnetometer`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hil.analysis.magnetometer.calibrate import MagnetometerReport
from hil.cli.analyses.plots import COLOURS, save
from hil.model.errors import Refused

__all__ = ["draw"]


def draw(
    path: Path,
    report: MagnetometerReport,
    readings: NDArray[np.float64],
    temperature: NDArray[np.float64] | None = None,
) -> None:
    """Draw the residuals of all readings, and where on the sphere the calibrated ones lie, in a map of equal areas.

    Args:
        path: what to write; its suffix, .svg or .png, sets the format.
        report: what to draw.
        readings: shape (n, 3).
        temperature: as it was given to the fit.

    Raises:
        Refused: another suffix, nothing to draw, or a file that cannot be written.
    """
    if not np.isfinite(report.residual).any():
        raise Refused(f"{path}: there is no ellipsoid to draw", "measure attitudes all over the sphere")
    turn, height = report.calibration.directions(readings, temperature)
    save(path, lambda: _drawn(report, turn, height))


def _drawn(report: MagnetometerReport, turn: NDArray[np.float64], height: NDArray[np.float64]) -> Figure:
    figure = Figure(figsize=(7.0, 6.0), dpi=120, layout="constrained")
    above, below = figure.subplots(2, 1)
    left_out = np.zeros(len(turn), dtype=bool)
    left_out[list(report.outliers)] = True
    number = np.arange(1, len(turn) + 1)
    for which, mark, colour, label in (
        (~left_out, ".", COLOURS[0], "used"), (left_out, "x", COLOURS[1], "outlier"),
    ):  # fmt: skip
        if which.any():
            above.plot(number[which], report.residual[which], mark, color=colour, markersize=4, label=label)
            below.plot(turn[which], height[which], mark, color=colour, markersize=4, label=label)
    above.set_xlabel("reading")
    above.set_ylabel(f"residual [{report.calibration.unit}]")
    below.set(xlim=(-185.0, 185.0), xticks=range(-180, 181, 60), ylim=(-1.05, 1.05), ylabel="z of the direction")
    below.set_xlabel("direction about z [deg]")
    for axes in (above, below):
        axes.grid(visible=True, color="#dddddd", linewidth=0.5)
    above.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, borderaxespad=0.0)
    return figure
