"""How far an Allan deviation can be trusted: noise type, equivalent degrees of freedom, chi-square interval.

Sources: C. A. Greenhall and W. J. Riley, "Uncertainty of stability variances based on finite differences", 35th PTTI
Meeting, 2003 (degrees of freedom; the equation and case numbers below are its own); W. J. Riley and C. A. Greenhall,
"Power law noise identification using the lag 1 autocorrelation", 18th EFTF, 2004; W. J. Riley, "Handbook of Frequency
Stability Analysis", NIST Special Publication 1065, 2008 (SP1065).

Noise types are named by the exponent alpha of the rate's power spectrum: 2 and 1 are white and flicker noise of the
angle, 0 is white noise of the rate, -1 its flicker, -2 its random walk.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["MOST_AVERAGES", "edf", "identify", "interval"]

_Array: TypeAlias = NDArray[np.float64]

MOST_AVERAGES = 1 << 14
"""Averages beyond which a noise type gets no clearer: r1 is known to 0.008 then."""

_FEWEST_AVERAGES = 30  # below, r1 says too little (Riley and Greenhall 2004)
_MOST_TERMS = 100  # J_max of Greenhall and Riley


def identify(averages: _Array) -> int | None:
    """Return the noise type of consecutive averages of the rate, or None where they are too few or all the same.

    Model: with r1 the lag-1 autocorrelation of the averages without their linear drift, delta = r1 / (1 + r1); where
    delta is 0.25 or more the averages are differenced once and counted again. alpha = -2 (delta + differences),
    rounded and held within -2 and 2 (Riley and Greenhall 2004, and SP1065's section on noise identification).

    Args:
        averages: rate averaged over consecutive windows of one length, shape (k,).
    """
    if averages.size < _FEWEST_AVERAGES:
        return None
    values = _without_drift(averages[:MOST_AVERAGES])
    delta, differences = _delta(values), 0
    if delta is not None and delta >= 0.25:
        steps = np.diff(values)
        delta, differences = _delta(steps - steps.mean()), 1
    return None if delta is None else max(-2, min(2, round(-2.0 * (delta + differences))))


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


def edf(shares: Mapping[int, float], m: int, terms: int) -> float:
    """Return the equivalent degrees of freedom of an overlapping Allan variance.

    Model: Greenhall and Riley 2003, combined algorithm for d = 2, unmodified variance, stride 1 sample. For alpha 0,
    -1 and -2 the sum of equation 10 is evaluated with at most 100 terms; in a mixture the normalised covariances add
    up before they are squared. Alpha 1 follows their case 3. Alpha 2 is exact: only the lags 0, m and 2m correlate.

    Args:
        shares: noise type to its share of the variance; shares add up to 1, types 1 and 2 come alone.
        m: averaging factor, in samples.
        terms: number of second differences that were averaged.
    """
    ratio = terms / m
    if 2 in shares:
        beyond = [max(0.0, 1.0 - lag / ratio) for lag in (1, 2)]
        return terms / (1.0 + (32.0 * beyond[0] + 2.0 * beyond[1]) / 36.0)
    if 1 in shares:
        return _edf_flicker_angle(m, terms)
    stride = min(float(m), _MOST_TERMS / min(ratio, 3.0))
    smoothing = float(m) if 3 * m <= _MOST_TERMS else math.inf
    return _edf_of_sum(shares, ratio * stride, stride, smoothing)


def _edf_of_sum(shares: Mapping[int, float], terms: float, stride: float, smoothing: float) -> float:
    """Greenhall and Riley 2003, equations 10 and 13: terms M, stride S and filter factor F."""
    count = max(1, round(min(terms, 3.0 * stride)))
    squares = np.square(sum(share * _covariance(count, stride, smoothing, alpha) for alpha, share in shares.items()))
    weights = 2.0 * (1.0 - np.arange(count + 1) / terms)
    weights[0], weights[-1] = 1.0, weights[-1] / 2.0
    return float(terms * squares[0] / (np.maximum(weights, 0.0) @ squares))


def _edf_flicker_angle(m: int, terms: int) -> float:
    """Greenhall and Riley 2003, case 3, with tables 2 and 3 for alpha = 1 and d = 2."""
    ratio = terms / m
    if min(terms, 3 * m) <= _MOST_TERMS:
        return _edf_of_sum({1: 1.0}, float(terms), float(m), float(m))
    normal = (15.23 + 12.0 * math.log(m)) ** 2
    if ratio > 3.0:
        return normal * ratio / (790.0 - 410.0 / ratio)
    stride = _MOST_TERMS / ratio
    peak = float(_second_differences(np.zeros(1), stride, 1)[0]) ** 2
    return _edf_of_sum({1: 1.0}, float(_MOST_TERMS), stride, stride) * normal / peak


@lru_cache(maxsize=512)  # a fit asks for the same lags again and again; the arrays are never changed
def _covariance(count: int, stride: float, smoothing: float, alpha: int) -> _Array:
    values = _second_differences(np.arange(count + 1) / stride, smoothing, alpha)
    return np.asarray(values / values[0], dtype=np.float64)


def _second_differences(lags: _Array, smoothing: float, alpha: int) -> _Array:
    """Covariance of second differences of the angle, equation 9 with d = 2; lags are in units of tau."""
    pairs = ((-2.0, 1.0), (-1.0, -4.0), (0.0, 6.0), (1.0, -4.0), (2.0, 1.0))
    parts = [weight * _smoothed(lags + shift, smoothing, alpha) for shift, weight in pairs]
    return np.asarray(sum(parts), dtype=np.float64)


def _smoothed(lags: _Array, smoothing: float, alpha: int) -> _Array:
    """Equation 8; an infinite filter factor is its limit, up to a constant factor."""
    if math.isinf(smoothing):
        return _generalised(lags, alpha + 2)
    step = 1.0 / smoothing
    ends = _generalised(lags - step, alpha) + _generalised(lags + step, alpha)
    return np.asarray(smoothing**2 * (2.0 * _generalised(lags, alpha) - ends), dtype=np.float64)


def _generalised(lags: _Array, alpha: int) -> _Array:
    """Generalised autocovariance of the angle, equation 7, for alpha from 2 to -2."""
    size = np.abs(lags)
    sign = -1.0 if alpha in {2, -1, -2} else 1.0
    power = 3 - alpha
    if alpha % 2 == 0:
        return np.asarray(sign * size**power, dtype=np.float64)
    return np.asarray(sign * size**power * np.log(np.where(size > 0.0, size, 1.0)), dtype=np.float64)


def interval(variance: _Array, degrees: _Array, confidence: float) -> tuple[_Array, _Array]:
    """Return the two-sided chi-square interval of a variance, SP1065 equation 45, with equal tails.

    Args:
        variance: estimated variances, shape (k,).
        degrees: their equivalent degrees of freedom, shape (k,).
        confidence: probability that the interval holds the true variance, between 0 and 1.
    """
    from scipy.special import gammaincinv  # noqa: PLC0415 - scipy is slow to import

    tail = (1.0 - confidence) / 2.0
    low = variance * degrees / (2.0 * gammaincinv(degrees / 2.0, 1.0 - tail))
    high = variance * degrees / (2.0 * gammaincinv(degrees / 2.0, tail))
    return low, high
