"""TWOSTEP fit: bias and scale factors from readings of a field of known magnitude at each sample.

Source: R. Alonso and M. D. Shuster, Complete Linear Attitude-Independent Magnetometer Calibration, Journal of the
Astronautical Sciences 50 (2002) 477. Equation numbers are those of N. Piotrowski, Implementation and Characterization
of Commercial off-the-shelf Sensors for the Attitude Determination System of the MOVE-III CubeSat (TU Munich, 2022),
whose print is corrected here: the update (2.33) has an inverse where it has a transpose, and the centred L-bar where
it has L; the decomposition (2.35) is that of eigenvalues, because singular values lose the sign of a negative one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hil.analysis.magnetometer.geometry import Array, Estimate, root, symmetric, upper

__all__ = ["centred", "fit"]

_MOST_STEPS = 50
_HALVINGS = 10
_RESTING = 1e-10  # convergence: squared step in standard deviations
_UNSEEN = 1e-6  # likewise, for a step that no longer reduces the sum of squares: only rounding is left
_ROUNDING = 1e-12  # of the effective measurements: rounding of residuals in double precision


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Equations:
    """The centred problem for one set of weights; theta' is c, then E in the order 11, 22, 33, 12, 13, 23.

    Attributes:
        fisher: (9, 9), F, equation 2.27.
        target: (9,), sum of (z - mu) L' over the variances, both centred: F theta' of equation 2.26.
        total: sum of one over the variances, equation 2.23.
        row: (9,), L-bar, equation 2.22.
        offset: z-bar - mu-bar, equations 2.21 and 2.24.
    """

    fisher: Array
    target: Array
    total: float
    row: Array
    offset: float

    def cost(self, theta: Array) -> float:
        """Return the cost up to a constant: half of the sum of squares."""
        apart = self.apart(theta)
        return float(theta @ self.fisher @ theta / 2.0 - self.target @ theta) + self.total * apart**2 / 2.0

    def apart(self, theta: Array) -> float:
        """Return z-bar - L-bar theta' + c'v - mu-bar, the residual of the centre."""
        return self.offset - float(self.row @ theta) + float(theta[:3] @ _v(theta))

    def slope(self, theta: Array) -> Array:
        """Return L-bar - phi(theta'), equation 2.31: minus the derivative of the centre's residual."""
        v = _v(theta)
        phi = np.concatenate([2.0 * v, -np.square(v), -2.0 * v[[0, 0, 1]] * v[[1, 2, 2]]])
        return np.asarray(self.row - phi)


def _v(theta: Array) -> Array:
    """Return v = (I + E)^-1 c, equation 2.30."""
    return np.asarray(np.linalg.solve(np.eye(3) + symmetric(theta[3:]), theta[:3]), dtype=np.float64)


def centred(readings: Array, field: Array) -> Estimate:
    """Return the centred solution, the first of the two steps, with equal weights and neglecting noise.

    It ignores the centre, and needs a varying magnitude: in a constant field it determines nothing.
    """
    equations = _centred(readings, field, np.ones(len(field)), 0.0)
    theta = np.linalg.lstsq(equations.fisher, equations.target, rcond=1e-12)[0]
    return _estimate(np.asarray(theta, dtype=np.float64), converged=True, steps=0)


def fit(readings: Array, field: Array, start: Estimate, variance: Array, mean: float) -> Estimate:
    """Return bias and gain for readings (n, 3) in a field of known magnitudes (n,); see Alonso and Shuster.

    The effective measurement z = |B|² - |R|² (2.18) is linear in theta' but for |b|² = c'v (2.30). From a start on,
    Newton steps (2.33) reduce the sum of squares of the centred measurements and of their centre; a step that does
    not is halved. It has converged when eta (2.34) is far below the effect of noise on the parameters.

    Args:
        readings: B, in the unit of the field; preferably near one, bias removed, with a gain near one.
        field: |R|, (n,).
        start: initial estimate.
        variance: (n,), variance of each effective measurement, in any common unit.
        mean: mean of the effective measurements' variance, in the square of the field's unit.
    """
    equations = _centred(readings, field, 1.0 / variance, mean)
    square = start.gain @ start.gain
    theta = np.concatenate([square @ start.bias, upper(square - np.eye(3))])
    freedom = max(1, len(field) - theta.size)
    largest = float(np.square(readings).sum(axis=1).max() + np.square(field).max())
    floor = equations.total * (_ROUNDING * largest) ** 2
    for steps in range(1, _MOST_STEPS + 1):
        slope = equations.slope(theta)
        curvature = equations.fisher + equations.total * np.outer(slope, slope)
        gradient = equations.fisher @ theta - equations.target - equations.total * equations.apart(theta) * slope
        change = -np.asarray(np.linalg.lstsq(curvature, gradient, rcond=None)[0], dtype=np.float64)
        scatter = _scatter(readings, field, theta, mean, variance) / freedom
        size = float(change @ curvature @ change)
        if size <= max(_RESTING * scatter, floor):
            return _estimate(theta + change, converged=True, steps=steps)
        moved = _reduced(equations, theta, change)
        if moved is None:
            return _estimate(theta, converged=size <= _UNSEEN * scatter, steps=steps)
        theta = moved
    return _estimate(theta, converged=False, steps=_MOST_STEPS)


def _centred(readings: Array, field: Array, weight: Array, mean: float) -> _Equations:
    """Return the centred problem, equations 2.18 to 2.27."""
    products = readings[:, (0, 1, 2, 0, 0, 1)] * readings[:, (0, 1, 2, 1, 2, 2)]
    measured = products[:, :3].sum(axis=1) - np.square(field)
    products[:, 3:] *= 2.0
    rows = np.hstack([2.0 * readings, -products])
    total = float(weight.sum())
    row, middle = weight @ rows / total, float(weight @ measured) / total
    rows -= row
    weighted = weight[:, None] * rows
    return _Equations(
        fisher=weighted.T @ rows,
        target=weighted.T @ (measured - middle),
        total=total,
        row=row,
        offset=middle - mean,
    )


def _reduced(equations: _Equations, theta: Array, change: Array) -> Array | None:
    """Return the result of a step, halved until it reduces the sum of squares; None if it never does."""
    before = equations.cost(theta)
    for _ in range(_HALVINGS):
        if equations.cost(theta + change) < before:
            return theta + change
        change = change / 2.0
    return None


def _scatter(readings: Array, field: Array, theta: Array, mean: float, variance: Array) -> float:
    """Return the weighted sum of squared residuals of z."""
    square, offset = np.eye(3) + symmetric(theta[3:]), float(theta[:3] @ _v(theta))
    left = np.einsum("ij,ij->i", readings @ square, readings) - 2.0 * readings @ theta[:3] + offset
    return float(np.sum(np.square(left - np.square(field) + mean) / variance))


def _estimate(theta: Array, *, converged: bool, steps: int) -> Estimate:
    """Return bias and gain, equations 2.35 to 2.38: I + D is the positive root of I + E, and b = (I + D)^-1 c.

    The returned bias is in terms of readings, (I + D)^-1 b.
    """
    square = np.eye(3) + symmetric(theta[3:])
    gain = root(square)
    bias = _v(theta) if np.isfinite(gain).all() else np.full(3, math.nan)
    return Estimate(bias=bias, gain=gain, converged=converged, iterations=steps)
