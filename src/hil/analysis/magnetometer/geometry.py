"""Shared by all fits: field = gain · (reading - bias) with a symmetric gain, linearised about an estimate.

Notation: x is a reading, b the bias, G the gain, y = G (x - b) the calibrated field, F its known magnitude,
u = y / |y| its direction, and r = |y| - F the residual.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "BASES",
    "CELLS",
    "WHOLE",
    "Estimate",
    "Linearised",
    "coverage",
    "fisher_condition",
    "gathered",
    "lengths",
    "linearised",
    "root",
    "symmetric",
    "upper",
]

Array: TypeAlias = NDArray[np.float64]

_CAP_STEPS, _CENTRAL = 200, 0.02  # steps towards the cap's axis; below this length there is no cap but the sphere

_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
_ROWS, _COLUMNS = (np.array(each) for each in zip(*_PAIRS, strict=True))

BASES: dict[str, Array] = {
    "sphere": np.array([[1.0, 1.0, 1.0, 0.0, 0.0, 0.0]]).T,
    "aligned": np.eye(6)[:, :3],
    "general": np.eye(6),
}
"""By shape: matrix (6, m) from the m fitted parameters to the gain's elements xx, yy, zz, xy, xz, yz."""

_SECTORS = (3, 9, 12, 12, 9, 3)
CELLS = sum(_SECTORS)
"""Number of equal-area cells for directions."""

