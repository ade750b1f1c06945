"""From readings of a magnetometer in many attitudes to its calibration, and to what speaks against it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.gates import Gate, numbers
from hil.analysis.interchange import Matrix
from hil.analysis.magnetometer.calibration import IDENTIFIABLE, Calibration
from hil.analysis.magnetometer.geometry import (
    BASES,
    CELLS,
    WHOLE,
    Array,
    Estimate,
    Linearised,
    coverage,
    fisher_condition,
    lengths,
    linearised,
    upper,
)
from hil.analysis.magnetometer.settling import Given, Method, Shape, chosen, settled, started, typical
from hil.analysis.statistics import not_observable
from hil.analysis.tracing import traced
from hil.model.errors import Refused
from hil.model.figure import Figure

__all__ = ["METHODS", "SHAPES", "MagnetometerReport", "calibrate_magnetometer"]

METHODS = ("ellipsoid", "likelihood", "twostep")
"""The fits, by name."""

SHAPES = ("auto", *BASES)
"""What the gain may be: chosen by evidence, a number, diagonal, or symmetric."""

_COVERED, _RANDOM = 0.45, 0.8  # share of cells; and of those that as many random directions would reach
_CONDITION = 1000.0  # of the Fisher matrix
_UNCERTAIN = 0.05  # of the field: a bias less certain is not observable
_SCATTER = 0.05  # of the field, rms: residuals that are not noise of the sensor
_REJECTED = 0.1  # of the readings


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MagnetometerReport:
    """A calibration, and how well the readings show it.

    Attributes:
        calibration: the result; its figures say NOT_OBSERVABLE where a gate of observability trips.
        noise: standard deviation of the readings along each axis, from the residuals, in their unit.
        residual: (n,), magnitude of the calibrated reading minus that of the field, of all readings, in their unit.
        outliers: places of the readings that were left out, counted from 0.
        coverage: share of 48 cells of equal area on the sphere that calibrated readings reach.
        condition: of the Fisher matrix, 2.5 for a general ellipsoid and directions all over the sphere.
        gates: what was asked of the result, and the answers.
        identifiability: what these data cannot show, however good they are.
        iterations: steps of the last fit, 0 where it is direct.
    """

    calibration: Calibration
    noise: Figure
    residual: Array
    outliers: tuple[int, ...]
    coverage: Figure
    condition: Figure
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
) -> MagnetometerReport:
    """Fit bias and matrix of a magnetometer to readings in many attitudes; the attitudes need not be known.

    Model: field = matrix (measured - bias) + noise, |field| known or constant, matrix symmetric and positive definite.

    - `ellipsoid`: algebraic, direct; what MATLAB's `magcal` computes (see `ellipsoid`). It takes the magnitude as
      constant, known or not.
    - `likelihood`: maximum likelihood for known magnitudes that may vary, or a constant unknown one.
    - `twostep`: Alonso and Shuster (see `twostep`) for known magnitudes that may vary; general shape.

    Without a known magnitude the matrix has determinant 1, and the expected field is a result. `auto` takes the shape
    of the least n ln(sum of squares / n) + k ln n (Bayesian information criterion), k parameters.

    Outliers: the first estimate comes from the three quarters of the readings that fit best. Left out are readings
    whose residual is so far off, in standard deviations of those kept, that chance makes one in one of a hundred
    recordings.

    The covariance is that of noise of one variance along each axis, independent from reading to reading:
    s² H^-1 J'W²diag(|G u|²)J H^-1 with H = J'WJ, W the weights of the fit and s² = sum (r / |G u|)² / (n - k)
    (`geometry`); for `ellipsoid` and `twostep` with what they neglect of the noise added.

    Gates: `ellipsoid`, `converged`, `coverage`, `condition` and `bias` (its uncertainty) make the figures
    NOT_OBSERVABLE; `scatter` and `outliers` speak against the recording.

    Args:
        readings: shape (n, 3), in `unit`, all finite.
        unit: of readings and field.
        field: known magnitude at each reading, shape (n,), or one for all; None if it is constant and not known.
        method: `likelihood` if None, but `ellipsoid` without a known field.
        shape: `auto` if None, but `general` for `twostep`.

    Raises:
        Refused: too few readings, numbers that are not finite, or options that do not go together.
    """
    given, method, shape = _checked(readings, field, method, shape)
    start = started(given)
    kept, estimate = settled(given, start, method, "general" if shape == "auto" else shape)
    if shape == "auto":
        shape = chosen(given.part(kept), estimate)
        if shape != "general":
            kept, estimate = settled(given, estimate, method, shape)
    return _report(given, kept, estimate, unit, (method, shape))


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
    given: Given, kept: NDArray[np.bool_], estimate: Estimate, unit: str, how: tuple[Method, Shape]
) -> MagnetometerReport:
    if not estimate.physical:
        return _nothing(given, unit, how, estimate)
    method, shape = how
    basis, inliers = BASES[shape], given.part(kept)
    about = linearised(inliers.readings, inliers.field, estimate, basis)
    dof = float(len(inliers.field) - len(about.jacobian))
    variance = float(np.square(about.residual / about.spread).sum()) / dof
    covariance = _covariance(about, basis, variance, method)
    condition, covered = fisher_condition(about.direction, inliers.field, basis), coverage(about.direction)
    scale = 1.0 if given.known else 1.0 / typical(estimate.gain)
    field = float(inliers.field.mean()) * scale
    gates = (
        Gate(name="ellipsoid", channel="", ok=True, reason="the readings lie on an ellipsoid"),
        _gate("converged", estimate.converged, f"the fit took {estimate.iterations} steps", "it did not come to rest"),
        _covered(covered, len(inliers.field)),
        _conditioned(condition),
        _certain(covariance, field / scale / typical(estimate.gain)),
    )
    calibration = Calibration(
        unit=unit,
        bias=tuple(estimate.bias.tolist()),
        matrix=tuple(map(tuple, (estimate.gain * scale).tolist())),
        field=field,
        absolute=given.known,
        covariance=None if covariance is None else _completed(covariance, estimate.gain, scale, known=given.known),
        dof=dof,
        method=method,
        shape=shape,
        observable=all(gate.ok for gate in gates),
    )
    residual = (lengths((given.readings - estimate.bias) @ estimate.gain) - given.field) * scale
    outliers = tuple(np.flatnonzero(~kept).tolist())
    noise = math.sqrt(variance)
    return MagnetometerReport(
        calibration=calibration,
        noise=Figure(value=noise, unit=unit, uncertainty=noise / math.sqrt(2.0 * dof), dof=dof),
        residual=residual,
        outliers=outliers,
        coverage=Figure(value=covered, unit="1", uncertainty=0.0),
        condition=Figure(value=condition, unit="1", uncertainty=0.0),
        gates=(*gates, _scatter(residual[kept], field, known=given.known), _outlying(outliers, len(given.field))),
        identifiability=IDENTIFIABLE,
        iterations=estimate.iterations,
    )


def _nothing(given: Given, unit: str, how: tuple[Method, Shape], estimate: Estimate) -> MagnetometerReport:
    """Return the report of readings that lie on no ellipsoid."""
    reason = "the readings lie on no ellipsoid: measure attitudes all over the sphere, and look for a disturbed field"
    calibration = Calibration(
        unit=unit,
        bias=(math.nan,) * 3,
        matrix=((math.nan,) * 3,) * 3,
        field=math.nan,
        absolute=given.known,
        covariance=None,
        dof=math.inf,
        method=how[0],
        shape=how[1],
        observable=False,
    )
    return MagnetometerReport(
        calibration=calibration,
        noise=not_observable(unit),
        residual=np.full(len(given.field), math.nan),
        outliers=(),
        coverage=not_observable("1"),
        condition=not_observable("1"),
        gates=(Gate(name="ellipsoid", channel="", ok=False, reason=reason),),
        identifiability=IDENTIFIABLE,
        iterations=estimate.iterations,
    )


def _covariance(about: Linearised, basis: Array, variance: float, method: Method) -> Array | None:
    """Return the covariance (9, 9) of bias and gain for noise of a variance along each axis, None if it is singular.

    The ellipsoid and TWOSTEP neglect terms of second order in the noise. By how much these move the result one step of
    the likelihood shows; its square is added.
    """
    square = np.square(about.spread)
    efficient = about.jacobian / square
    scaled = about.jacobian if method == "ellipsoid" else efficient
    try:
        estimator = np.linalg.solve(scaled @ about.jacobian.T, scaled)
        neglected = efficient @ (about.residual - variance * about.curvature)
        shift = np.linalg.solve(efficient @ about.jacobian.T, neglected)
    except np.linalg.LinAlgError:
        return None
    small = variance * (estimator * square) @ estimator.T
    if method != "likelihood":
        small += np.outer(shift, shift)
    spread = np.zeros((9, len(small)))
    spread[:3, :3], spread[3:, 3:] = np.eye(3), basis
    return np.asarray(spread @ small @ spread.T)


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


def _gate(name: str, ok: bool, told: str, wrong: str, samples: tuple[int, ...] = ()) -> Gate:
    return Gate(name=name, channel="", ok=ok, reason=told if ok else f"{told}; {wrong}", samples=samples)


def _covered(share: float, count: int) -> Gate:
    least = min(_COVERED, _RANDOM * (1.0 - (1.0 - 1.0 / CELLS) ** count))
    return _gate(
        "coverage",
        share >= least,
        f"the directions reach {share:.0%} of the sphere",
        f"at least {least:.0%} are needed: measure attitudes all over the sphere",
    )


def _conditioned(condition: float) -> Gate:
    return _gate(
        "condition",
        condition <= _CONDITION,
        f"the condition of the Fisher matrix is {condition:.3g}, where a whole sphere gives {WHOLE:g} or less",
        f"at most {_CONDITION:g} is accepted: measure attitudes all over the sphere",
    )


def _certain(covariance: Array | None, field: float) -> Gate:
    """Ask for the least certain direction of the bias, against the field in the sensor's unit."""
    known = covariance is not None and bool(np.isfinite(covariance).all())
    largest = math.sqrt(max(0.0, float(np.linalg.eigvalsh(covariance[:3, :3])[-1]))) if known else math.inf  # type: ignore[index]
    return _gate(
        "bias",
        largest <= _UNCERTAIN * field,
        f"the bias is uncertain by {largest / field:.2g} of the field",
        f"at most {_UNCERTAIN:g} is accepted: measure attitudes all over the sphere",
    )


def _scatter(residual: Array, field: float, *, known: bool) -> Gate:
    rms = math.sqrt(float(np.square(residual).mean())) / field
    cause = "the known magnitude is not that of these readings" if known else "the magnitude is not constant"
    return _gate(
        "scatter",
        rms <= _SCATTER,
        f"calibrated magnitudes differ from the field by {rms:.2%} of it, rms",
        f"more than {_SCATTER:.0%} is no noise of a sensor: {cause}, or the surroundings disturb it",
    )


def _outlying(outliers: tuple[int, ...], count: int) -> Gate:
    return _gate(
        "outliers",
        len(outliers) <= _REJECTED * count,
        f"{len(outliers)} of {count} readings are outliers and left out",
        f"more than {_REJECTED:.0%} is no accident: look for a disturbed field",
        numbers(np.array(outliers, dtype=np.intp)),
    )
