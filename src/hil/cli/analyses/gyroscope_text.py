"""What `hil analyse gyroscope-temperature` prints: tables for people, or one JSON document for machines."""

from __future__ import annotations

import json
import math

import numpy as np

from hil.analysis.gates import Gate
from hil.analysis.gyroscope.calibrate import CalibrationReport
from hil.analysis.gyroscope.calibration import Calibration, Polynomial
from hil.analysis.gyroscope.fitting import Candidate, Fit
from hil.analysis.gyroscope.interchange import as_document, fingerprint
from hil.cli.analyses.allan_text import stated
from hil.cli.analyses.log import INCONCLUSIVE, gates_as_json
from hil.documents.text import fitting
from hil.model.figure import Figure
from hil.report.tables import aligned

__all__ = ["as_json", "as_text"]

_CANDIDATES = ("degree", "leave-one-out", "AICc", "chi-square", "probability", "")
_POINTS = ("T [degC]", "value", "residual", "leverage", "deviation", "")


def as_json(file: str, readings: int, report: CalibrationReport, gates: tuple[Gate, ...]) -> str:
    """Return the result as one JSON document; what is not finite is null."""
    document = {
        "format": 1,
        "file": file,
        "readings": readings,
        "status": INCONCLUSIVE if any(gate.ok is False for gate in gates) else "conclusive",
        "reasons": [str(gate) for gate in gates if gate.ok is False],
        "gates": gates_as_json(gates),
        "remarks": list(report.remarks),
        "calibration": as_document(report.calibration),
        "bias": {axis: _fit(fitted) for axis, fitted in report.bias.items()},
        "scale": {axis: _fit(fitted) for axis, fitted in report.scale.items()},
    }
    return json.dumps(document, allow_nan=False, indent=2)


def _fit(fitted: Fit) -> dict[str, object]:
    names = ("temperature", "value", "residual", "leverage", "deviation")
    columns = [map(_number, getattr(fitted, name).tolist()) for name in names]
    return {
        "degree": len(fitted.polynomial.coefficients) - 1,
        "chosen": fitted.chosen,
        "outliers": [place + 1 for place in fitted.outliers],
        "runs": _number(fitted.runs),
        "consistent": fitted.consistent,
        "remark": fitted.remark,
        "candidates": [_candidate(each) for each in fitted.candidates],
        "points": [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)],
    }


def _number(number: float) -> float | None:
    return number if math.isfinite(number) else None


def _candidate(candidate: Candidate) -> dict[str, float | None]:
    names = ("degree", "cross_validation", "aicc", "chi_square", "tail")
    numbers = {name: getattr(candidate, name) for name in names}
    return {name: _number(number) for name, number in numbers.items()}


def as_text(file: str, readings: int, report: CalibrationReport, gates: tuple[Gate, ...]) -> str:
    """Return the result as plain text: a part for each axis, the alignment, and the range."""
    calibration = report.calibration
    lines = [f"{file}: {readings} readings of {', '.join(calibration.axes)} in {calibration.unit}"]
    doubts = [f"INCONCLUSIVE: {gate}; nothing is exported" for gate in gates if gate.ok is False]
    lines += fitting([*doubts, *(f"note: {remark}" for remark in report.remarks)], 80)
    for axis in calibration.axes:
        for what, fits in (("bias", report.bias), ("scale", report.scale)):
            if axis in fits:
                lines += ["", *_part(f"{axis}: {what}(T)", fits[axis])]
    lines += ["", *_alignment(calibration)]
    lines.append(f"valid from {calibration.low:g} to {calibration.high:g} degC, refused outside")
    lines.append("self-check: the exported numbers reproduce the table")
    lines.append(f"fingerprint {fingerprint(calibration)}")
    return "\n".join(lines)


def _part(title: str, fitted: Fit) -> list[str]:
    polynomial = fitted.polynomial
    degree = len(polynomial.coefficients) - 1
    lines = [f"{title}, degree {degree} about {polynomial.reference:g} degC, {fitted.chosen}"]
    lines += [f"  c{power}  {stated(figure)}" for power, figure in enumerate(_coefficients(polynomial))]
    candidates = [
        (
            f"{each.degree}",
            *map(_cell, (each.cross_validation, each.aicc, each.chi_square, each.tail)),
            "chosen" if each.degree == degree else "",
        )
        for each in fitted.candidates
    ]
    lines += aligned(candidates, head=_CANDIDATES, right=range(5), indent="  ")
    columns = (fitted.temperature, fitted.value, fitted.residual, fitted.leverage, fitted.deviation)
    points = [
        (f"{where:.2f}", f"{value:.6g}", f"{residual:.3g}", f"{leverage:.2f}", _cell(deviation), mark)
        for (where, value, residual, leverage, deviation), mark in zip(
            np.column_stack(columns).tolist(), _marks(fitted), strict=True
        )
    ]
    return lines + aligned(points, head=_POINTS, right=range(5), indent="  ")


def _marks(fitted: Fit) -> list[str]:
    return ["outlier" if place in fitted.outliers else "" for place in range(fitted.value.size)]


def _cell(number: float) -> str:
    return f"{number:.4g}" if math.isfinite(number) else "-"


def _coefficients(polynomial: Polynomial) -> list[Figure]:
    figures = []
    for power, value in enumerate(polynomial.coefficients):
        suffix = ("", "/K")[power] if power < 2 else f"/K^{power}"
        unit = f"{polynomial.unit}{suffix}"
        uncertainty = None if polynomial.covariance is None else math.sqrt(polynomial.covariance[power][power])
        figures.append(Figure(value=value, unit=unit, uncertainty=uncertainty, dof=polynomial.dof))
    return figures


def _alignment(calibration: Calibration) -> list[str]:
    if calibration.alignment_uncertainty is None and not _is_measured(calibration):
        return ["alignment: not measured"]
    lines = ["alignment, sensor to table axes"]
    spread = calibration.alignment_uncertainty
    rows = [[f"{value:.6f}" for value in row] for row in calibration.alignment]
    if spread is not None:
        pairs = [zip(*pair, strict=True) for pair in zip(rows, spread, strict=True)]
        rows = [[f"{cell} ± {each:.1g}" for cell, each in pair] for pair in pairs]
    return lines + aligned(rows, right=range(len(rows)), indent="  ")


def _is_measured(calibration: Calibration) -> bool:
    return any(
        value != float(row == column)
        for row, values in enumerate(calibration.alignment)
        for column, value in enumerate(values)
    )
