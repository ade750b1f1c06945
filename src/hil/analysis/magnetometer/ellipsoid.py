"""Ellipsoid fit to readings of a constant field: sphere, axis-aligned, or general.

Source: the model is that of MATLAB's `magcal`, (x - b) R (x - b)' = F²; the fit is the algebraic one of T. Ozyagcilar,
Calibrating an eCompass in the Presence of Hard- and Soft-Iron Interference, Freescale AN4246 rev. 4 (2015), for 4, 7
and 10 parameters.
"""

from __future__ import annotations

import math

import numpy as np

from hil.analysis.magnetometer.geometry import Array, Estimate, root, symmetric

__all__ = ["fit"]


def fit(readings: Array, shape: str) -> Estimate:
    """Return bias and gain with |gain · (x - bias)| = 1 for readings (n, 3) of a field of constant magnitude.

    The coefficients of the quadric w'Qw + p'w + c = 0 through the readings, of unit Frobenius norm, are the eigenvector
    of the smallest eigenvalue of the scatter matrix of its rows. Readings are first centred and scaled to unit spread
    (jointly for a sphere, per axis, or by their covariance), so that the result does not depend on units, rotation or a
    large bias. A quadric that is not an ellipsoid makes the gain NaN.

    Args:
        readings: shape (n, 3), in any unit.
        shape: `sphere` (gain a multiple of 1), `aligned` (gain diagonal) or `general`.
    """
    middle = readings.mean(axis=0)
    whiten = _whitening(readings - middle, shape)
    if not np.isfinite(whiten).all():
        return Estimate(bias=middle, gain=whiten)
    rows = _rows((readings - middle) @ whiten, shape)
    quadric, slope, constant = _matrix(np.linalg.eigh(rows.T @ rows)[1][:, 0], shape)
    if np.trace(quadric) < 0.0:
        quadric, slope, constant = -quadric, -slope, -constant
    if not np.linalg.eigvalsh(quadric)[0] > 0.0:
        return Estimate(bias=middle, gain=np.full((3, 3), math.nan))
    centre = -0.5 * np.linalg.solve(quadric, slope)
    square = float(centre @ quadric @ centre) - constant
    return Estimate(bias=middle + np.linalg.solve(whiten, centre), gain=root(whiten @ quadric @ whiten / square))


def _whitening(centred: Array, shape: str) -> Array:
    """Return the symmetric matrix that whitens readings, as far as the shape allows; NaN if they are coplanar."""
    covariance = centred.T @ centred / len(centred)
    if shape == "sphere":
        covariance = np.eye(3) * np.trace(covariance) / 3.0
    elif shape == "aligned":
        covariance = np.diag(np.diag(covariance))
    spread = root(covariance)
    return np.asarray(np.linalg.inv(spread), dtype=np.float64) if np.isfinite(spread).all() else spread


def _rows(points: Array, shape: str) -> Array:
    squares = np.square(points)
    ones = np.ones((len(points), 1))
    if shape == "sphere":
        return np.hstack([squares.sum(axis=1, keepdims=True) / math.sqrt(3.0), points, ones])
    if shape == "aligned":
        return np.hstack([squares, points, ones])
    products = math.sqrt(2.0) * points[:, (0, 0, 1)] * points[:, (1, 2, 2)]
    return np.hstack([squares, products, points, ones])


def _matrix(found: Array, shape: str) -> tuple[Array, Array, float]:
    """Return Q, p and c from the coefficient vector."""
    if shape == "sphere":
        quadric = np.eye(3) * found[0] / math.sqrt(3.0)
    elif shape == "aligned":
        quadric = np.diag(found[:3])
    else:
        quadric = symmetric(np.concatenate([found[:3], found[3:6] / math.sqrt(2.0)]))
    return quadric, found[-4:-1], float(found[-1])
