"""Self-check of a calibration: whether the exported equations reproduce the table that they were fitted to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.analysis.gyroscope.calibrate import CalibrationReport
from hil.analysis.gyroscope.calibration import Calibration, Polynomial
from hil.analysis.gyroscope.fitting import Fit
from hil.analysis.tracing import traced

__all__ = ["Rejection", "disagreements", "export_disagreements", "reproduction"]

_PRINTED = 1e-6  # of the largest value: the effect of rounding to nine digits, with margin


@dataclass(frozen=True, slots=True, kw_only=True)
class Rejection:
    """An equation that does not reproduce its table.

    Attributes:
        axis: the axis, or other name of the equation.
        temperature: temperature of the largest error [degC].
        tabled: the table's value there.
        recomputed: the equation's value there.
        remark: the evident correction, otherwise empty.
    """

    axis: str
    temperature: float
    tabled: float
    recomputed: float
    remark: str

    def __str__(self) -> str:
        told = (
            f"{self.axis}: the equation gives {self.recomputed:.5g} at {self.temperature:g} degC, "
            f"where its table has {self.tabled:.5g}"
        )
        return f"{told}; {self.remark}" if self.remark else told


def disagreements(
    equations: Mapping[str, Polynomial], table: Mapping[str, Sequence[tuple[float, float]]], tolerance: float
) -> tuple[Rejection, ...]:
    """Return the equations that miss their own table by more than a tolerance, in order of axis.

    Args:
        equations: equations by axis; their range is ignored.
        table: pairs of temperature in degC and value, by axis.
        tolerance: largest accepted absolute difference, in the values' unit.
    """
    found = (_judged(axis, equations[axis], table[axis], tolerance) for axis in equations)
    return tuple(rejection for rejection in found if rejection is not None)


@traced
def reproduction(exported: Calibration, report: CalibrationReport) -> str:
    """Return `reproduced` if an export agrees with its report, otherwise every disagreement in a sentence.

    Args:
        exported: the calibration as exported and read back.
        report: the report that it was exported from.
    """
    return "; ".join(map(str, export_disagreements(exported, report))) or "reproduced"


@traced
def export_disagreements(exported: Calibration, report: CalibrationReport) -> tuple[Rejection, ...]:
    """Return where a calibration, as exported and read back, misses the tables that it was fitted to.

    The tolerance is the largest residual of the fit itself, plus a millionth of the largest value for rounding.

    Args:
        exported: the calibration as exported and read back.
        report: the report that it was exported from.
    """
    rejections: list[Rejection] = []
    for what, fits in (("bias", report.bias), ("scale", report.scale)):
        for axis, fitted in fits.items():
            polynomial = getattr(exported.axes[axis], what)
            table = list(zip(fitted.temperature.tolist(), fitted.value.tolist(), strict=True))
            rejections += disagreements(
                {f"{what} of axis {axis}": polynomial}, {f"{what} of axis {axis}": table}, _tolerance(fitted)
            )
    return tuple(rejections)


def _tolerance(fitted: Fit) -> float:
    return float(np.abs(fitted.residual).max() * (1.0 + _PRINTED) + _PRINTED * np.abs(fitted.value).max())


def _judged(
    axis: str, equation: Polynomial, points: Sequence[tuple[float, float]], tolerance: float
) -> Rejection | None:
    where, tabled = np.array(points).T
    everywhere = replace(equation, low=-np.inf, high=np.inf)
    recomputed = everywhere.at(where)
    miss = np.abs(recomputed - tabled)
    if miss.max() <= tolerance:
        return None
    worst = int(np.argmax(miss))
    first, second, *higher = (*equation.coefficients, 0.0)
    turned = replace(everywhere, coefficients=(first, -second, *higher))
    mended = bool(np.abs(turned.at(where) - tabled).max() <= tolerance)
    return Rejection(
        axis=axis,
        temperature=float(where[worst]),
        tabled=float(tabled[worst]),
        recomputed=float(recomputed[worst]),
        remark="with the sign of its slope turned it would agree" if mended else "",
    )
