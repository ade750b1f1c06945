"""Calibration of a magnetometer from readings in many attitudes, with gates on its validity."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.gates import Gate
from hil.analysis.interchange import Matrix
from hil.analysis.magnetometer import gating, warmth
from hil.analysis.magnetometer.calibration import IDENTIFIABLE, Calibration
from hil.analysis.magnetometer.geometry import (
    BASES,
    Array,
    Estimate,
    Linearised,
    coverage,
    fisher_condition,
    lengths,
    linearised,
    upper,
)
from hil.analysis.magnetometer.likeness import inflation
from hil.analysis.magnetometer.settling import Given, Method, Shape, chosen, settled, started, typical
from hil.analysis.statistics import not_observable
from hil.analysis.tracing import traced
from hil.model.errors import Refused
from hil.model.figure import Figure

__all__ = ["METHODS", "SHAPES", "MagnetometerReport", "calibrate_magnetometer"]

METHODS = ("ellipsoid", "likelihood", "twostep")
"""The fits, by name."""

SHAPES = ("auto", *BASES)
"""The shapes of the gain: automatic selection, scalar, diagonal, or symmetric."""


def _spiral(count: int) -> Array:
    """Return directions (count, 3) distributed over the sphere on a golden-angle spiral."""
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn, across = np.arange(count) * math.pi * (3.0 - math.sqrt(5.0)), np.sqrt(1.0 - np.square(height))
    return np.stack([across * np.cos(turn), across * np.sin(turn), height], axis=1)


_ALL_OVER = _spiral(40)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MagnetometerReport:
    """A calibration, with the quality of its fit.

    Attributes:
        calibration: the result; its figures are NOT_OBSERVABLE where a gate of observability trips.
        noise: standard deviation of the readings along each axis, from the residuals, in their unit.
        residual: (n,), calibrated magnitude minus that of the field, for all readings, in their unit.
        outliers: indices of the readings that were left out.
        coverage: share of 48 equal-area cells on the sphere that calibrated readings reach.
        heading: standard uncertainty of a calibrated direction in deg, in the worst direction, from those of bias and
            matrix; excluding a common rotation, which magnitudes cannot show.
        uncalibrated: largest angle in deg between a reading and its calibrated value.
        condition: condition of the Fisher matrix, 2.5 for a general ellipsoid and full coverage of the sphere.
        inflation: factor on the uncertainties for correlated residuals of neighbouring readings; 1 where they are
            independent.
        gates: gates on the result.
        identifiability: what such data cannot determine in principle.
        iterations: steps of the last fit, 0 for a direct one.
    """

    calibration: Calibration
    noise: Figure
    residual: Array
    outliers: tuple[int, ...]
    coverage: Figure
    heading: Figure
    uncalibrated: Figure
    condition: Figure
    inflation: float
    gates: tuple[Gate, ...]
    identifiability: str
    iterations: int

    @property
    def conclusive(self) -> bool:
        """Whether no gate trips."""
        return all(gate.ok is not False for gate in self.gates)


@traced
def calibrate_magnetometer(
    readings: ArrayLike,
    unit: str,
    *,
    field: ArrayLike | None = None,
    method: Method | None = None,
    shape: Shape | None = None,
    noise: float | None = None,
    temperature: ArrayLike | None = None,
) -> MagnetometerReport:
    """Fit bias and matrix of a magnetometer to readings in many attitudes; the attitudes need not be known.

    Model: field = matrix (measured - bias) + noise, |field| known or constant, matrix symmetric and positive definite.

    - `ellipsoid`: algebraic and direct, as MATLAB's `magcal` (see `ellipsoid`). It takes the magnitude as constant,
      known or not.
    - `likelihood`: maximum likelihood for known, possibly varying magnitudes, or a constant unknown one.
    - `twostep`: Alonso and Shuster (see `twostep`) for known, possibly varying magnitudes; general shape.

    Without a known magnitude the matrix has determinant 1, and the expected field is a result. `auto` selects the shape
    with the least n ln(sum of squares / n) + k ln n (Bayesian information criterion), k parameters.

    Outliers: the first estimate uses the best-fitting three quarters of the readings. Readings are rejected by their
    residual in standard deviations of those kept, at a false-alarm rate of one in a hundred
    recordings.

    The covariance is for noise of equal variance along each axis, independent between readings:
    s² H^-1 J'W²diag(|G u|²)J H^-1 with H = J'WJ, W the weights of the fit and s² = sum (r / |G u|)² / (n - k)
    (`geometry`); for `ellipsoid` and `twostep` the neglected noise terms are added. Where neighbouring residuals are
    correlated, it is inflated by the scatter of block sums (`likeness`).

    Given the temperature of the sensor at each reading, the bias may be linear in temperature (see `warmth`).

    Gates: `ellipsoid`, `converged`, `coverage`, `condition` and `bias` (its uncertainty) make the figures
    NOT_OBSERVABLE; `scatter`, `noise` and `outliers` question the recording.

    Args:
        readings: shape (n, 3), in `unit`, all finite.
        unit: unit of readings and field.
        field: known magnitude at each reading, shape (n,), or one for all; None if constant and unknown.
        method: fit method; by default `likelihood`, or `ellipsoid` without a known field.
        shape: shape of the gain; by default `auto`, or `general` for `twostep`.
        noise: standard deviation of the sensor's noise along each axis in `unit`, None to take it from the residuals.
            Uncertainties follow from it, or from the residuals if larger; the gate `noise` compares the two.
        temperature: sensor temperature at each reading in degC, shape (n,); None if unknown.

    Raises:
        Refused: too few readings, values that are not finite, or incompatible options.
    """
    given, method, shape = _checked(readings, field, method, shape)
    if noise is not None and not (math.isfinite(noise) and noise > 0.0):
        raise Refused(f"a noise of {noise} is not above zero", "give its standard deviation, or leave it out")
    degrees = None if temperature is None else warmth.checked(temperature, len(given.field))
    start = started(given)
    kept, estimate = settled(given, start, method, "general" if shape == "auto" else shape)
    if shape == "auto":
        shape = chosen(given.part(kept), estimate)
        if shape != "general":
            kept, estimate = settled(given, estimate, method, shape)
    drift = warmth.NONE
    if degrees is not None and estimate.physical:
        drift = warmth.fitted(given, degrees, kept, estimate, (method, shape))
        given, kept, estimate = drift.at_reference(given), drift.kept, drift.estimate
    return _report(given, kept, estimate, unit, (method, shape), noise, drift)


def _checked(
    readings: ArrayLike, field: ArrayLike | None, method: Method | None, shape: Shape | None
) -> tuple[Given, Method, Shape]:
    data = np.array(readings, dtype=np.float64)
    if data.ndim != 2 or data.shape[1] != 3:
        raise Refused(f"readings have shape {data.shape}, not (n, 3)", "give one row of x, y and z for each sample")
    if method is None:
        method = "ellipsoid" if field is None else "likelihood"
    if shape is None:
        shape = "general" if method == "twostep" else "auto"
    if method not in METHODS or shape not in SHAPES:
        raise Refused(f"there is no method {method} with shape {shape}", f"take one of {METHODS} and of {SHAPES}")
    if method == "twostep" and field is None:
        raise Refused("TWOSTEP needs the magnitude of the field", "give it, or take the ellipsoid")
    if method == "twostep" and shape != "general":
        raise Refused("TWOSTEP fits a general matrix only", "leave the shape out, or take another method")
    try:
        known = np.ones(len(data)) if field is None else np.array(np.broadcast_to(field, len(data)), dtype=np.float64)
    except ValueError:
        raise Refused("the field has not one magnitude for each reading", "give one for each, or one for all") from None
    if not (np.isfinite(data).all() and np.isfinite(known).all() and (known > 0.0).all()):
        raise Refused("a reading or a magnitude is not a finite number, or not above zero", "leave such samples out")
    least = 4 + BASES["general" if shape == "auto" else shape].shape[1]
    if len(data) < least:
        raise Refused(f"{len(data)} readings are fewer than the {least} that show a bias", "measure more attitudes")
    return Given(readings=data, field=known, known=field is not None), method, shape


def _report(
    given: Given,
    kept: NDArray[np.bool_],
    estimate: Estimate,
    unit: str,
    how: tuple[Method, Shape],
    noise: float | None,
    drift: warmth.Drift,
) -> MagnetometerReport:
    if not estimate.physical:
        return _nothing(given, unit, how, estimate)
    method, shape = how
    basis, inliers = BASES[shape], given.part(kept)
    about = drift.with_slopes(linearised(inliers.readings, inliers.field, estimate, basis))
    freedom = float(len(inliers.field) - len(about.jacobian))
    found = math.sqrt(float(np.square(about.residual / about.spread).sum()) / freedom)
    used, dof = (noise, math.inf) if noise is not None and noise >= found else (found, freedom)
    covariance, slopes, alike = _covariance(about, basis, (found**2, used**2), method)
    condition = fisher_condition(about.direction, inliers.field, basis)
    scale = 1.0 if given.known else 1.0 / typical(estimate.gain)
    field = float(inliers.field.mean()) * scale
    gates = (
        *gating.shown(about.direction, condition, estimate),
        gating.certain(covariance, field / scale / typical(estimate.gain)),
    )
    observable = all(gate.ok for gate in gates)
    calibration = _calibration(given, estimate, unit, how, (field, scale), covariance, dof)
    calibration = replace(calibration, observable=observable, warmth=drift.told(slopes))
    residual = (lengths((given.readings - estimate.bias) @ estimate.gain) - given.field) * scale
    outliers = tuple(np.flatnonzero(~kept).tolist())
    heading = _heading(covariance if observable else None, estimate.gain, float(inliers.field.mean()), dof)
    as_stated = () if noise is None else (gating.noisy(found, noise, freedom),)
    return MagnetometerReport(
        calibration=calibration,
        noise=Figure(value=found, unit=unit, uncertainty=found / math.sqrt(2.0 * freedom), dof=freedom),
        residual=residual,
        outliers=outliers,
        coverage=Figure(value=coverage(about.direction), unit="1", uncertainty=0.0),
        heading=heading,
        uncalibrated=_turned(inliers.readings, about.direction, heading),
        condition=Figure(value=condition, unit="1", uncertainty=0.0),
        inflation=alike,
        gates=(
            *gates,
            gating.scatter(residual[kept], field, known=given.known),
            *as_stated,
            gating.outlying(outliers, len(given.field)),
        ),
        identifiability=IDENTIFIABLE,
        iterations=estimate.iterations,
    )


def _calibration(
    given: Given,
    estimate: Estimate,
    unit: str,
    how: tuple[Method, Shape],
    scaled: tuple[float, float],
    covariance: Array | None,
    dof: float,
) -> Calibration:
    """Return the calibration of an estimate, with the magnitude of the field and the scale of the gain."""
    field, scale = scaled
    return Calibration(
        unit=unit,
        bias=tuple(estimate.bias.tolist()),
        matrix=tuple(map(tuple, (estimate.gain * scale).tolist())),
        field=field,
        absolute=given.known,
        covariance=None if covariance is None else _completed(covariance, estimate.gain, scale, known=given.known),
        dof=dof,
        method=how[0],
        shape=how[1],
        observable=False,
    )


def _nothing(given: Given, unit: str, how: tuple[Method, Shape], estimate: Estimate) -> MagnetometerReport:
    """Return the report for readings that do not lie on an ellipsoid."""
    reason = "the readings lie on no ellipsoid: measure attitudes all over the sphere, and look for a disturbed field"
    nowhere = replace(estimate, bias=np.full(3, math.nan), gain=np.full((3, 3), math.nan))
    calibration = _calibration(given, nowhere, unit, how, (math.nan, 1.0), None, math.inf)
    return MagnetometerReport(
        calibration=calibration,
        noise=not_observable(unit),
        residual=np.full(len(given.field), math.nan),
        outliers=(),
        coverage=not_observable("1"),
        heading=not_observable("deg"),
        uncalibrated=not_observable("deg"),
        condition=not_observable("1"),
        inflation=1.0,
        gates=(Gate(name="ellipsoid", channel="", ok=False, reason=reason),),
        identifiability=IDENTIFIABLE,
        iterations=estimate.iterations,
    )


def _covariance(
    about: Linearised, basis: Array, variances: tuple[float, float], method: Method
) -> tuple[Array | None, Array | None, float]:
    """Return the covariance (9, 9) of bias and gain for noise along each axis, None if it is singular.

    It is followed by that of the temperature slopes (3, 3), None where there are none, and the inflation of standard
    uncertainties by correlated residuals. `variances` are that of the residuals, and the adopted one.

    The ellipsoid and TWOSTEP neglect second-order terms in the noise. Their effect is estimated by one step of the
    likelihood fit; its square is added.
    """
    found, variance = variances
    square = np.square(about.spread)
    efficient = about.jacobian / square
    scaled = about.jacobian if method == "ellipsoid" else efficient
    try:
        estimator = np.linalg.solve(scaled @ about.jacobian.T, scaled)
        neglected = efficient @ (about.residual - variance * about.curvature)
        shift = np.linalg.solve(efficient @ about.jacobian.T, neglected)
    except np.linalg.LinAlgError:
        return None, None, 1.0
    alike = max(1.0, inflation(estimator * about.residual) * found / variance) if variance else 1.0
    small = alike * variance * (estimator * square) @ estimator.T
    if method != "likelihood":
        small += np.outer(shift, shift)
    own = 3 + basis.shape[1]
    spread = np.zeros((9, own))
    spread[:3, :3], spread[3:, 3:] = np.eye(3), basis
    slopes = small[own:, own:] if len(small) > own else None
    return np.asarray(spread @ small[:own, :own] @ spread.T), slopes, math.sqrt(alike)


def _heading(covariance: Array | None, gain: Array, field: float, dof: float) -> Figure:
    """Return the standard uncertainty in deg of a calibrated direction, the worst over the whole sphere.

    y = G (x - b), so dy = -G db + dG (x - b); perpendicular to y it is an angle of |dy| / |y|.
    """
    if covariance is None or not np.isfinite(covariance).all():
        return not_observable("deg")
    change = np.zeros((len(_ALL_OVER), 3, 9))
    change[:, :, :3] = -gain
    reading = field * np.linalg.solve(gain, _ALL_OVER.T).T
    for place, (row, column) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)), start=3):
        change[:, row, place] = reading[:, column]
        change[:, column, place] = reading[:, row]
    along = np.einsum("ni,nij->nj", _ALL_OVER, change)
    change -= _ALL_OVER[:, :, np.newaxis] * along[:, np.newaxis, :]
    worst = float(np.linalg.eigvalsh(change @ covariance @ change.transpose(0, 2, 1))[:, -1].max())
    angle = math.degrees(math.sqrt(worst) / field)
    return Figure(value=angle, unit="deg", uncertainty=angle / math.sqrt(2.0 * dof), dof=dof)


def _turned(readings: Array, direction: Array, heading: Figure) -> Figure:
    """Return the largest angle between readings and directions, both (n, 3), with the directions' uncertainty."""
    if not math.isfinite(heading.value):
        return heading
    along = np.einsum("ij,ij->i", readings, direction) / lengths(readings)
    angle = math.degrees(math.acos(min(1.0, max(-1.0, float(along.min())))))
    return Figure(value=angle, unit="deg", uncertainty=heading.value)


def _completed(covariance: Array, gain: Array, scale: float, *, known: bool) -> Matrix:
    """Return the covariance (10, 10) of bias, matrix and field from that of bias and gain.

    Without a known field, matrix = p gain and field = p with p = det(gain)^(-1/3), so that
    dp = -p/3 tr(gain^-1 d gain).
    """
    change = np.vstack([np.eye(9), np.zeros((1, 9))])
    if not known:
        trace = upper(np.asarray(np.linalg.inv(gain), dtype=np.float64)) * np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
        change[9, 3:] = -scale / 3.0 * trace
        change[3:9, 3:] = scale * np.eye(6) + np.outer(upper(gain), change[9, 3:])
    return tuple(map(tuple, (change @ covariance @ change.T).tolist()))
