"""Effect of detrending on long averages: expected Allan variance and degrees of freedom.

A fitted line absorbs some of the slow noise. How much depends only on the noise and on tau / T; it is computed on a
grid of 128 to 255 averages over the record, from all their second differences and the generalised covariances of the
angle: -|t| / 2 (white rate), t^2 ln|t| / (2 pi) (flicker) and |t|^3 / 12 (random walk), those of Greenhall and Riley
(see `confidence`) in the units of IEEE Std 952.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["End", "ends", "line", "slope_variances", "without"]

_Array: TypeAlias = NDArray[np.float64]

_FEWEST_CELLS = 128
_COARSEST = 8  # cells per average; with fewer the grid's differences overlap too little


@dataclass(frozen=True, slots=True, kw_only=True)
class End:
    """The Allan variance at one long averaging time of a detrended record.

    Attributes:
        kept: remaining share of the expected variance of white noise, flicker and random walk, shape (3,).
        products: inner products of the covariances of the differences under each noise, for unit variance: (3, 3).
    """

    kept: _Array
    products: _Array

    def edf(self, shares: _Array) -> float:
        """Return the degrees of freedom under a mixture; shares (3,) of the variance before detrending."""
        return float((shares @ self.kept) ** 2 / (shares @ self.products @ shares))


def ends(samples: int, m: int) -> End | None:
    """Return the effect of detrending on averages of m samples; None where they are too short to be affected."""
    cell = _cell(samples)
    return _end(samples // cell, m // cell) if m // cell >= _COARSEST else None


def _cell(samples: int) -> int:
    return max(1, 1 << int(math.log2(max(1.0, samples / _FEWEST_CELLS))))


@lru_cache(maxsize=64)
def _end(cells: int, span: int) -> End:
    differences = np.zeros((cells + 1 - 2 * span, cells + 1))
    rows = np.arange(len(differences))
    for shift, weight in ((0, 1.0), (span, -2.0), (2 * span, 1.0)):
        differences[rows, rows + shift] = weight
    bent = differences - span**2 * _slope_of_angle(cells)
    found = []
    for covariance in _covariances(cells):
        power = float(np.einsum("ij,ij->", differences @ covariance, differences))
        found.append(bent @ covariance @ bent.T / power)
    products = np.einsum("aij,bij->ab", found, found)
    return End(kept=np.array([float(np.trace(each)) for each in found]), products=products)


@lru_cache(maxsize=8)
def _covariances(cells: int) -> _Array:
    """Generalised covariances of the angle at the edges of the cells, shape (3, cells + 1, cells + 1)."""
    place = np.arange(cells + 1.0)
    lag = np.abs(place[:, None] - place)
    flicker = lag**2 * np.log(np.where(lag > 0.0, lag, 1.0)) / (2.0 * math.pi)
    return np.stack([-lag / 2.0, flicker, lag**3 / 12.0])


def _slope_of_angle(cells: int) -> _Array:
    """Weights of the angle at the edges in the slope of the rate by least squares, per cell."""
    time = np.arange(cells) - (cells - 1) / 2.0
    weight = time / float(time @ time)
    return np.asarray(np.append(0.0, weight) - np.append(weight, 0.0), dtype=np.float64)


def slope_variances(samples: int, rate: float) -> _Array:
    """Return the variance of the fitted slope under unit quantisation, white noise, flicker and random walk: (4,)."""
    cells = samples // _cell(samples)
    weights = _slope_of_angle(cells)
    step = samples / rate / cells
    unit = np.einsum("i,aij,j->a", weights, _covariances(cells), weights)
    unit = np.append(float(weights @ weights), unit)
    return np.asarray(unit * step ** np.array([-4.0, -3.0, -2.0, -1.0]), dtype=np.float64)


def line(values: _Array) -> tuple[float, float]:
    """Return mean and slope per sample of the least-squares line through the present samples, shape (n,)."""
    middle, mean = (values.size - 1) / 2.0, float(np.nanmean(values))
    sums = np.zeros(5)  # of 1, t, t^2, y and t y, with y from the mean
    for first in range(0, values.size, _BLOCK):
        part = values[first : first + _BLOCK] - mean
        time = np.arange(first, first + part.size) - middle
        present = np.isfinite(part)
        time, part = time[present], part[present]
        sums += np.array([time.size, time.sum(), time @ time, part.sum(), time @ part])
    count, first_moment, second, total, product = sums.tolist()
    slope = (count * product - first_moment * total) / (count * second - first_moment**2)
    return mean + (total - slope * first_moment) / count, slope


_BLOCK = 1 << 16


def without(values: _Array, slope: float) -> _Array:
    """Return a copy of values, shape (n,), less a line through zero of this slope per sample."""
    bare = np.arange(values.size, dtype=np.float64)
    bare *= -slope
    bare += values
    return bare
