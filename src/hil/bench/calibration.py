"""What an instrument's certificate says about a reading."""

from __future__ import annotations

import math
from dataclasses import replace

from hil.model.bench import Calibration
from hil.model.figure import Figure

__all__ = ["calibrated", "standard_uncertainty"]


def standard_uncertainty(calibration: Calibration | None, unit: str, value: float) -> float | None:
    """Return the standard uncertainty of a reading in its own unit, or None if no range covers it.

    The certificate's expanded uncertainty `absolute + relative * |value|` is divided by its coverage
    factor (GUM 4.3.3).
    """
    if calibration is None or not math.isfinite(value):
        return None
    for entry in calibration.ranges:
        if entry.unit == unit and entry.low <= value <= entry.high:
            return (entry.absolute + entry.relative * abs(value)) / entry.k
    return None


def calibrated(figure: Figure, calibration: Calibration | None) -> Figure:
    """Return the reading with its certificate's uncertainty; a figure that has one already keeps it."""
    if figure.uncertainty is not None:
        return figure
    return replace(figure, uncertainty=standard_uncertainty(calibration, figure.unit, figure.value))
