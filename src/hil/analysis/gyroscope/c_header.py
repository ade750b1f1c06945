"""A calibration as a C header for flight software."""

from __future__ import annotations

from collections.abc import Sequence

from hil.analysis.gyroscope.calibration import Calibration
from hil.analysis.gyroscope.interchange import fingerprint, printed
from hil.model.errors import Refused

__all__ = ["as_c_header"]

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
        bias=_rows(tuple(exported.axes), bias),
        scale=_rows(tuple(exported.axes), scale),
        alignment=_rows(tuple(exported.axes), exported.alignment),
    )


def _rows(names: Sequence[str], rows: Sequence[Sequence[float]]) -> str:
    longest = max(map(len, rows))
    filled = [[*row, *(0.0,) * (longest - len(row))] for row in rows]
    return "\n".join(
        f"    {{{', '.join(map(_literal, row))}}}, /* {name} */" for name, row in zip(names, filled, strict=True)
    )


def _literal(number: float) -> str:
    return repr(float(number))
