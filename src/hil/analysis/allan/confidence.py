"""Confidence of a deviation: noise type, equivalent degrees of freedom, chi-square interval.

Sources: C. A. Greenhall and W. J. Riley, "Uncertainty of stability variances based on finite differences", 35th PTTI
Meeting, 2003 (degrees of freedom; the equation and case numbers below are its own); W. J. Riley and C. A. Greenhall,
"Power law noise identification using the lag 1 autocorrelation", 18th EFTF, 2004; W. J. Riley, "Handbook of Frequency
Stability Analysis", NIST Special Publication 1065, 2008 (SP1065).

Noise types are named by the exponent alpha of the rate's power spectrum: 2 and 1 are white and flicker noise of the
angle, 0 is white noise of the rate, -1 its flicker, -2 its random walk, -3 and -4 are redder still.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["MOST_AVERAGES", "REDDEST", "degrees", "edf", "identify", "interval", "total_bias"]

_Array: TypeAlias = NDArray[np.float64]

MOST_AVERAGES = 1 << 14
"""Number of averages beyond which identification of a noise type does not improve: r1 is then known to 0.008."""

REDDEST: Mapping[str, int] = {
    "overlapping": -2, "nonoverlapping": -2, "modified": -2, "time": -2, "hadamard": -4, "total": -2,
}  # fmt: skip
"""The reddest noise type for which each estimator converges, by name."""

_FEWEST_AVERAGES = 30  # with fewer, r1 is too uncertain (Riley and Greenhall 2004)
_MOST_TERMS = 100  # J_max of Greenhall and Riley
_FLICKER_ANGLE = {2: (15.23, 12.0, 790.0, 410.0), 3: (47.8, 40.0, 9950.0, 6520.0)}  # their tables 3 and 2 for alpha 1
_TOTAL = {0: (1.50, 0.0), -1: (1.17, 0.22), -2: (0.93, 0.36)}  # SP1065 table 7
_TOTAL_BIAS = {-1: 1.0 / (3.0 * math.log(2.0)), -2: 0.75}  # SP1065, section on the total variance


def identify(averages: _Array, reddest: int = -2, *, averaged: bool = False) -> int | None:
    """Identify the noise type of consecutive averages of the rate; None if they are too few or all equal.

    Model: with r1 the lag-1 autocorrelation of the detrended averages, delta = r1 / (1 + r1); while delta is 0.25 or
    more the averages are differenced and delta is recomputed. alpha = -2 (delta + differences), rounded and limited to
    `reddest` and 2 (Riley and Greenhall 2004, and SP1065's section on noise identification).

    This holds for samples. Once differenced, averages over many samples have r1 = -0.22 under flicker and 0.25 under
    random walk, so the published bound of -0.2 misidentifies nearly half of all flicker as random walk. For averages
    the bound is 0 plus one standard deviation of r1, so that no type is redder than the data show.

    Args:
        averages: rate averaged over consecutive windows of equal length, shape (k,).
        reddest: the lowest type to distinguish: -2, or -4 for a Hadamard variance.
        averaged: whether a window is longer than one sample.
    """
    if averages.size < _FEWEST_AVERAGES:
        return None
    values = _without_drift(averages[:MOST_AVERAGES])
    delta, differences = _delta(values), 0
    while delta is not None and delta >= 0.25 and differences < -reddest // 2:
        values = np.diff(values)
        delta, differences = _delta(values - values.mean()), differences + 1
    if delta is None:
        return None
    alpha = max(reddest, min(2, round(-2.0 * (delta + differences))))
    if averaged and differences == 1 and alpha in {-1, -2}:
        return -2 if delta > (1.0 - delta) / math.sqrt(averages.size) else -1
    return alpha


def _delta(values: _Array) -> float | None:
    power = float(np.square(values).sum())
    if not power > 0.0:
        return None
    autocorrelation = float((values[1:] * values[:-1]).sum()) / power
    return autocorrelation / (1.0 + autocorrelation)


def _without_drift(values: _Array) -> _Array:
    time = np.arange(values.size) - (values.size - 1) / 2.0
    centred = values - values.mean()
    slope = float((time * centred).sum()) / float(np.square(time).sum())
    return np.asarray(centred - time * slope, dtype=np.float64)


def degrees(estimator: str, alpha: int, m: int, terms: int, samples: int) -> float:
    """Return the equivalent degrees of freedom of one point of a deviation.

    Total variance: b T / tau - c (SP1065 table 7), limited to those of as many overlapping differences; for alpha 1
    and 2, which are not published, those of the overlapping Allan variance. Without overlap: equation 10 of Greenhall
    and Riley with a stride of m samples. All others: `edf`.

    Args:
        estimator: name of the estimator, a key of REDDEST.
        alpha: noise type.
        m: averaging factor, in samples.
        terms: number of differences averaged.
        samples: length of the record in samples.
    """
    if estimator == "total" and alpha in _TOTAL:
        slope, offset = _TOTAL[alpha]
        return min(slope * samples / m - offset, edf({alpha: 1.0}, m, terms))
    if estimator == "total":
        terms = samples + 1 - 2 * m
    if estimator == "nonoverlapping":
        return _edf_of_sum({alpha: 1.0}, float(terms), 1.0, float(m), 2)
    modified = estimator in {"modified", "time"}
    return edf({alpha: 1.0}, m, terms, order=3 if estimator == "hadamard" else 2, modified=modified)


def total_bias(alpha: NDArray[np.int64], m: NDArray[np.int64], samples: int) -> _Array:
    """Return the bias factor of a total variance: 1 - a tau / T (SP1065, section on total variance).

    a is 1 / (3 ln 2) for flicker, 3 / 4 for random walk and 0 otherwise. Shapes: alpha and m (k,), result (k,).
    """
    share = np.array([_TOTAL_BIAS.get(each, 0.0) for each in alpha.tolist()])
    return np.asarray(1.0 - share * m / samples, dtype=np.float64)


def edf(shares: Mapping[int, float], m: int, terms: int, *, order: int = 2, modified: bool = False) -> float:
    """Return the equivalent degrees of freedom of a variance of overlapping differences.

    Model: Greenhall and Riley 2003, combined algorithm for d = order, stride 1 sample. Modified variances, and others
    for alpha 0 and below: the sum of equation 10 is evaluated with at most 100 terms; in a mixture the normalised
    covariances are added before squaring. Alpha 1 follows their case 3. Alpha 2 is exact: only lags that are multiples
    of m, up to order times m, correlate.

    Args:
        shares: share of the variance by noise type; shares sum to 1, and types 1 and 2 must be alone.
        m: averaging factor, in samples.
        terms: number of differences averaged.
        order: 2 for Allan, 3 for Hadamard variances.
        modified: whether phases are averaged over m samples first.
    """
    ratio = terms / m
    if 2 in shares and not modified:
        common = [
            2.0 * math.comb(2 * order, order - lag) ** 2 * max(0.0, 1.0 - lag / ratio) for lag in range(1, order + 1)
        ]
        return terms / (1.0 + sum(common) / math.comb(2 * order, order) ** 2)
    if 1 in shares and not modified:
        return _edf_flicker_angle(m, terms, order)
    stride = min(float(m), _MOST_TERMS / min(ratio, order + 1.0))
    smoothing = float(m) if (order + 1) * m <= _MOST_TERMS else math.inf
    return _edf_of_sum(shares, ratio * stride, stride, 1.0 if modified else smoothing, order)


def _edf_of_sum(shares: Mapping[int, float], terms: float, stride: float, smoothing: float, order: int) -> float:
    """Greenhall and Riley 2003, equations 10 and 13: terms M, stride S and filter factor F."""
    count = max(1, round(min(terms, (order + 1.0) * stride)))
    parts = (share * _covariance(count, stride, smoothing, alpha, order) for alpha, share in shares.items())
    squares = np.square(sum(parts))
    weights = 2.0 * (1.0 - np.arange(count + 1) / terms)
    weights[0], weights[-1] = 1.0, weights[-1] / 2.0
    return float(terms * squares[0] / (np.maximum(weights, 0.0) @ squares))


def _edf_flicker_angle(m: int, terms: int, order: int) -> float:
    """Greenhall and Riley 2003, case 3, with tables 2 and 3 for alpha = 1."""
    ratio = terms / m
    if min(terms, (order + 1) * m) <= _MOST_TERMS:
        return _edf_of_sum({1: 1.0}, float(terms), float(m), float(m), order)
    constant, slope, first, second = _FLICKER_ANGLE[order]
    normal = (constant + slope * math.log(m)) ** 2
    if ratio > order + 1.0:
        return normal * ratio / (first - second / ratio)
    stride = _MOST_TERMS / ratio
    peak = float(_differences(np.zeros(1), stride, 1, order)[0]) ** 2
    return _edf_of_sum({1: 1.0}, float(_MOST_TERMS), stride, stride, order) * normal / peak


@lru_cache(maxsize=512)  # a fit needs the same lags repeatedly; the arrays are never modified
def _covariance(count: int, stride: float, smoothing: float, alpha: int, order: int) -> _Array:
    values = _differences(np.arange(count + 1) / stride, smoothing, alpha, order)
    return np.asarray(values / values[0], dtype=np.float64)


def _differences(lags: _Array, smoothing: float, alpha: int, order: int) -> _Array:
    """Covariance of differences of the angle, equation 9 with d = order; lags are in units of tau."""
    parts = [
        (-1) ** shift * math.comb(2 * order, order + shift) * _smoothed(lags + shift, smoothing, alpha)
        for shift in range(-order, order + 1)
    ]
    return np.asarray(sum(parts), dtype=np.float64)


def _smoothed(lags: _Array, smoothing: float, alpha: int) -> _Array:
    """Equation 8; an infinite filter factor is its limit, up to a constant factor."""
    if math.isinf(smoothing):
        return _generalised(lags, alpha + 2)
    step = 1.0 / smoothing
    ends = _generalised(lags - step, alpha) + _generalised(lags + step, alpha)
    return np.asarray(smoothing**2 * (2.0 * _generalised(lags, alpha) - ends), dtype=np.float64)


def _generalised(lags: _Array, alpha: int) -> _Array:
    """Generalised autocovariance of the angle, equation 7, for alpha from 2 to -6."""
    size = np.abs(lags)
    power = 3 - alpha  # the sign, which goes with alpha, cancels where covariances are normalised
    if alpha % 2 == 0:
        return np.asarray(size**power, dtype=np.float64)
    return np.asarray(size**power * np.log(np.where(size > 0.0, size, 1.0)), dtype=np.float64)


def interval(variance: _Array, degrees: _Array, confidence: float) -> tuple[_Array, _Array]:
    """Return the two-sided chi-square interval of a variance, SP1065 equation 45, with equal tails.

    Args:
        variance: estimated variances, shape (k,).
        degrees: their equivalent degrees of freedom, shape (k,).
        confidence: probability that the interval contains the true variance, between 0 and 1.
    """
    from scipy.special import gammaincinv  # noqa: PLC0415 - scipy is slow to import

    tail = (1.0 - confidence) / 2.0
    low = variance * degrees / (2.0 * gammaincinv(degrees / 2.0, 1.0 - tail))
    high = variance * degrees / (2.0 * gammaincinv(degrees / 2.0, tail))
    return low, high
