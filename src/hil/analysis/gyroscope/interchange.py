"""A calibration for others: canonical JSON and its fingerprint, and C for a flight computer."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from hil.analysis.gyroscope.calibration import CalibratedRate, Calibration, Matrix, Polynomial
from hil.analysis.tracing import traced
from hil.documents.canonical import JsonError, digest, parse_strict
from hil.model.errors import Refused

__all__ = ["FORMAT", "as_c_header", "as_document", "as_json", "fingerprint", "from_document", "from_json", "printed"]

FORMAT = "hil/gyroscope-calibration/1"
"""What the document's `schema` says."""

_DIGITS = 9  # of a coefficient: more than any float32 holds


def printed(calibration: Calibration) -> Calibration:
    """Return the calibration with its numbers as every export prints them: 9 significant digits."""
    axes = {
        name: CalibratedRate(bias=_rounded(axis.bias), scale=_rounded(axis.scale))
        for name, axis in calibration.axes.items()
    }
    return replace(calibration, axes=axes, alignment=tuple(tuple(map(_short, row)) for row in calibration.alignment))


def _rounded(polynomial: Polynomial) -> Polynomial:
    return replace(polynomial, coefficients=tuple(map(_short, polynomial.coefficients)))


def _short(number: float) -> float:
    return float(f"{number:.{_DIGITS}g}")


def as_document(calibration: Calibration) -> dict[str, object]:
    """Return the calibration as plain data, with the fingerprint of everything else in it."""
    exported = printed(calibration)
    document: dict[str, object] = {
        "schema": FORMAT,
        "model": "rate = alignment * (scale(T) * (measured - bias(T)))",
        "polynomial": "c0 + c1 (T - reference) + c2 (T - reference)^2 + ...",
        "unit": exported.unit,
        "temperature": {"unit": "degC", "low": exported.low, "high": exported.high},
        "axes": {
            name: {"bias": _polynomial(axis.bias), "scale": _polynomial(axis.scale)}
            for name, axis in exported.axes.items()
        },
        "alignment": [list(row) for row in exported.alignment],
        "alignment_uncertainty": _rows(exported.alignment_uncertainty),
        "alignment_dof": _finite(exported.alignment_dof),
    }
    return {**document, "fingerprint": digest(document)}


def _polynomial(polynomial: Polynomial) -> dict[str, object]:
    return {
        "coefficients": list(polynomial.coefficients),
        "unit": polynomial.unit,
        "reference": polynomial.reference,
        "low": polynomial.low,
        "high": polynomial.high,
        "covariance": _rows(polynomial.covariance),
        "dof": _finite(polynomial.dof),
    }


def _finite(dof: float) -> float | None:
    return dof if math.isfinite(dof) else None


def _rows(matrix: Matrix | None) -> list[list[float]] | None:
    return None if matrix is None else [list(row) for row in matrix]


@traced
def as_json(calibration: Calibration) -> str:
    """Return the document as JSON text, the same for the same calibration."""
    return json.dumps(as_document(calibration), indent=2, allow_nan=False) + "\n"


def fingerprint(calibration: Calibration) -> str:
    """Return the SHA-256 that every export of this calibration carries."""
    return str(as_document(calibration)["fingerprint"])


@traced
def from_json(text: str) -> Calibration:
    """Return the calibration that a JSON text holds.

    Raises:
        Refused: text that is not such a document, or was changed after it was exported.
    """
    try:
        document = parse_strict(text.encode("utf-8"))
    except JsonError as error:
        raise Refused(f"this is no calibration: {error.message}", "give the JSON that an export wrote") from None
    if not isinstance(document, Mapping):
        raise Refused("this is no calibration: not an object", "give the JSON that an export wrote")
    return from_document(document)


def from_document(document: Mapping[str, object]) -> Calibration:
    """Return the calibration that a document holds.

    Raises:
        Refused: a document of another format, or one that does not match its fingerprint.
    """
    if document.get("schema") != FORMAT:
        raise Refused(f"this is no calibration in the format {FORMAT}", "give the JSON that an export wrote")
    rest = {key: value for key, value in document.items() if key != "fingerprint"}
    if digest(rest) != document.get("fingerprint"):
        raise Refused(
            "the calibration does not match its fingerprint: it was changed after it was exported",
            "export it again, or take the original",
        )
    try:
        return _calibration(document)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise Refused(f"this calibration is incomplete: {error}", "give the JSON that an export wrote") from None


def _calibration(document: Mapping[str, object]) -> Calibration:
    axes, spread = document["axes"], document["alignment_uncertainty"]
    if not isinstance(axes, Mapping):
        raise TypeError("axes")
    return Calibration(
        unit=str(document["unit"]),
        axes={
            name: CalibratedRate(bias=_read(axis["bias"]), scale=_read(axis["scale"])) for name, axis in axes.items()
        },
        alignment=_matrix(document["alignment"]),
        alignment_uncertainty=None if spread is None else _matrix(spread),
        alignment_dof=_dof(document["alignment_dof"]),
    )


