"""Magnetometer calibration on a rotation table in coils: known fields and attitudes, orientation, residual errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hil.analysis.magnetics import odd_response
from hil.analysis.magnetometer.calibration import Calibration
from hil.analysis.magnetometer.geometry import Array, lengths, root, upper
from hil.analysis.statistics import not_observable
from hil.analysis.tracing import traced
from hil.model.errors import Refused
from hil.model.figure import Figure

__all__ = [
    "CoilSurvey",
    "Orientation",
    "Remaining",
    "coil_survey",
    "fields_in_board",
    "orientation",
    "positive_factor",
    "remaining_errors",
    "set_apart",
    "table_angles",
]

_TURN = {"z": (0, 1, 2), "x": (1, 2, 0), "y": (2, 0, 1)}
"""By the axis that points up: the board axes along 0 deg, 90 deg and up, at table angle 0."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Orientation:
    """Orientation of a calibrated sensor's axes relative to the board's.

    Attributes:
        matrix: (3, 3), orthogonal: calibrated = matrix · true.
        handedness: 1; -1 where an odd number of axes is swapped or has the wrong sign.
        angle: rotation angle in deg, 180 for a half turn; for a reflection, that of the nearest rotation.
        left: residual rms angle in deg between calibrated and true directions after the rotation is removed.
    """

    matrix: Array
    handedness: Figure
    angle: Figure
    left: Figure


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Remaining:
    """Errors of readings that were not used in the fit.

    Attributes:
        magnitude: largest error of the calibrated magnitude, with its sign, in the unit of the field.
        raw_magnitude: the same for uncalibrated readings.
        heading: largest angle of a calibrated reading to the true direction [deg].
        raw_heading: the same for uncalibrated readings.
        errors: (n,), calibrated errors of the magnitudes.
        raw_errors: (n,), uncalibrated errors.
    """

    magnitude: Figure
    raw_magnitude: Figure
    heading: Figure
    raw_heading: Figure
    errors: Array
    raw_errors: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CoilSurvey:
    """Field survey by a reference magnetometer at rest: along the table's 0 deg, its 90 deg, and up, in uT.

    Attributes:
        ambient: (3,), ambient field without the coils.
        per_ampere: (3,), field of the coils per ampere, in uT/A.
        constant: coil constant: its upward component [uT/A].
    """

    ambient: Array
    per_ampere: Array
    constant: Figure

    @traced
    def field(self, current: Figure) -> Array:
        """Return the total field (3,) in uT at a measured current in A."""
        return np.asarray(self.ambient + self.per_ampere * current.value)

    @traced
    def moved(self, later: CoilSurvey) -> float:
        """Return the largest change of an ambient field component until a later survey [uT]."""
        return float(np.abs(later.ambient - self.ambient).max())


@traced
def coil_survey(
    plus: Sequence[ArrayLike],
    zero: Sequence[ArrayLike],
    minus: Sequence[ArrayLike],
    *,
    times: ArrayLike,
    currents: Sequence[Figure],
) -> CoilSurvey:
    """Return ambient field and coil constant from recordings with both current directions and without current.

    The ambient field is the mean of all three: the coil's contributions cancel, and the noise is lower than in the
    recording without current alone.

    Args:
        plus: recordings with positive current, (samples, 3) in uT for each repetition.
        zero: the same without current.
        minus: the same with negative current.
        times: see `hil.analysis.magnetics.odd_response`.
        currents: measured magnitudes for every recording with current [A].
    """
    response = odd_response(list(plus), list(zero), list(minus), times=times)
    amperes = np.array([each.value for each in currents])
    certain = max((each.uncertainty or 0.0 for each in currents), default=0.0)
    size = Figure(value=float(amperes.mean()), unit="A", uncertainty=certain)
    return CoilSurvey(
        ambient=np.mean(
            [np.concatenate([*map(np.asarray, phase)]).mean(axis=0) for phase in (plus, zero, minus)], axis=0
        ),
        per_ampere=np.asarray(response.odd / size.value),
        constant=response.component("z") / size,
    )


@traced
def table_angles(time: ArrayLike, mark: tuple[Figure, Figure], rate: Figure) -> Array:
    """Return the table angle in deg at times, shape (n,), from the angle at one time and the rate.

    Args:
        time: times in s, shape (n,).
        mark: an angle in deg, and its time in s.
        rate: rate of the table [deg/s].
    """
    angle, at = mark
    return np.asarray(angle.value + rate.value * (np.asarray(time, dtype=np.float64) - at.value))


