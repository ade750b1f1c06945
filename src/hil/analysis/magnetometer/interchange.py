"""Export of a magnetometer calibration: JSON with a fingerprint, C header for a flight computer, and self-check."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from hil.analysis import interchange
from hil.analysis.magnetometer.calibrate import MagnetometerReport
from hil.analysis.magnetometer.calibration import AXES, IDENTIFIABLE, Calibration, Warmth
from hil.analysis.magnetometer.geometry import lengths
from hil.analysis.tracing import traced
from hil.model.errors import Refused

__all__ = [
    "FORMAT",
    "as_document",
    "magnetometer_as_c_header",
    "magnetometer_as_json",
    "magnetometer_from_json",
    "magnetometer_reproduction",
    "sample_disagreement",
]

FORMAT = "hil/magnetometer-calibration/1"
"""The document's `schema`."""

_CERTAIN = 6  # digits of a covariance: further ones depend on the linear algebra library
_PRINTED = 1e-6  # of the field: the effect of rounding to nine digits, with margin


def as_document(calibration: Calibration) -> dict[str, object]:
    """Return the calibration as plain data with its fingerprint: 9 significant digits, 6 of the covariance.

    Raises:
        Refused: a calibration that its readings do not show.
    """
    if not calibration.observable:
        raise Refused("the readings do not show this calibration, so it is not exported", "measure more attitudes")
    exported = _printed(calibration)
    return interchange.sealed(
        {
            "schema": FORMAT,
            "model": "field = matrix * (measured - bias)",
            "unit": exported.unit,
            "axes": list(AXES),
            "bias": list(exported.bias),
            "matrix": interchange.rows(exported.matrix),
            "field": exported.field,
            "absolute": exported.absolute,
            "covariance": interchange.rows(exported.covariance),
            "covariance_of": ["bias x, y, z", "matrix xx, yy, zz, xy, xz, yz", "field"],
            "dof": interchange.finite(exported.dof),
            "method": exported.method,
            "shape": exported.shape,
            "identifiability": IDENTIFIABLE,
            **({} if exported.warmth is None else {"temperature": _told(exported.warmth)}),
        }
    )


def _told(warmth: Warmth) -> Mapping[str, object]:
    """Return the temperature model as plain data; bias(T) = bias + drift (T - reference), T in degC."""
    told: dict[str, object] = {"reference": warmth.reference, "low": warmth.low, "high": warmth.high}
    if warmth.drift is not None and warmth.spread is not None:
        told |= {"drift": list(warmth.drift), "uncertainty": list(warmth.spread)}
    return told


def _printed(calibration: Calibration) -> Calibration:
    return replace(
        calibration,
        bias=tuple(map(interchange.short, calibration.bias)),
        matrix=tuple(tuple(map(interchange.short, row)) for row in calibration.matrix),
        field=interchange.short(calibration.field),
        covariance=calibration.covariance
        and tuple(tuple(float(f"{each:.{_CERTAIN}g}") for each in row) for row in calibration.covariance),
        warmth=None if calibration.warmth is None else _short(calibration.warmth),
    )


def _short(warmth: Warmth) -> Warmth:
    return Warmth(
        reference=interchange.short(warmth.reference),
        low=interchange.short(warmth.low),
        high=interchange.short(warmth.high),
        drift=warmth.drift and tuple(map(interchange.short, warmth.drift)),
        spread=warmth.spread and tuple(map(interchange.short, warmth.spread)),
    )


@traced
def magnetometer_as_json(calibration: Calibration) -> str:
    """Return the calibration as canonical JSON text.

    Args:
        calibration: the calibration.

    Raises:
        Refused: a calibration that its readings do not show.
    """
    return interchange.as_text(as_document(calibration))


@traced
def magnetometer_from_json(text: str) -> Calibration:
    """Parse a calibration from JSON text.

    Args:
        text: JSON text of an export.

    Raises:
        Refused: the text is not such a document, or was changed after export.
    """
    return interchange.opened(interchange.parsed(text), FORMAT, _calibration)


def _calibration(document: Mapping[str, object]) -> Calibration:
    covariance = document["covariance"]
    (bias,) = interchange.matrix([document["bias"]])
    return Calibration(
        unit=str(document["unit"]),
        bias=bias,
        matrix=interchange.matrix(document["matrix"]),
        field=interchange.number(document["field"]),
        absolute=bool(document["absolute"]),
        covariance=None if covariance is None else interchange.matrix(covariance),
        dof=interchange.dof(document["dof"]),
        method=str(document["method"]),
        shape=str(document["shape"]),
        observable=True,
        warmth=_warmth(document["temperature"]) if "temperature" in document else None,
    )


