"""The magnetic field of a rectangular coil by the law of Biot and Savart, and small rotations."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

__all__ = ["field_per_ampere", "rotation"]

Vector3 = NDArray[np.float64]

_MU_0 = 1.25663706127e-6  # V s/(A m), CODATA 2022
_TESLA_TO_MICROTESLA = 1e6
_PANELS = 32
_POINTS = 8


@lru_cache(maxsize=64)
def field_per_ampere(turns: float, sides: tuple[float, float], sensor: tuple[float, float, float]) -> Vector3:
    """Return the field [uT/A] of a rectangular coil at the sensor's place.

    Every straight side is integrated numerically, dB = mu0 I/(4 pi) dl x r/|r|^3 (Jackson, Classical
    Electrodynamics, 3rd ed., eq. 5.4), with Gauss-Legendre points in panels; the winding's thickness is
    neglected, as a printed coil's is small against its sides.

    Args:
        turns: number of turns.
        sides: lengths [m] along x and y; the coil is centred in the plane z = 0.
        sensor: place [m] in the same frame.

    Returns:
        Three components; current counted positive counter-clockwise seen from +z gives +z on the axis. The array is
        read-only: every world of a bench asks for the same coils, and gets the same arrays.
    """
    half_x, half_y = sides[0] / 2, sides[1] / 2
    corners = np.array([[half_x, -half_y, 0], [half_x, half_y, 0], [-half_x, half_y, 0], [-half_x, -half_y, 0]])
    place = np.asarray(sensor, dtype=np.float64)
    total = sum((_side(a, b, place) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)), np.zeros(3))
    field = np.asarray(turns * _MU_0 / (4 * np.pi) * _TESLA_TO_MICROTESLA * total, dtype=np.float64)
    field.setflags(write=False)
    return field


def rotation(angles: tuple[float, float, float]) -> NDArray[np.float64]:
    """Return the matrix from the jig to the frame of a sensor turned about x, y, z by these angles [rad]."""
    x, y, z = angles
    about_x = np.array([[1, 0, 0], [0, np.cos(x), np.sin(x)], [0, -np.sin(x), np.cos(x)]])
    about_y = np.array([[np.cos(y), 0, -np.sin(y)], [0, 1, 0], [np.sin(y), 0, np.cos(y)]])
    about_z = np.array([[np.cos(z), np.sin(z), 0], [-np.sin(z), np.cos(z), 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x, dtype=np.float64)


def _side(start: Vector3, end: Vector3, place: Vector3) -> Vector3:
    """Integrate dl x r/|r|^3 along one side; 1/m."""
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    edges = np.linspace(0.0, 1.0, _PANELS + 1)
    share = (edges[:-1, None] + (nodes[None, :] + 1) / (2 * _PANELS)).ravel()
    weight = np.tile(weights / (2 * _PANELS), _PANELS)
    along = end - start
    distance = place - (start + share[:, None] * along)
    cubed = np.sum(distance**2, axis=1) ** 1.5
    return np.asarray((weight / cubed) @ np.cross(along, distance), dtype=np.float64)
