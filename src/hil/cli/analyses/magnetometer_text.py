"""What `hil analyse magnetometer` prints: lines for people, or one JSON document for machines."""

from __future__ import annotations

import json
import math
from dataclasses import asdict

import numpy as np

from hil.analysis.gates import Gate
from hil.analysis.magnetometer.calibrate import MagnetometerReport
from hil.analysis.magnetometer.calibration import AXES
from hil.analysis.magnetometer.interchange import as_document
from hil.cli.analyses.allan_text import stated
from hil.cli.analyses.log import INCONCLUSIVE, gates_as_json
from hil.documents.text import fitting
from hil.model.figure import Figure, FigureStatus, encoded
from hil.report.tables import aligned

__all__ = ["as_json", "as_text", "likeness"]

_LARGER = 1.5  # times: uncertainties that are larger by less are no remark
_NAMED = 10  # outliers in the text; all of them are in the JSON


def as_json(file: str, report: MagnetometerReport, gates: tuple[Gate, ...], remarks: tuple[str, ...]) -> str:
    """Return the result as one JSON document; what is not finite is null."""
    calibration = report.calibration
    doubted = any(gate.ok is False for gate in gates)
    document = {
        "format": 1,
        "file": file,
        "readings": len(report.residual),
        "status": INCONCLUSIVE if doubted else "conclusive",
        "reasons": [str(gate) for gate in gates if gate.ok is False],
        "gates": gates_as_json(gates),
        "remarks": list(remarks),
        "method": calibration.method,
        "shape": calibration.shape,
        "iterations": report.iterations,
        "bias": {axis: encoded(figure) for axis, figure in calibration.biases.items()},
        "matrix": {name: encoded(figure) for name, figure in calibration.elements.items()},
        "field": encoded(calibration.expected_field),
        "noise": encoded(report.noise),
        "temperature": None if calibration.warmth is None else asdict(calibration.warmth),
        "drift": {axis: encoded(figure) for axis, figure in calibration.drifts.items()},
        "heading": encoded(report.heading),
        "uncalibrated_heading": encoded(report.uncalibrated),
        "residual_rms": encoded(_rms(report)),
        "coverage": encoded(report.coverage),
        "condition": encoded(report.condition),
        "inflation": report.inflation,
        "outliers": [place + 1 for place in report.outliers],
        "identifiability": report.identifiability,
        "calibration": None if doubted else as_document(calibration),
    }
    return json.dumps(document, allow_nan=False, indent=2)


def likeness(report: MagnetometerReport) -> tuple[str, ...]:
    """Return a remark where residuals of neighbouring readings are alike."""
    if report.inflation <= _LARGER:
        return ()
    told = (
        f"residuals of neighbouring readings are alike: uncertainties are {report.inflation:.3g} times those of noise"
    )
    return (f"{told}; something changed meanwhile, such as the field, a motor or iron nearby, or the sensor filters",)


def _rms(report: MagnetometerReport) -> float:
    kept = np.delete(report.residual, report.outliers)
    return math.sqrt(float(np.square(kept).mean()))


def as_text(file: str, report: MagnetometerReport, gates: tuple[Gate, ...], remarks: tuple[str, ...]) -> str:
    """Return the result as plain text."""
    calibration = report.calibration
    doubts = [f"INCONCLUSIVE: {gate}; nothing is exported" for gate in gates if gate.ok is False]
    lines = [f"{file}: {len(report.residual)} readings in {calibration.unit}"]
    lines += fitting([*doubts, *(f"note: {remark}" for remark in remarks)], 80)
    lines += ["", f"field = matrix · (measured - bias), by {calibration.method}, shape {calibration.shape}"]
    elements = calibration.elements
    rows: list[tuple[str, ...]] = [("", "bias", "matrix", "", "")]
    for axis in AXES:
        names = ("".join(sorted(axis + other)) for other in AXES)
        rows.append((axis, _told(calibration.biases[axis]), *(_told(elements[name]) for name in names)))
    lines += aligned(rows, indent="  ")
    scale = "known, on average" if calibration.absolute else "expected, for a matrix of determinant 1"
    lines += [
        f"  field      {_told(calibration.expected_field)}, {scale}",
        f"  noise      {_told(report.noise)} along each axis; {_scatter(report)}",
        f"  heading    {_heading(report)}",
        *_warm(report),
        f"  coverage   {_told(report.coverage, percent=True)} of the sphere, in 48 cells",
        f"  condition  {_told(report.condition)} of the Fisher matrix; 2.5 or less is best",
        f"  outliers   {_outliers(report)}",
        "",
    ]
    lines += fitting([f"not observable: {report.identifiability}"], 80)
    if not doubts:
        lines.append("self-check: the exported numbers reproduce every reading")
        lines.append(f"fingerprint {as_document(calibration)['fingerprint']}")
    return "\n".join(lines)


def _scatter(report: MagnetometerReport) -> str:
    rms = _rms(report)
    return f"residuals {rms:.3g} {report.calibration.unit}, rms" if math.isfinite(rms) else "no residuals"


def _heading(report: MagnetometerReport) -> str:
    if report.heading.status is FigureStatus.NOT_OBSERVABLE:
        return "not observable"
    return (
        f"± {report.heading.value:.2g} deg in the worst direction; without the calibration it is off by up to"
        f" {report.uncalibrated.value:.3g} deg"
    )


def _warm(report: MagnetometerReport) -> list[str]:
    warmth = report.calibration.warmth
    if warmth is None:
        return []
    span = f"{warmth.low:.4g} to {warmth.high:.4g} degC"
    if warmth.drift is None:
        return [f"  drift      not fitted: the readings are from {span}"]
    slopes = ", ".join(f"{axis} {_told(figure)}" for axis, figure in report.calibration.drifts.items())
    return [
        f"  drift      of the bias {slopes}",
        f"             the bias is that at {warmth.reference:.4g} degC, of {span}",
    ]


def _told(figure: Figure, *, percent: bool = False) -> str:
    if figure.status is FigureStatus.NOT_OBSERVABLE:
        return "not observable"
    return f"{figure.value:.0%}" if percent else stated(figure)


def _outliers(report: MagnetometerReport) -> str:
    if not report.outliers:
        return "none"
    named = ", ".join(str(place + 1) for place in report.outliers[:_NAMED])
    more = ", ..." if len(report.outliers) > _NAMED else ""
    return f"{len(report.outliers)} left out: readings {named}{more}"