def _read(entry: Mapping[str, object]) -> Polynomial:
    covariance = entry["covariance"]
    (coefficients,) = _matrix([entry["coefficients"]])
    return Polynomial(
        coefficients=coefficients,
        unit=str(entry["unit"]),
        reference=_number(entry["reference"]),
        low=_number(entry["low"]),
        high=_number(entry["high"]),
        covariance=None if covariance is None else _matrix(covariance),
        dof=_dof(entry["dof"]),
    )


def _dof(value: object) -> float:
    return math.inf if value is None else _number(value)


def _matrix(rows: object) -> Matrix:
    if not isinstance(rows, list):
        raise TypeError("a list of numbers is missing")
    return tuple(tuple(_number(each) for each in row) for row in rows)


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"'{value}' is not a number")
    return float(value)


_FORM = """\
/* Gyroscope calibration, generated; do not edit.
 *
 * rate[i] = sum over j of gyroscope_alignment[i][j] * scale_j(T) * (measured[j] - bias_j(T))
 * bias_j(T)  = sum over k of gyroscope_bias[j][k]  * pow(T - GYROSCOPE_REFERENCE_DEGC, k)
 * scale_j(T) = sum over k of gyroscope_scale[j][k] * pow(T - GYROSCOPE_REFERENCE_DEGC, k)
 *
 * measured, rate and bias in {unit}, scale and alignment without a unit, T in degC; axes {axes}.
 * Valid only between GYROSCOPE_LOW_DEGC and GYROSCOPE_HIGH_DEGC: nothing was measured outside.
 */
#ifndef GYROSCOPE_CALIBRATION_H
#define GYROSCOPE_CALIBRATION_H

#define GYROSCOPE_UNIT "{unit}"
#define GYROSCOPE_FINGERPRINT "{fingerprint}"
#define GYROSCOPE_REFERENCE_DEGC {reference}
#define GYROSCOPE_LOW_DEGC {low}
#define GYROSCOPE_HIGH_DEGC {high}
#define GYROSCOPE_AXES {count}
#define GYROSCOPE_BIAS_TERMS {bias_terms}
#define GYROSCOPE_SCALE_TERMS {scale_terms}

static const double gyroscope_bias[GYROSCOPE_AXES][GYROSCOPE_BIAS_TERMS] = {{
{bias}
}};
static const double gyroscope_scale[GYROSCOPE_AXES][GYROSCOPE_SCALE_TERMS] = {{
{scale}
}};
static const double gyroscope_alignment[GYROSCOPE_AXES][GYROSCOPE_AXES] = {{
{alignment}
}};

#endif
"""


@traced
def as_c_header(calibration: Calibration) -> str:
    """Return a C99 header with the numbers that the JSON export prints, and its fingerprint.

    Raises:
        Refused: the polynomials have different reference temperatures, or a name does not fit into C.
    """
    for name in (calibration.unit, *calibration.axes):
        if not name.isprintable() or "*/" in name or '"' in name or "\\" in name:
            raise Refused(f"'{name}' cannot stand in a C header", "rename the axis or the unit")
    exported = printed(calibration)
    parts = [part for axis in exported.axes.values() for part in (axis.bias, axis.scale)]
    references = {part.reference for part in parts}
    if len(references) != 1:
        raise Refused("the polynomials have different reference temperatures", "fit them about one temperature")
    bias = [axis.bias.coefficients for axis in exported.axes.values()]
    scale = [axis.scale.coefficients for axis in exported.axes.values()]
    return _FORM.format(
        unit=exported.unit,
        axes=", ".join(exported.axes),
        fingerprint=fingerprint(calibration),
        reference=_literal(references.pop()),
        low=_literal(exported.low),
        high=_literal(exported.high),
        count=len(exported.axes),
        bias_terms=max(map(len, bias)),
        scale_terms=max(map(len, scale)),
        bias=_labelled_rows(tuple(exported.axes), bias),
        scale=_labelled_rows(tuple(exported.axes), scale),
        alignment=_labelled_rows(tuple(exported.axes), exported.alignment),
    )


def _labelled_rows(names: Sequence[str], rows: Sequence[Sequence[float]]) -> str:
    longest = max(map(len, rows))
    filled = [[*row, *(0.0,) * (longest - len(row))] for row in rows]
    return "\n".join(
        f"    {{{', '.join(map(_literal, row))}}}, /* {name} */" for name, row in zip(names, filled, strict=True)
    )


def _literal(number: float) -> str:
    return repr(float(number))