def _warmth(told: object) -> Warmth:
    if not isinstance(told, Mapping):
        raise TypeError("the temperature is not an object")
    reference, low, high = (interchange.number(told[name]) for name in ("reference", "low", "high"))
    if "drift" not in told:
        return Warmth(reference=reference, low=low, high=high)
    drift, spread = interchange.matrix([told["drift"], told["uncertainty"]])
    return Warmth(reference=reference, low=low, high=high, drift=drift, spread=spread)


_FORM = """\
/* Magnetometer calibration, generated; do not edit.
 *
 * field[i] = sum over j of magnetometer_matrix[i][j] * (measured[j] - magnetometer_bias[j])
 *
 * measured, bias and field in {unit}, matrix without a unit; axes {axes} of the sensor.
 * {scale}{warm}
 * A rotation of the sensor against the body is not part of it: magnitudes do not show one.
 */
#ifndef MAGNETOMETER_CALIBRATION_H
#define MAGNETOMETER_CALIBRATION_H

#define MAGNETOMETER_UNIT "{unit}"
#define MAGNETOMETER_FINGERPRINT "{fingerprint}"
#define MAGNETOMETER_FIELD {field}

static const double magnetometer_bias[3] = {{{bias}}};
static const double magnetometer_matrix[3][3] = {{
{matrix}
}};{drift}

#endif
"""


@traced
def magnetometer_as_c_header(calibration: Calibration) -> str:
    """Return a C99 header with the numbers of the JSON export and its fingerprint.

    Args:
        calibration: the calibration.

    Raises:
        Refused: the calibration is not observable, or its unit is not valid in C.
    """
    interchange.printable((calibration.unit,))
    fingerprint = as_document(calibration)["fingerprint"]
    exported = _printed(calibration)
    scale = "The magnitude of the field was known: MAGNETOMETER_FIELD is its mean."
    if not exported.absolute:
        scale = "The scale is not known: the matrix has determinant 1, and MAGNETOMETER_FIELD is what it gives."
    warm = drift = ""
    if exported.warmth is not None:
        span = f"{interchange.literal(exported.warmth.low)} to {interchange.literal(exported.warmth.high)} degC"
        warm = f"\n * The readings were taken at {span}."
        if exported.warmth.drift is not None:
            warm += "\n * To the bias at T degC add magnetometer_drift[j] * (T - MAGNETOMETER_REFERENCE_TEMPERATURE)."
            slopes = ", ".join(map(interchange.literal, exported.warmth.drift))
            reference = interchange.literal(exported.warmth.reference)
            drift = f"\n\n#define MAGNETOMETER_REFERENCE_TEMPERATURE {reference}"
            drift += f"\nstatic const double magnetometer_drift[3] = {{{slopes}}};"
    return _FORM.format(
        unit=exported.unit,
        axes=", ".join(AXES),
        scale=scale,
        warm=warm,
        drift=drift,
        fingerprint=fingerprint,
        field=interchange.literal(exported.field),
        bias=", ".join(map(interchange.literal, exported.bias)),
        matrix=interchange.labelled_rows(AXES, exported.matrix),
    )


@traced
def magnetometer_reproduction(
    exported: Calibration,
    report: MagnetometerReport,
    readings: ArrayLike,
    field: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
) -> str:
    """Return `reproduced` if an export reproduces its readings' residuals, otherwise `sample_disagreement`."""
    return sample_disagreement(exported, report, readings, field, temperature) or "reproduced"


@traced
def sample_disagreement(
    exported: Calibration,
    report: MagnetometerReport,
    readings: ArrayLike,
    field: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
) -> str:
    """Return how a calibration, as exported and read back, disagrees with the residuals of its readings; empty if not.

    It must reproduce the report's residual of every reading within a millionth of the field.

    Args:
        exported: the calibration from `magnetometer_from_json`.
        report: the report on the same readings.
        readings: readings, shape (n, 3).
        field: field as passed to the fit.
        temperature: temperature as passed to the fit.
    """
    known = exported.field if field is None else np.asarray(field, dtype=np.float64)
    apart = np.abs(lengths(exported.correct(readings, temperature)) - known - report.residual)
    worst = int(np.argmax(apart))
    if apart[worst] <= _PRINTED * exported.field:
        return ""
    told = f"the exported calibration gives reading {worst + 1} a residual of {report.residual[worst]:.5g}"
    return f"{told} in the report, but differs from it by {apart[worst]:.3g} {exported.unit}"