@traced
def fields_in_board(field: ArrayLike, angle: ArrayLike, up: str) -> Array:
    """Transform a field to the frame of a board on a rotation table, (n, 3).

    Args:
        field: components along the table's 0 deg, its 90 deg, and up; shape (3,) or (n, 3).
        angle: table angle in deg, positive counter-clockwise seen from above, shape (n,).
        up: the board axis that points up; the next two, cyclically, are along 0 deg and 90 deg at angle 0.

    Raises:
        Refused: the axis is not x, y or z.
    """
    if up not in _TURN:
        raise Refused(f"'{up}' is no axis of a board", "mount x, y or z up")
    turn = np.radians(np.atleast_1d(np.asarray(angle, dtype=np.float64)))
    ahead, aside, above = np.broadcast_to(np.asarray(field, dtype=np.float64), (turn.size, 3)).T
    found = np.empty((turn.size, 3))
    first, second, third = _TURN[up]
    found[:, first] = ahead * np.cos(turn) + aside * np.sin(turn)
    found[:, second] = aside * np.cos(turn) - ahead * np.sin(turn)
    found[:, third] = above
    return found


@traced
def orientation(calibrated: ArrayLike, true: ArrayLike, *, attitude: float = 0.0) -> Orientation:
    """Return the orientation of calibrated fields (n, 3) relative to true ones (n, 3), by orthogonal Procrustes.

    Least squares over all orthogonal matrices, reflections included: P. H. Schönemann, A Generalized Solution of the
    Orthogonal Procrustes Problem, Psychometrika 31 (1966) 1.

    Args:
        calibrated: fields in the sensor's axes.
        true: fields in the board's axes.
        attitude: standard uncertainty of the attitudes, common to all readings [deg].

    Raises:
        Refused: the shapes differ.
    """
    found, field = _pair(calibrated, true)
    left, values, right = np.linalg.svd(_directions(found).T @ _directions(field))
    if not (np.isfinite(values).all() and values[1] > 1e-6 * values[0]):
        raise Refused("the directions show no orientation", "measure attitudes all over the sphere")
    matrix = np.asarray(left @ right)
    sign = float(np.sign(np.linalg.det(matrix)))
    turned = matrix if sign > 0.0 else left @ np.diag([1.0, 1.0, -1.0]) @ right
    angle = math.degrees(math.acos(min(1.0, max(-1.0, (float(np.trace(turned)) - 1.0) / 2.0))))
    apart = _angles(found @ matrix, field)
    rms = math.sqrt(float(np.square(apart).mean()))
    certain = math.hypot(rms / math.sqrt(len(field)), attitude)
    return Orientation(
        matrix=matrix,
        handedness=Figure(value=sign, unit="1", uncertainty=0.0),
        angle=Figure(value=angle, unit="deg", uncertainty=certain),
        left=Figure(value=rms, unit="deg", uncertainty=rms / math.sqrt(2.0 * len(field))),
    )


@traced
def remaining_errors(
    calibration: Calibration, readings: ArrayLike, true: ArrayLike, *, field: float, attitude: float
) -> Remaining:
    """Return the errors of readings (n, 3) in known fields (n, 3), calibrated and uncalibrated.

    Args:
        calibration: the calibration as exported and read back.
        readings: readings in its unit, preferably means of several samples.
        true: true fields in the board's frame, in the same unit.
        field: standard uncertainty of the magnitudes of `true`, in that unit.
        attitude: standard uncertainty of its directions [deg].
    """
    raw, known = _pair(readings, true)
    found = calibration.correct(raw)
    errors, before = lengths(found) - lengths(known), lengths(raw) - lengths(known)
    if not calibration.observable:
        nothing, nowhere = not_observable(calibration.unit), not_observable("deg")
        return Remaining(
            magnitude=nothing,
            raw_magnitude=nothing,
            heading=nowhere,
            raw_heading=nowhere,
            errors=errors,
            raw_errors=before,
        )
    return Remaining(
        magnitude=_largest(errors, calibration.unit, field),
        raw_magnitude=_largest(before, calibration.unit, field),
        heading=_largest(_angles(found, known), "deg", attitude),
        raw_heading=_largest(_angles(raw, known), "deg", attitude),
        errors=errors,
        raw_errors=before,
    )


