"""Export of a photodiode calibration: JSON with a fingerprint, C header for a flight computer, and self-check."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from hil.analysis import interchange
from hil.analysis.photodiode.calibrate import PhotodiodeReport
from hil.analysis.photodiode.diode import ELECTRONVOLTS, Diode
from hil.analysis.tracing import traced
from hil.model.errors import Refused

__all__ = [
    "FORMAT",
    "as_document",
    "photodiode_as_c_header",
    "photodiode_as_json",
    "photodiode_from_json",
    "photodiode_reproduction",
]

FORMAT = "hil/photodiode-calibration/1"
"""The document's `schema`."""

_NUMBERS = {
    "photocurrent": "A",
    "coefficient": "1/K",
    "saturation": "A",
    "ideality": "1",
    "nominal": "degC",
    "gap": "eV",
    "shunt": "S",
    "series": "ohm",
}
_CERTAIN = 6  # digits of a covariance: further ones depend on the linear algebra library
_PRINTED = 1e-6  # of the photocurrent: the effect of rounding to nine digits, with margin


def as_document(report: PhotodiodeReport) -> dict[str, object]:
    """Return the calibration as plain data with its fingerprint: 9 significant digits, 6 of covariance and dof.

    Raises:
        Refused: a report that a gate speaks against.
    """
    if not report.conclusive:
        raise Refused("the readings do not show this calibration, so it is not exported", report.doubts[0])
    exported = _printed(report.diode)
    return interchange.sealed(
        {
            "schema": FORMAT,
            "model": "light = (V/R + I_s(T) (exp(V (1 + series/R) / (ideality k T)) - 1) + shunt V (1 + series/R))"
            " / (1 + coefficient (T - nominal))",
            "saturation": "I_s(T) = saturation (T/T0)^(3/ideality) exp(gap / (ideality k) (1/T0 - 1/T)), T in kelvin",
            "numbers": {name: getattr(exported, name) for name in _NUMBERS},
            "units": _NUMBERS,
            "boltzmann": ELECTRONVOLTS,
            "temperatures": [interchange.short(report.coldest), interchange.short(report.hottest)],
            "covariance": [[_certain(each) for each in row] for row in report.covariance.tolist()],
            "covariance_of": ["ln photocurrent", "coefficient", "ln saturation", "ideality", "gap", "shunt"][
                : len(report.covariance)
            ],
            "dof": _certain(report.dof),
            "identifiability": report.identifiability,
        }
    )


def _certain(number: float) -> float:
    return float(f"{number:.{_CERTAIN}g}")


def _printed(diode: Diode) -> Diode:
    return replace(diode, **{name: interchange.short(getattr(diode, name)) for name in _NUMBERS})


@traced
def photodiode_as_json(report: PhotodiodeReport) -> str:
    """Return the calibration as canonical JSON text.

    Args:
        report: the report of the fit.

    Raises:
        Refused: a report that a gate speaks against.
    """
    return interchange.as_text(as_document(report))


@traced
def photodiode_from_json(text: str) -> Diode:
    """Parse a calibration from JSON text.

    Args:
        text: JSON text of an export.

    Raises:
        Refused: the text is not such a document, or was changed after export.
    """
    return interchange.opened(interchange.parsed(text), FORMAT, _diode)


def _diode(document: Mapping[str, object]) -> Diode:
    numbers = document["numbers"]
    if not isinstance(numbers, Mapping):
        raise TypeError("its numbers are missing")
    return Diode(**{name: interchange.number(numbers[name]) for name in _NUMBERS})


_FORM = """\
/* Photodiode calibration, generated; do not edit.
 *
 * T = degrees Celsius + 273.15, T0 = PHOTODIODE_NOMINAL + 273.15, J = V * (1 + PHOTODIODE_SERIES / R)
 * I_s = PHOTODIODE_SATURATION * pow(T / T0, 3 / PHOTODIODE_IDEALITY)
 *       * exp(PHOTODIODE_GAP / (PHOTODIODE_IDEALITY * PHOTODIODE_BOLTZMANN) * (1 / T0 - 1 / T))
 * light = (V / R + I_s * (exp(J / (PHOTODIODE_IDEALITY * PHOTODIODE_BOLTZMANN * T)) - 1) + PHOTODIODE_SHUNT * J)
 *         / (1 + PHOTODIODE_COEFFICIENT * (T - T0))
 *
 * V at the load in V, R of the load in ohm, light as the photocurrent in A at T0.
 * Calibrated from {coldest} to {hottest} degC.
 */
#ifndef PHOTODIODE_CALIBRATION_H
#define PHOTODIODE_CALIBRATION_H

#define PHOTODIODE_FINGERPRINT "{fingerprint}"
#define PHOTODIODE_BOLTZMANN {boltzmann} /* eV/K */
{numbers}

#endif
"""


@traced
def photodiode_as_c_header(report: PhotodiodeReport) -> str:
    """Return a C99 header with the numbers of the JSON export and its fingerprint.

    Args:
        report: the report of the fit.

    Raises:
        Refused: a report that a gate speaks against.
    """
    document, exported = as_document(report), _printed(report.diode)
    lines = (
        f"#define PHOTODIODE_{name.upper()} {interchange.literal(getattr(exported, name))} /* {unit} */"
        for name, unit in _NUMBERS.items()
    )
    return _FORM.format(
        coldest=f"{report.coldest:.1f}",
        hottest=f"{report.hottest:.1f}",
        fingerprint=document["fingerprint"],
        boltzmann=interchange.literal(ELECTRONVOLTS),
        numbers="\n".join(lines),
    )


@traced
def photodiode_reproduction(
    exported: Diode, report: PhotodiodeReport, voltage: ArrayLike, temperature: ArrayLike, load: ArrayLike
) -> str:
    """Return `reproduced` if a calibration, as exported and read back, agrees with its report on every reading.

    It must give the same light for every reading, within a millionth of the photocurrent; otherwise the worst reading
    is reported in a sentence.

    Args:
        exported: the calibration from `photodiode_from_json`.
        report: the report on the same readings.
        voltage: voltage across the load in V, shape (n,).
        temperature: temperature in degC, shape (n,).
        load: load resistance in ohm, shape (n,) or a number.
    """
    found, wanted = (each.light_of(voltage, temperature, load) for each in (exported, report.diode))
    apart = np.abs(found - wanted)
    worst = int(np.argmax(apart))
    if apart[worst] <= _PRINTED * report.diode.photocurrent:
        return "reproduced"
    told = f"the exported calibration gives reading {worst + 1} a light of {found[worst]:.6g} A"
    return f"{told}, and the report's gives {wanted[worst]:.6g} A"
