"""Weighted, non-negative fit of white noise, flicker and random walk to an Allan variance.

Definitions follow IEEE Std 952-1997, annex C: two-sided spectra of the rate N^2 (white), B^2 / (2 pi f) (flicker) and
K^2 / (2 pi f)^2 (random walk). The fit works on the squares, in which the Allan variance is linear.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hil.analysis.allan.confidence import edf

__all__ = ["TERMS", "Fit", "Points", "fit", "variances"]

_Array: TypeAlias = NDArray[np.float64]

TERMS: Mapping[str, int] = {"white": 0, "flicker": -1, "random_walk": -2}
"""The fitted terms and the noise type of each."""

_SUBSETS = tuple(subset for size in (1, 2, 3) for subset in combinations(range(3), size))
_FLOOR_OF_FLICKER = 2.0 * math.log(2.0) / math.pi
_DISCRETE_UP_TO = 32  # averaging factor above which sampled flicker is its floor to better than 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """The points of an Allan variance that are fitted; arrays of one shape (k,).

    Attributes:
        rate: samples per second.
        m: averaging factors.
        terms: number of averaged second differences.
        variance: Allan variances.
        edf: equivalent degrees of freedom, as a first guess.
    """

    rate: float
    m: NDArray[np.int64]
    terms: NDArray[np.int64]
    variance: _Array
    edf: _Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """A fitted noise model; arrays of shape (3,), in the order of TERMS.

    Attributes:
        squares: N^2, B^2 and K^2 of the selected terms, zero for the others; never negative.
        offered: the squares with all three terms in the fit, unconstrained; an unselected term may be negative.
        uncertainty: standard uncertainties of `offered`.
        bound: upper bound of each square at 95 % confidence.
        selected: which terms the Bayesian information criterion kept.
        chi: root of chi-square per degree of freedom.
        tail: probability of a chi-square at least as large if the model is right.
    """

    squares: _Array
    offered: _Array
    uncertainty: _Array
    bound: _Array
    selected: tuple[bool, bool, bool]
    chi: float
    tail: float


def variances(m: NDArray[np.int64], rate: float) -> _Array:
    """Return the Allan variance of each term for a unit square, shape (k, 3), exact for sampled noise.

    White: 1 / tau. Flicker: 2 ln 2 / pi for large m; for small m the integral over its spectrum up to half the sampling
    rate, with the transfer function of averages of m samples, sin^4(pi m f) / (m sin(pi f))^2. Random walk:
    (2 m^2 + 1) / (6 m rate), which is tau / 3 for large m.
    """
    flicker = [_sampled_flicker(each) for each in m.tolist()]
    return np.column_stack([rate / m, flicker, (2.0 * m**2 + 1.0) / (6.0 * m * rate)])


def _sampled_flicker(m: int) -> float:
    if m > _DISCRETE_UP_TO:
        return _FLOOR_OF_FLICKER
    edges = np.linspace(0.0, 0.5, 64 * m + 1)
    middle = (edges[1:] + edges[:-1]) / 2.0  # the integrand vanishes at 0, so the midpoint rule is smooth there
    angle = np.pi * middle
    integrand = np.sin(m * angle) ** 4 / (np.sin(angle) ** 2 * middle)
    return float(integrand.sum() * edges[1] * 2.0 / (math.pi * m**2))


def fit(points: Points, floor: float) -> Fit:
    """Fit every subset of the terms and return the one with the lowest Bayesian information criterion.

    Weighted least squares with weights edf / model^2, iterated until the model repeats itself: the estimating equation
    of a gamma variate, unbiased also where few degrees of freedom make the points skewed. A subset with a negative
    square is left out. Overlapping points are correlated; the covariance of the squares is that of the estimator under
    the correlation of the fitted noise, not the inverse of the normal matrix.

    Args:
        points: what to fit; at least one point more than terms.
        floor: relative standard uncertainty of the model itself, as a deviation; it adds to the weights, and as a
            common scale to the uncertainties.
    """
    design = variances(points.m, points.rate)
    degrees = points.edf
    correlation = np.eye(points.m.size)
    squares = np.zeros(3)
    for _ in range(3):
        squares = _select(points.variance, design, _relative(degrees, floor), correlation)
        degrees = _degrees(points, design * squares)
        correlation = _correlation(points, squares)
    return _judged(points, design, squares, degrees, correlation, floor)


def _relative(degrees: _Array, floor: float) -> _Array:
    """Relative variance of each Allan variance."""
    return np.asarray(2.0 / degrees + (2.0 * floor) ** 2, dtype=np.float64)


def _select(variance: _Array, design: _Array, relative: _Array, correlation: _Array) -> _Array:
    best, chosen = math.inf, np.zeros(3)
    for subset in _SUBSETS:
        squares = _solve(variance, design, relative, subset)
        if squares is None:
            continue
        model = design @ squares
        misfit = _misfit(variance, model, relative, correlation)
        criterion = misfit + float(np.log(model).sum()) * 2.0 / 3.0 + len(subset) * math.log(variance.size)
        if criterion < best:
            best, chosen = criterion, squares
    return chosen


def _solve(variance: _Array, design: _Array, relative: _Array, subset: tuple[int, ...]) -> _Array | None:
    columns = design[:, subset]
    model: _Array = variance
    part: _Array = np.zeros(len(subset))
    for _ in range(50):
        scale = 1.0 / (model * np.sqrt(relative))
        part = np.asarray(np.linalg.lstsq(columns * scale[:, None], variance * scale, rcond=None)[0], dtype=np.float64)
        previous, model = model, np.asarray(columns @ part, dtype=np.float64)
        if not (part > 0.0).all():
            return None
        if (np.abs(model - previous) <= 1e-9 * previous).all():
            break
    squares = np.zeros(3)
    squares[list(subset)] = part
    return squares


def _misfit(variance: _Array, model: _Array, relative: _Array, correlation: _Array) -> float:
    """Chi-square of the cube roots, which are nearly normal (Wilson and Hilferty 1931), with their correlation."""
    spread = relative / 9.0
    residual = (np.cbrt(variance / model) - (1.0 - spread)) / np.sqrt(spread)
    return float(residual @ np.linalg.solve(correlation, residual))


def _degrees(points: Points, parts: _Array) -> _Array:
    """Degrees of freedom of each point under the fitted mixture; parts has shape (k, 3)."""
    shares = parts / parts.sum(axis=1, keepdims=True)
    return np.array(
        [
            edf(dict(zip(TERMS.values(), (float(share) for share in row), strict=True)), int(m), int(terms))
            for row, m, terms in zip(shares, points.m, points.terms, strict=True)
        ]
    )


def _correlation(points: Points, squares: _Array) -> _Array:
    """Correlation of the Allan variances of one long record of the fitted noise, shape (k, k).

    Their covariance is proportional to the integral of S(f)^2 |H_i|^2 |H_j|^2, with |H|^2 the transfer function of the
    Allan variance and S the spectrum of the fitted noise (mean products of Gaussian variates, Isserlis 1918).
    """
    longest = float(points.m.max())
    frequency = np.geomspace(0.01 / longest, 0.5, 128 * (6 + round(math.log2(longest))))
    angle = np.pi * frequency
    around = 2.0 * np.pi * frequency * points.rate
    walk = (2.0 * points.rate * np.sin(angle)) ** 2
    spectrum = squares[0] + squares[1] / around + squares[2] / walk
    passed = np.sin(np.multiply.outer(points.m, angle)) ** 4 / (np.sin(angle) * points.m[:, None]) ** 2
    weighted = passed * spectrum * np.sqrt(frequency)
    weighted /= np.linalg.norm(weighted, axis=1, keepdims=True)
    return np.asarray(np.einsum("if,jf->ij", weighted, weighted), dtype=np.float64)


def _judged(points: Points, design: _Array, squares: _Array, degrees: _Array, correlation: _Array, floor: float) -> Fit:
    from scipy.special import gammaincc  # noqa: PLC0415 - scipy is slow to import

    model = design @ squares
    relative = _relative(degrees, floor)
    misfit = _misfit(points.variance, model, relative, correlation)
    selected = squares > 0.0
    left = points.m.size - int(selected.sum())
    scale = 1.0 / (model * np.sqrt(relative))
    estimator = np.linalg.pinv(design * scale[:, None]) * scale
    noise = correlation * np.sqrt(np.outer(2.0 / degrees, 2.0 / degrees))
    offered = estimator @ points.variance
    statistical = np.einsum("ij,jk,ik->i", estimator * model, noise, estimator * model)
    return Fit(
        squares=squares,
        offered=offered,
        uncertainty=np.sqrt(statistical + (2.0 * floor * squares) ** 2),
        bound=np.minimum(
            _alone(points.variance, model, design, relative),
            [_bound(design, squares, estimator, noise, float(offered[term]), term, floor) for term in range(3)],
        ),
        selected=(bool(selected[0]), bool(selected[1]), bool(selected[2])),
        chi=math.sqrt(misfit / left),
        tail=float(gammaincc(left / 2.0, misfit / 2.0)),
    )


def _bound(
    design: _Array, squares: _Array, estimator: _Array, noise: _Array, offered: float, term: int, floor: float
) -> float:
    """Largest square that would still have given the offered one, with its own noise counted, at 95 % confidence.

    Solves (x - offered)^2 = q^2 u(x)^2 for x, where u^2 is quadratic in x because the points' uncertainty is
    proportional to the model; without a solution the fit does not bound the term.
    """
    others = design @ np.where(np.arange(3) == term, 0.0, squares)
    still, moved = estimator[term] * others, estimator[term] * design[:, term]
    found = max(offered, 0.0)
    quantile = 1.6449**2
    constant, linear = quantile * float(still @ noise @ still), quantile * float(still @ noise @ moved)
    square = 1.0 - quantile * (float(moved @ noise @ moved) + (2.0 * floor) ** 2)
    if square <= 0.0:
        return math.inf
    half = found + linear
    return (half + math.sqrt(max(0.0, half**2 - square * (found**2 - constant)))) / square


def _alone(variance: _Array, model: _Array, design: _Array, relative: _Array) -> _Array:
    """Bound of each square if its term were all there is at one point, at 95 %: chi-square, SP1065 equation 45.

    The point is chosen by the model, not by the data, so that choosing it costs no confidence.
    """
    from scipy.special import gammaincinv  # noqa: PLC0415 - scipy is slow to import

    widening = 1.0 / (relative * gammaincinv(1.0 / relative, 0.05))
    best = np.argmin((model * widening)[:, None] / design, axis=0)
    return np.asarray((variance * widening)[best] / design[best, np.arange(3)], dtype=np.float64)
