"""Maximum-likelihood fit: distances of readings from their ellipsoids, by damped Gauss-Newton steps.

Readings have independent noise of equal variance along each axis of the sensor. The distance of a reading x of a field
F from its ellipsoid |G (x - b)| = F is then r / |G u| to first order, and the likelihood is largest where the weighted
sum of their squares is stationary. The magnitude of a noisy vector is biased high by the curvature of the sphere
(`Linearised.curvature`); this is subtracted.

Source: the likelihood of M. Kok and T. B. Schön, Magnetometer Calibration Using Inertial Sensors, IEEE Sensors Journal
16 (2016) 5679, section IV, without the inertial sensors; distances as of P. D. Sampson, Computer Graphics and Image
Processing 18 (1982) 97; damping as of D. W. Marquardt, SIAM Journal 11 (1963) 431.
"""

from __future__ import annotations

import numpy as np

from hil.analysis.magnetometer.geometry import BASES, Array, Estimate, Linearised, linearised, symmetric, upper

__all__ = ["fit"]

_MOST_STEPS = 60
_RESTING = 1e-8  # convergence: squared step in standard deviations
_ROUNDING = 1e-12  # of the field, likewise
_DAMPED = (0.0, *(10.0**power for power in range(-6, 7)))


def fit(readings: Array, field: Array, start: Estimate, shape: str) -> Estimate:
    """Return bias and gain for readings (n, 3) in a field of known magnitudes (n,).

    Each step solves (J'WJ + lambda diag(J'WJ)) d = -J'W (r - curvature s²) with W = 1 / |G u|² and s² from the
    residuals; lambda is the smallest of 0, 1e-6, 1e-5, ... 1e6 that does not increase the weighted sum of squares. It
    has converged when d'J'WJ d is far below s².

    Args:
        readings: readings in the sensor's frame, (n, 3).
        field: magnitudes (n,); ones if constant and unknown.
        start: initial estimate.
        shape: a key of `BASES`.
    """
    basis = BASES[shape]
    back = np.linalg.pinv(basis)
    estimate = Estimate(bias=start.bias, gain=symmetric(basis @ (back @ upper(start.gain))))
    now = linearised(readings, field, estimate, basis)
    freedom = max(1, len(field) - 3 - basis.shape[1])
    floor = (_ROUNDING * float(field.max()) / float(np.median(now.spread))) ** 2 * len(field)
    for step in range(1, _MOST_STEPS + 1):
        scale = _variance(now, freedom)
        weighted = now.jacobian / np.square(now.spread)
        fisher = weighted @ now.jacobian.T
        wanted = -(weighted @ (now.residual - scale * now.curvature))
        theta = np.concatenate([estimate.bias, back @ upper(estimate.gain)])
        tried = _damped(readings, field, theta, (fisher, wanted, scale), now, basis)
        if tried is None:
            return _at(theta, basis, converged=False, steps=step)
        change, estimate, now = tried
        if float(change @ fisher @ change) <= max(_RESTING * scale, floor):
            return _at(theta + change, basis, converged=True, steps=step)
    return Estimate(bias=estimate.bias, gain=estimate.gain, converged=False, iterations=_MOST_STEPS)


def _variance(now: Linearised, freedom: int) -> float:
    return float(np.square(now.residual / now.spread).sum()) / freedom


def _damped(
    readings: Array,
    field: Array,
    theta: Array,
    equations: tuple[Array, Array, float],
    now: Linearised,
    basis: Array,
) -> tuple[Array, Estimate, Linearised] | None:
    """Return the least damped step that does not increase the sum of squares by more than one variance.

    A smaller increase is not divergence: weights and nearest points change with each step. None if there is none.
    """
    fisher, wanted, scale = equations
    weight = 1.0 / np.square(now.spread)
    before = float(weight @ np.square(now.residual - scale * now.curvature))
    for damping in _DAMPED:
        try:
            change = np.linalg.solve(fisher + damping * np.diag(np.diag(fisher)), wanted)
        except np.linalg.LinAlgError:
            continue
        estimate = _at(theta + change, basis, converged=False, steps=0)
        if not np.linalg.eigvalsh(estimate.gain)[0] > 0.0:
            continue
        after = linearised(readings, field, estimate, basis)
        left = float(weight @ np.square(after.residual - scale * now.curvature))
        if left <= before + scale:
            return np.asarray(change, dtype=np.float64), estimate, after
    return None


def _at(theta: Array, basis: Array, *, converged: bool, steps: int) -> Estimate:
    return Estimate(bias=theta[:3], gain=symmetric(basis @ theta[3:]), converged=converged, iterations=steps)