@traced
def positive_factor(matrix: ArrayLike, bias: ArrayLike) -> tuple[Array, Array]:
    """Return the part of field = M · reading - b, M (3, 3), b (3,), visible in magnitudes: P of M = U P, and U'b.

    U is a rotation or a reflection, which does not affect magnitudes; P is symmetric and positive definite.

    Args:
        matrix: M, shape (3, 3).
        bias: b, shape (3,), in the unit of the field.

    Raises:
        Refused: the matrix is singular.
    """
    given = np.asarray(matrix, dtype=np.float64)
    factor = root(given.T @ given)
    if not np.isfinite(factor).all():
        raise Refused("this distortion leaves no field along some direction", "give a matrix that can be inverted")
    turn = given @ np.linalg.inv(factor)
    return factor, np.asarray(turn.T @ np.asarray(bias, dtype=np.float64))


@traced
def set_apart(
    calibration: Calibration, matrix: ArrayLike, bias: ArrayLike, *, relative: float
) -> tuple[Figure, Figure]:
    """Return the errors of a calibration against the simulated truth: of the bias, and of the matrix.

    Bias error: largest over all directions, relative to the field, |G (b - b0)| / F. Matrix error: the largest element
    of G - G0 along the axes of G0, each over the root of its two eigenvalues; G0 has determinant 1 where no magnitude
    was known.

    Args:
        calibration: the calibration.
        matrix: true matrix, (3, 3), symmetric.
        bias: true bias, in the unit of readings, (3,).
        relative: relative standard uncertainty of the field.
    """
    truth, gain = np.asarray(matrix, dtype=np.float64), np.array(calibration.matrix)
    if not (calibration.observable and calibration.covariance is not None):
        return not_observable("1"), not_observable("1")
    if not calibration.absolute:
        truth = truth / np.cbrt(np.linalg.det(truth))
    off = lengths(((np.array(calibration.bias) - np.asarray(bias)) @ gain)[np.newaxis])[0] / calibration.field
    covariance = np.array(calibration.covariance)
    spread = np.linalg.eigvalsh(gain @ covariance[:3, :3] @ gain)[-1]
    certain = math.hypot(math.sqrt(max(0.0, float(spread))) / calibration.field, relative)
    left, own = _relative(truth, gain, covariance[3:9, 3:9])
    return (
        Figure(value=float(off), unit="1", uncertainty=certain, dof=calibration.dof),
        Figure(
            value=left,
            unit="1",
            uncertainty=math.hypot(own, relative),
            dof=calibration.dof,
        ),
    )


def _relative(truth: Array, gain: Array, covariance: Array) -> tuple[float, float]:
    """Return the largest relative element of gain - truth along the axes of truth, and the largest uncertainty."""
    values, vectors = np.linalg.eigh(truth)
    largest = spread = 0.0
    for place, one in enumerate(vectors.T):
        for beside, other in enumerate(vectors.T[place:], start=place):
            scale = 1.0 / math.sqrt(float(values[place] * values[beside]))
            row = scale * upper(np.outer(one, other) + np.outer(other, one)) * [0.5, 0.5, 0.5, 1.0, 1.0, 1.0]
            largest = max(largest, abs(float(row @ upper(gain - truth))))
            spread = max(spread, float(row @ covariance @ row))
    return largest, math.sqrt(max(0.0, spread))


def _pair(one: ArrayLike, other: ArrayLike) -> tuple[Array, Array]:
    first, second = np.asarray(one, dtype=np.float64), np.asarray(other, dtype=np.float64)
    if first.ndim != 2 or first.shape[1:] != (3,) or first.shape != second.shape:
        raise Refused(f"fields have shapes {first.shape} and {second.shape}, not (n, 3)", "give one row of x, y and z")
    return first, second


def _directions(fields: Array) -> Array:
    return np.asarray(fields / lengths(fields)[:, np.newaxis])


def _angles(one: Array, other: Array) -> Array:
    """Return the angles in deg between fields (n, 3), exact where they are small."""
    first, second = _directions(one), _directions(other)
    across = lengths(np.cross(first, second))
    return np.asarray(np.degrees(np.arctan2(across, np.einsum("ij,ij->i", first, second))))


def _largest(values: Array, unit: str, certain: float) -> Figure:
    return Figure(value=float(values[np.argmax(np.abs(values))]), unit=unit, uncertainty=certain)
