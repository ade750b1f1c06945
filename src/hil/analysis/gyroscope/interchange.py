"""Export of a gyroscope calibration: canonical JSON with a fingerprint, and a C header for a flight computer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from hil.analysis import interchange
from hil.analysis.gyroscope.calibration import CalibratedRate, Calibration, Polynomial
from hil.analysis.tracing import traced
from hil.model.errors import Refused

__all__ = ["FORMAT", "as_c_header", "as_document", "as_json", "fingerprint", "from_document", "from_json", "printed"]

FORMAT = "hil/gyroscope-calibration/1"
"""The document's `schema`."""


def printed(calibration: Calibration) -> Calibration:
    """Return the calibration with its numbers rounded as in every export, to 9 significant digits."""
    axes = {
        name: CalibratedRate(bias=_rounded(axis.bias), scale=_rounded(axis.scale))
        for name, axis in calibration.axes.items()
    }
    return replace(
        calibration, axes=axes, alignment=tuple(tuple(map(interchange.short, row)) for row in calibration.alignment)
    )


def _rounded(polynomial: Polynomial) -> Polynomial:
    return replace(polynomial, coefficients=tuple(map(interchange.short, polynomial.coefficients)))


def as_document(calibration: Calibration) -> dict[str, object]:
    """Return the calibration as plain data, with a fingerprint over everything else in it."""
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
        "alignment_uncertainty": interchange.rows(exported.alignment_uncertainty),
        "alignment_dof": interchange.finite(exported.alignment_dof),
    }
    return interchange.sealed(document)


def _polynomial(polynomial: Polynomial) -> dict[str, object]:
    return {
        "coefficients": list(polynomial.coefficients),
        "unit": polynomial.unit,
        "reference": polynomial.reference,
        "low": polynomial.low,
        "high": polynomial.high,
        "covariance": interchange.rows(polynomial.covariance),
        "dof": interchange.finite(polynomial.dof),
    }


@traced
def as_json(calibration: Calibration) -> str:
    """Return the calibration as canonical JSON text.

    Args:
        calibration: the calibration.
    """
    return interchange.as_text(as_document(calibration))


def fingerprint(calibration: Calibration) -> str:
    """Return the SHA-256 fingerprint in every export of this calibration."""
    return str(as_document(calibration)["fingerprint"])


@traced
def from_json(text: str) -> Calibration:
    """Parse a calibration from JSON text.

    Args:
        text: JSON text of an export.

    Raises:
        Refused: the text is not such a document, or was changed after export.
    """
    return from_document(interchange.parsed(text))


def from_document(document: Mapping[str, object]) -> Calibration:
    """Parse a calibration from a document.

    Raises:
        Refused: the document has another format, or does not match its fingerprint.
    """
    return interchange.opened(document, FORMAT, _calibration)


def _calibration(document: Mapping[str, object]) -> Calibration:
    axes, spread = document["axes"], document["alignment_uncertainty"]
    if not isinstance(axes, Mapping):
        raise TypeError("axes")
    return Calibration(
        unit=str(document["unit"]),
        axes={
            name: CalibratedRate(bias=_read(axis["bias"]), scale=_read(axis["scale"])) for name, axis in axes.items()
        },
        alignment=interchange.matrix(document["alignment"]),
        alignment_uncertainty=None if spread is None else interchange.matrix(spread),
        alignment_dof=interchange.dof(document["alignment_dof"]),
    )


def _read(entry: Mapping[str, object]) -> Polynomial:
    covariance = entry["covariance"]
    (coefficients,) = interchange.matrix([entry["coefficients"]])
    return Polynomial(
        coefficients=coefficients,
        unit=str(entry["unit"]),
        reference=interchange.number(entry["reference"]),
        low=interchange.number(entry["low"]),
        high=interchange.number(entry["high"]),
        covariance=None if covariance is None else interchange.matrix(covariance),
        dof=interchange.dof(entry["dof"]),
    )


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
    """Return a C99 header with the numbers of the JSON export and its fingerprint.

    Args:
        calibration: the calibration.

    Raises:
        Refused: the polynomials have different reference temperatures, or a name is not valid in C.
    """
    interchange.printable((calibration.unit, *calibration.axes))
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
        reference=interchange.literal(references.pop()),
        low=interchange.literal(exported.low),
        high=interchange.literal(exported.high),
        count=len(exported.axes),
        bias_terms=max(map(len, bias)),
        scale_terms=max(map(len, scale)),
        bias=interchange.labelled_rows(tuple(exported.axes), bias),
        scale=interchange.labelled_rows(tuple(exported.axes), scale),
        alignment=interchange.labelled_rows(tuple(exported.axes), exported.alignment),
    )
