"""Gates on a magnetometer calibration."""

from __future__ import annotations

import math

import numpy as np

from hil.analysis.gates import Gate, numbers
from hil.analysis.magnetometer.geometry import CELLS, WHOLE, Array, Estimate, coverage, gathered

__all__ = ["certain", "noisy", "outlying", "scatter", "shown"]

_COVERED, _RANDOM = 0.45, 0.8  # least share of cells; and of those that as many random directions would reach
_FEW, _CAP = 100, 78.0  # readings below which cells mean little; half angle in deg of a cap to exceed
_CONDITION = 1000.0  # of the Fisher matrix
_UNCERTAIN = 0.05  # of the field: largest uncertainty of an observable bias
_SCATTER = 0.05  # of the field, rms: more is not sensor noise
_REJECTED = 0.1  # of the readings
_LOUDER, _DEVIATIONS = 1.3, 4.0  # allowed ratio of residuals to the stated noise, and standard deviations for chance


def _gate(name: str, ok: bool, told: str, wrong: str, samples: tuple[int, ...] = ()) -> Gate:
    return Gate(name=name, channel="", ok=ok, reason=told if ok else f"{told}; {wrong}", samples=samples)


def shown(direction: Array, condition: float, estimate: Estimate) -> tuple[Gate, ...]:
    """Return the gates of observability: ellipsoid, convergence, coverage, and condition."""
    return (
        Gate(name="ellipsoid", channel="", ok=True, reason="the readings lie on an ellipsoid"),
        _gate("converged", estimate.converged, f"the fit took {estimate.iterations} steps", "it did not converge"),
        _covered(direction),
        _gate(
            "condition",
            condition <= _CONDITION,
            f"the condition of the Fisher matrix is {condition:.3g}, where a whole sphere gives {WHOLE:g} or less",
            f"at most {_CONDITION:g} is accepted: measure attitudes all over the sphere",
        ),
    )


def _covered(direction: Array) -> Gate:
    """Return the gate on coverage of the sphere: by cells, and for few readings by the smallest enclosing cap."""
    share, count = coverage(direction), len(direction)
    least = min(_COVERED, _RANDOM * (1.0 - (1.0 - 1.0 / CELLS) ** count))
    cap = math.degrees(math.acos(gathered(direction))) if count < _FEW else 180.0
    if share >= least and cap < _CAP:
        told = f"all {count} directions lie within {cap:.0f} deg of one"
        return _gate("coverage", False, told, "that is a part of the sphere: measure attitudes all over it")
    return _gate(
        "coverage",
        share >= least,
        f"the directions reach {share:.0%} of the sphere",
        f"at least {least:.0%} are needed: measure attitudes all over the sphere",
    )


def certain(covariance: Array | None, field: float) -> Gate:
    """Return the gate on the bias uncertainty in its worst direction, relative to the field in the sensor's unit."""
    known = covariance is not None and bool(np.isfinite(covariance).all())
    largest = math.sqrt(max(0.0, float(np.linalg.eigvalsh(covariance[:3, :3])[-1]))) if known else math.inf  # type: ignore[index]
    return _gate(
        "bias",
        largest <= _UNCERTAIN * field,
        f"the bias is uncertain by {largest / field:.2g} of the field",
        f"at most {_UNCERTAIN:g} is accepted: measure attitudes all over the sphere",
    )


def scatter(residual: Array, field: float, *, known: bool) -> Gate:
    """Return the gate on residuals being small enough for sensor noise."""
    rms = math.sqrt(float(np.square(residual).mean())) / field
    cause = "the known magnitude is not that of these readings" if known else "the magnitude is not constant"
    return _gate(
        "scatter",
        rms <= _SCATTER,
        f"calibrated magnitudes differ from the field by {rms:.2%} of it, rms",
        f"more than {_SCATTER:.0%} is no noise of a sensor: {cause}, or the surroundings disturb it",
    )


def outlying(outliers: tuple[int, ...], count: int) -> Gate:
    """Return the gate on the share of rejected readings."""
    return _gate(
        "outliers",
        len(outliers) <= _REJECTED * count,
        f"{len(outliers)} of {count} readings are outliers and left out",
        f"more than {_REJECTED:.0%} is no accident: look for a disturbed field",
        numbers(np.array(outliers, dtype=np.intp)),
    )


def noisy(found: float, stated: float, dof: float) -> Gate:
    """Return the gate on residuals against the stated noise."""
    most = _LOUDER * (1.0 + _DEVIATIONS / math.sqrt(2.0 * dof))
    return _gate(
        "noise",
        found <= most * stated,
        f"residuals are {found / stated:.3g} times what the stated noise makes",
        f"more than {most:.3g} is not noise of the sensor: look for a disturbed field, or a wrong shape or magnitude",
    )
