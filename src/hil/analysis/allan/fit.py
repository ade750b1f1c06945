"""Weighted fit of quantisation, white noise, flicker and random walk to the Allan variance of a detrended record.

Definitions follow IEEE Std 952-1997, annex C: two-sided spectra of the rate (2 pi f)^2 Q^2 / rate (quantisation of the
angle), N^2 (white), B^2 / (2 pi f) (flicker) and K^2 / (2 pi f)^2 (random walk). The fit works on the squares, in
which the Allan variance is linear.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hil.analysis.allan.ends import End, ends

__all__ = ["TERMS", "Fit", "Points", "fit", "variances"]

_Array: TypeAlias = NDArray[np.float64]

TERMS: Mapping[str, int] = {"quantisation": 2, "white": 0, "flicker": -1, "random_walk": -2}
"""The fitted terms and the noise type of each."""

_FLICKER, _WALK = (tuple(TERMS).index(name) for name in ("flicker", "random_walk"))

_OFFERED = np.array(
    [[term in subset for term in range(4)] for size in (1, 2, 3, 4) for subset in combinations(range(4), size)]
)
"""The terms in each of the fifteen subsets."""

_ITERATIONS = 50  # at most, until the model repeats itself
_FLOOR_OF_FLICKER = 2.0 * math.log(2.0) / math.pi
_DISCRETE_UP_TO = 32  # averaging factor above which sampled flicker equals its floor to better than 1e-4
_UNIFORM = 1.2 * 36.0 / 140.0  # reduction of a variance's scatter for uniform quantisation errors against Gaussian ones
_ONE_SIDED = 1.6449  # standard deviations for one-sided 95 %
_PENALTY = 9.0  # per term, in chi-square: three standard deviations, exceeded by chance once in 400 records


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """The fitted points of an Allan variance; arrays of one shape (k,).

    Attributes:
        rate: sampling rate [Hz].
        samples: length of the detrended record in samples.
        m: averaging factors.
        terms: number of averaged second differences.
        variance: Allan variances.
    """

    rate: float
    samples: int
    m: NDArray[np.int64]
    terms: NDArray[np.int64]
    variance: _Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """A fitted noise model; arrays of shape (4,), in the order of TERMS.

    Attributes:
        squares: Q^2, N^2, B^2 and K^2 of the selected terms, zero for the others. Only Q^2 may be negative: where a
            quantised angle adds variance at short averaging times, a filter before the sampling removes 3 M / 2 tau^2,
            with M the first absolute moment of the autocovariance of the filtered noise.
        offered: the squares with all terms in the fit, unconstrained; an unselected term may be negative.
        covariance: of `offered`, shape (4, 4).
        estimator: weight of each point's variance in each of `offered`, shape (4, k).
        bound: upper bound of each square at 95 % confidence.
        apart: standard deviations of the offered B^2 from zero, the smaller of those under the selected noise and
            under the best noise without flicker; infinite where random walk is selected as well.
        selected: the terms kept by the criterion.
        chi: root of chi-square per degree of freedom.
        tail: probability of a chi-square at least as large if the model is right.
    """

    squares: _Array
    offered: _Array
    covariance: _Array
    estimator: _Array
    bound: _Array
    apart: float
    selected: tuple[bool, ...]
    chi: float
    tail: float


def variances(m: NDArray[np.int64], rate: float) -> _Array:
    """Return the Allan variance of each term for a unit square, shape (k, 4), exact for sampled noise.

    Quantisation: 3 / tau^2. White: 1 / tau. Flicker: 2 ln 2 / pi for large m; for small m the integral over its
    spectrum up to half the sampling rate, with the transfer function of averages of m samples,
    sin^4(pi m f) / (m sin(pi f))^2. Random walk: (2 m^2 + 1) / (6 m rate), which is tau / 3 for large m.
    """
    flicker = [_sampled_flicker(each) for each in m.tolist()]
    walk = (2.0 * m**2 + 1.0) / (6.0 * m * rate)
    return np.column_stack([3.0 * (rate / m) ** 2, rate / m, flicker, walk])


def _sampled_flicker(m: int) -> float:
    if m > _DISCRETE_UP_TO:
        return _FLOOR_OF_FLICKER
    edges = np.linspace(0.0, 0.5, 64 * m + 1)
    middle = (edges[1:] + edges[:-1]) / 2.0  # the integrand vanishes at 0, so the midpoint rule is smooth there
    angle = np.pi * middle
    integrand = np.sin(m * angle) ** 4 / (np.sin(angle) ** 2 * middle)
    return float(integrand.sum() * edges[1] * 2.0 / (math.pi * m**2))


def fit(points: Points) -> Fit:
    """Fit every subset of the terms, and return the one with the smallest chi-square plus a penalty of 9 per term.

    Generalised least squares with the relative covariance of the points under the fitted noise, relative to the model
    and iterated until it repeats itself: the estimating equation of a gamma variate, unbiased even where few degrees of
    freedom make the points skewed. A subset with a negative N^2, B^2, K^2 or variance is discarded. The offered values
    come from a fit of all terms, so that omitting a term biases no other.

    Args:
        points: the points to fit, at least one more than terms.
    """
    work = _work(points)
    squares = plain = _started(work)
    for _ in range(3):
        squares, plain = _select(work, work.covariance(squares))
    return _judged(work, squares, plain)


@dataclass(frozen=True, slots=True)
class _Work:
    """Shared by all fits of one set of points: expectations with and without the line, spectra, ends."""

    points: Points
    whole: _Array
    design: _Array
    ends: tuple[End | None, ...]
    tilted: _Array
    spectra: _Array
    passed: _Array
    widths: _Array

    def covariance(self, squares: _Array) -> _Array:
        """Return the relative covariance of the points under a mixture of noises, shape (k, k).

        The covariance of two Allan variances of one long record is proportional to the integral of
        S(f)^2 |H_i|^2 |H_j|^2, with |H|^2 the transfer function of the Allan variance and S the spectrum of the noise
        (mean products of Gaussian variates, Isserlis 1918). At the longest averaging times the ends of the record and
        its line matter: there the variances, though not the correlations, are those of `ends`.
        """
        present = np.maximum(squares, 0.0)
        power = self.passed * (self.spectra @ present)
        product = (power * self.widths) @ power.T
        size = np.sqrt(np.diag(product))
        degrees = 2.0 * self.points.terms * np.square(power @ self.widths / size)
        parts = self.whole[:, 1:] * present[1:]
        for place, end in enumerate(self.ends):
            if end is not None and parts[place].any():
                degrees[place] = end.edf(parts[place] / parts[place].sum())
        quantised = self.design[:, 0] * present[0] / (self.design @ present)
        spread = np.sqrt(2.0 / degrees * (1.0 - _UNIFORM * np.square(quantised))) / size
        relative = product * np.outer(spread, spread)
        relative[np.diag_indices_from(relative)] += 2.0 * np.square(quantised * self.tilted)
        return np.asarray(relative, dtype=np.float64)


def _work(points: Points) -> _Work:
    whole = variances(points.m, points.rate)
    found = tuple(ends(points.samples, m) for m in points.m.tolist())
    tilted = 12.0 * (points.m / points.samples) ** 4  # the line's effect on quantisation: tau^2 times 72 Q^2 / T^4 / 2
    kept = np.array([np.ones(3) if end is None else end.kept for end in found])
    design = whole * np.column_stack([1.0 + tilted, kept])
    longest = float(points.m.max())
    frequency = np.geomspace(0.01 / longest, 0.5, 128 * (6 + round(math.log2(longest))))
    angle = np.pi * frequency
    around = 2.0 * np.pi * frequency * points.rate
    step = (2.0 * points.rate * np.sin(angle)) ** 2
    spectra = np.column_stack([step / points.rate, np.ones(frequency.size), 1.0 / around, 1.0 / step])
    passed = np.sin(np.multiply.outer(points.m, angle)) ** 4 / (np.sin(angle) * points.m[:, None]) ** 2
    widths = frequency * math.log(frequency[1] / frequency[0])
    return _Work(points, whole, design, found, tilted, spectra, passed, widths)


def _started(work: _Work) -> _Array:
    """Return the initial guess: white noise through the first point, random walk through the last."""
    ratio = work.points.variance[:, None] / work.design
    return np.array([0.0, ratio[0, 1], 0.0, ratio[-1, 3]]) / 2.0


def _select(work: _Work, covariance: _Array) -> tuple[_Array, _Array]:
    """Return the squares of the best subset, and of the best without flicker."""
    white = np.linalg.inv(np.linalg.cholesky(covariance))
    squares, possible = _solved(work, white)
    model = np.where(possible[:, None], squares @ work.design.T, work.points.variance)
    residual = _normal(work.points.variance, model, covariance) @ white.T
    criterion = np.where(possible, np.square(residual).sum(axis=1) + _PENALTY * _OFFERED.sum(axis=1), math.inf)
    places = int(np.argmin(criterion)), int(np.argmin(np.where(_OFFERED[:, _FLICKER], math.inf, criterion)))
    best, plain = (squares[each] if criterion[each] < math.inf else _started(work) for each in places)
    return best, plain


def _solved(work: _Work, white: _Array) -> tuple[_Array, NDArray[np.bool_]]:
    """Return the squares of every subset, shape (15, 4), and which subsets are valid; `white` whitens the points."""
    variance, design = work.points.variance, work.design
    squares, models = np.zeros(_OFFERED.shape), np.tile(variance, (len(_OFFERED), 1))
    possible = np.ones(len(_OFFERED), dtype=np.bool_)
    left = np.arange(len(_OFFERED))
    for _ in range(_ITERATIONS):
        offered, before = _OFFERED[left], models[left]
        terms = design / before[:, :, None] * offered[:, None, :]
        scale = np.where(offered, terms.max(axis=1), 1.0)
        terms = white @ (terms / scale[:, None, :])
        normal = terms.swapaxes(1, 2) @ terms + np.eye(4) * ~offered[:, :, None]
        right = (variance / before) @ white.T
        found = np.linalg.solve(normal, (right[:, None, :] @ terms).swapaxes(1, 2))[:, :, 0] / scale
        model = found @ design.T
        squares[left], models[left] = found, model
        possible[left] = (found[:, 1:] >= 0.0).all(axis=1) & (model > 0.0).all(axis=1)
        moved = (np.abs(model - before) > 1e-6 * before).any(axis=1)
        left = left[possible[left] & moved]
        if not left.size:
            break
    possible &= (squares[:, 1:] > 0.0).sum(axis=1) == _OFFERED[:, 1:].sum(axis=1)
    possible &= ~_OFFERED[:, 0] | (squares[:, 0] > 0.0) | ((squares[:, 0] < 0.0) & (_OFFERED.sum(axis=1) > 1))
    return squares, possible


def _estimator(design: _Array, model: _Array, lower: _Array) -> _Array:
    """Return the matrix from variances to squares: generalised least squares relative to a model."""
    scale = np.abs(design / model[:, None]).max(axis=0)
    whitened = np.linalg.solve(lower, np.column_stack([design / scale, np.diag(model)]) / model[:, None])
    left, right = whitened[:, : scale.size], whitened[:, scale.size :]
    found = np.linalg.solve(left.T @ left, left.T @ right)
    return np.asarray(found / scale[:, None] / model, dtype=np.float64)


def _estimated(work: _Work, squares: _Array, covariance: _Array) -> tuple[_Array, _Array, _Array]:
    """Return the estimator of all squares under given noise, the resulting squares, and their covariance."""
    model = work.design @ squares
    estimator = _estimator(work.design, model, np.asarray(np.linalg.cholesky(covariance), dtype=np.float64))
    weighted = estimator * model
    return estimator, estimator @ work.points.variance, np.asarray(weighted @ covariance @ weighted.T, dtype=np.float64)


def _sizes(offered: _Array, spread: _Array) -> _Array:
    return np.asarray(offered / np.sqrt(np.diag(spread)), dtype=np.float64)


def _misfit(variance: _Array, model: _Array, covariance: _Array) -> float:
    """Chi-square of the cube roots with their covariance."""
    residual = _normal(variance, model, covariance)
    return float(residual @ np.linalg.solve(covariance, residual))


def _normal(variance: _Array, model: _Array, covariance: _Array) -> _Array:
    """Return cube-root residuals, which are nearly normal (Wilson and Hilferty 1931)."""
    return np.asarray(3.0 * (np.cbrt(variance / model) - (1.0 - np.diag(covariance) / 9.0)), dtype=np.float64)


def _judged(work: _Work, squares: _Array, plain: _Array) -> Fit:
    from scipy.special import gammaincc  # noqa: PLC0415 - scipy is slow to import

    variance, design, covariance = work.points.variance, work.design, work.covariance(squares)
    model = design @ squares
    misfit = _misfit(variance, model, covariance)
    left = int(variance.size - np.count_nonzero(squares))
    estimator, offered, spread = _estimated(work, squares, covariance)
    apart = np.full(squares.size, math.inf)
    if squares[_FLICKER] and not squares[_WALK]:
        under_other = _sizes(*_estimated(work, plain, work.covariance(plain))[1:])
        apart = np.minimum(_sizes(offered, spread), under_other)
    bounds = [_bound(design, squares, estimator, covariance, float(offered[term]), term) for term in range(4)]
    taken = design[:, 0] * max(0.0, _ONE_SIDED * math.sqrt(spread[0, 0]) - float(offered[0]))
    return Fit(
        squares=squares,
        offered=offered,
        covariance=spread,
        estimator=estimator,
        bound=np.minimum(_alone(variance, model, design, np.diag(covariance), taken), np.maximum(bounds, squares)),
        apart=float(apart[_FLICKER]),
        selected=tuple((squares != 0.0).tolist()),
        chi=math.sqrt(misfit / left),
        tail=float(gammaincc(left / 2.0, misfit / 2.0)),
    )


def _bound(design: _Array, squares: _Array, estimator: _Array, covariance: _Array, offered: float, term: int) -> float:
    """Return the largest square consistent with the offered one, its own noise included, at 95 % confidence.

    Solves (x - offered)^2 = q^2 u(x)^2 for x, where u^2 is quadratic in x because the points' uncertainty is
    proportional to the model; without a solution the fit places no bound on the term.
    """
    others = design @ np.where(np.arange(4) == term, 0.0, squares)
    still, moved = estimator[term] * others, estimator[term] * design[:, term]
    found = max(offered, 0.0)
    quantile = _ONE_SIDED**2
    constant, linear = quantile * float(still @ covariance @ still), quantile * float(still @ covariance @ moved)
    square = 1.0 - quantile * float(moved @ covariance @ moved)
    if square <= 0.0:
        return math.inf
    half = found + linear
    return (half + math.sqrt(max(0.0, half**2 - square * (found**2 - constant)))) / square


def _alone(variance: _Array, model: _Array, design: _Array, relative: _Array, taken: _Array) -> _Array:
    """Return the 95 % bound of each square if its term alone made up one point: chi-square, SP1065 equation 45.

    The point is selected by the model, not by the data, so the selection costs no confidence. Variance that a filter
    may have removed is added back.
    """
    from scipy.special import gammaincinv  # noqa: PLC0415 - scipy is slow to import

    widening = 1.0 / (relative * gammaincinv(1.0 / relative, 0.05))
    best = np.argmin((model * widening + taken)[:, None] / design, axis=0)
    return np.asarray((variance * widening + taken)[best] / design[best, np.arange(design.shape[1])], dtype=np.float64)
