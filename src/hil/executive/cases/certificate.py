"""Uncertainty of readings from an instrument's certificate, in whatever unit the reading is."""

from __future__ import annotations

import math
from dataclasses import replace

from hil.model.bench import CalibratedRange, Calibration, InstrumentSpec
from hil.model.figure import Figure
from hil.requirements.units import UnitError, compatible, convert, same, scale

__all__ = ["calibrated", "standard_uncertainty", "uncovered"]

_NEEDS_NONE = frozenset({"", "1", "count", "s"})
"""Units without certificates: counts, states and plain numbers measure nothing, and time is the bench clock's."""
_OF_READINGS = ": a difference of temperatures has the uncertainties of its readings, without `instrument`"


def standard_uncertainty(calibration: Calibration | None, unit: str, value: float) -> float | None:
    """Return the standard uncertainty of a reading in its own unit, or None if no range covers it.

    The reading is converted to the unit of each range. The certificate's expanded uncertainty
    `absolute + relative * |value|` is divided by its coverage factor (GUM 4.3.3).
    """
    if calibration is None or not math.isfinite(value):
        return None
    for entry in calibration.ranges:
        if not _covers(entry, unit):
            continue
        own = value if entry.unit == unit else convert(value, unit, entry.unit)
        if entry.low <= own <= entry.high:
            found = (entry.absolute + entry.relative * abs(own)) / entry.k
            return found if entry.unit == unit else found * scale(entry.unit, unit)
    return None


def _covers(entry: CalibratedRange, unit: str) -> bool:
    """Return whether a line of a certificate is for the quantity of this unit."""
    if entry.unit == unit:
        return True
    try:
        return compatible(entry.unit, unit)
    except UnitError:
        return False


def calibrated(figure: Figure, calibration: Calibration | None) -> Figure:
    """Return the reading with its certificate's uncertainty; a figure that already has one keeps it."""
    if figure.uncertainty is not None:
        return figure
    return replace(figure, uncertainty=standard_uncertainty(calibration, figure.unit, figure.value))


def uncovered(instrument: InstrumentSpec, unit: str, *values: float) -> tuple[str, ...]:
    """Return which readings no certificate covers, a sentence each; the device under test needs none.

    Args:
        instrument: the instrument that was read.
        unit: of the readings.
        values: the readings; only finite ones count.
    """
    name, calibration = instrument.name, instrument.calibration
    if instrument.dut or unit in _NEEDS_NONE:
        return ()
    if calibration is None:
        return (f"{name} has no calibration record",)
    if not any(_covers(entry, unit) for entry in calibration.ranges):
        told = _OF_READINGS if any(same(entry.unit, unit, True) for entry in calibration.ranges) else ""
        return (f"the certificate of {name} covers nothing in {unit}{told}",)
    outside = [each for each in values if math.isfinite(each) and standard_uncertainty(calibration, unit, each) is None]
    return (f"no range in the certificate of {name} covers {max(outside, key=abs):.6g} {unit}",) if outside else ()