WHOLE = 2.5
"""Condition of the Fisher matrix of a general ellipsoid with directions uniform over the sphere."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """Bias and gain from a fit.

    Attributes:
        bias: (3,), in the unit of the readings.
        gain: (3, 3), symmetric and positive definite, field per reading; NaN where the fit found no ellipsoid.
        converged: whether the fit converged.
        iterations: number of steps, 0 for a direct fit.
    """

    bias: Array
    gain: Array
    converged: bool = True
    iterations: int = 0

    @property
    def physical(self) -> bool:
        """Whether bias and gain describe an ellipsoid."""
        return bool(np.isfinite(self.gain).all() and np.isfinite(self.bias).all())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linearised:
    """Residuals of readings about an estimate.

    Attributes:
        residual: (n,), r, in the unit of the field.
        jacobian: (3 + m, n), derivative of r by bias and fitted gain elements; taken at the ellipsoid's nearest point,
            so that it is independent of the reading's own noise.
        spread: (n,), |G u|: standard deviation of r per standard deviation of the noise along each axis.
        curvature: (n,), mean of r per variance of that noise, (tr G² - |G u|²) / (2 F).
        direction: (n, 3), u.
    """

    residual: Array
    jacobian: Array
    spread: Array
    curvature: Array
    direction: Array


def symmetric(elements: Array) -> Array:
    """Return the symmetric matrix (3, 3) from the elements xx, yy, zz, xy, xz, yz."""
    matrix = np.empty((3, 3))
    matrix[_ROWS, _COLUMNS] = matrix[_COLUMNS, _ROWS] = elements
    return matrix


def upper(matrix: Array) -> Array:
    """Return the elements xx, yy, zz, xy, xz, yz of a symmetric matrix (3, 3)."""
    return np.asarray(matrix[_ROWS, _COLUMNS])


def root(matrix: Array) -> Array:
    """Return the symmetric square root of a positive definite matrix (3, 3); NaN if it is not positive definite.

    By eigenvalues: singular values lose the sign.
    """
    if not np.isfinite(matrix).all():
        return np.full((3, 3), math.nan)
    values, vectors = np.linalg.eigh(matrix)
    if not values[0] > 0.0:
        return np.full((3, 3), math.nan)
    return np.asarray((vectors * np.sqrt(values)) @ vectors.T)


def lengths(vectors: Array) -> Array:
    """Return the lengths (n,) of vectors (n, 3)."""
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)))


def linearised(readings: Array, field: Array, estimate: Estimate, basis: Array) -> Linearised:
    """Return residuals of readings (n, 3) of known field magnitudes (n,) about an estimate.

    To first order the nearest point of the ellipsoid is x - r G u / |G u|²; there dr/db = -G u, and
    dr/dG_ij = u_i (x - b)_j, twice symmetrised.
    """
    gain = estimate.gain
    centred = readings.T - estimate.bias[:, None]  # three rows of n are several times faster than n rows of three
    calibrated = gain @ centred
    length = _long(calibrated)
    residual = length - field
    along = gain @ (calibrated / length)
    near = centred - residual / np.einsum("ij,ij->j", along, along) * along
    on_field = gain @ near
    direction = on_field / _long(on_field)
    along = gain @ direction
    square = np.einsum("ij,ij->j", along, along)
    elements = direction[_ROWS] * near[_COLUMNS]
    elements[3:] += direction[_COLUMNS[3:]] * near[_ROWS[3:]]
    return Linearised(
        residual=residual,
        jacobian=np.vstack([-along, basis.T @ elements]),
        spread=np.sqrt(square),
        curvature=(float(np.einsum("ij,ij->", gain, gain)) - square) / (2.0 * field),
        direction=direction.T,
    )


def _long(rows: Array) -> Array:
    return np.asarray(np.sqrt(np.einsum("ij,ij->j", rows, rows)))


def coverage(direction: Array) -> float:
    """Return the share of 48 equal-area cells of the sphere that directions (n, 3) reach.

    The cells form rings of 3, 9, 12, 12, 9 and 3, about as wide as high.
    """
    edges = 1.0 - np.cumsum((0, *_SECTORS)) * (2.0 / CELLS)
    ring = np.clip(np.searchsorted(-edges, -direction[:, 2], side="right") - 1, 0, len(_SECTORS) - 1)
    sectors = np.array(_SECTORS)[ring]
    turn = np.arctan2(direction[:, 1], direction[:, 0]) / (2.0 * math.pi) % 1.0
    place = np.cumsum((0, *_SECTORS))[ring] + np.minimum((turn * sectors).astype(int), sectors - 1)
    return np.unique(place).size / CELLS


def gathered(direction: Array) -> float:
    """Return the cosine of the half angle of the smallest spherical cap enclosing all directions (n, 3).

    The cap's axis points to the convex hull's nearest point to the origin, found by the iteration of M. Badoiu and K.
    L. Clarkson, Smaller Core-Sets for Balls, SODA 2003. It is -1 where only the whole sphere encloses them.
    """
    axis = direction.mean(axis=0)
    for step in range(2, _CAP_STEPS):
        axis = axis + (direction[int(np.argmin(direction @ axis))] - axis) / step
    length = math.sqrt(float(axis @ axis))
    return float((direction @ axis).min()) / length if length > _CENTRAL else -1.0


def fisher_condition(direction: Array, field: Array, basis: Array) -> float:
    """Return the condition of the Fisher matrix: the largest over the smallest eigenvalue, infinite if singular.

    The parameters are the offset in the field's frame over the mean magnitude, and the relative change of the gain in
    an orthonormal basis, so that units and the sensor's own gain have no effect: rows are (-u, F/mean(F) (u_x², u_y²,
    u_z², sqrt2 u_x u_y, sqrt2 u_x u_z, sqrt2 u_y u_z)). Full coverage of the sphere gives 2.5 (`WHOLE`); a hemisphere,
    or a cone, gives more.
    """
    products = direction[:, _ROWS] * direction[:, _COLUMNS]
    products[:, 3:] *= math.sqrt(2.0)
    unit = basis / np.sqrt(np.square(basis).sum(axis=0))
    rows = np.hstack([-direction, (field / field.mean())[:, None] * (products @ unit)])
    values = np.linalg.eigvalsh(rows.T @ rows)
    return float(values[-1] / values[0]) if values[0] > 1e-15 * values[-1] else math.inf
