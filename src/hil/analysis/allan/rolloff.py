"""Detection of a pre-sampling filter's roll-off in the spectrum of a record at rest.

No sum of quantisation, white noise, flicker and random walk falls faster at high frequencies than at low ones;
low-passed noise does. The spectrum is averaged over windowed segments of the record (Welch 1967) and over bands. The
terms are fitted by Whittle's likelihood (1953): unfiltered and, where that does not fit, through low-pass filters of
several shapes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["NEIGHBOURS", "Filter", "parts", "periodogram", "rolloff"]

_Array: TypeAlias = NDArray[np.float64]

NEIGHBOURS = 1.06 * 1.94
"""Factor for the correlation of neighbouring bins by overlapping segments and the window."""

_LONGEST, _SHORTEST, _PARTS = 4096, 64, 128  # samples per segment, and the most segments
_PER_RECORD = 16  # segments per record, without overlap
_FIRST, _WIDER, _LEAST = 4, 10.0**0.1, 2  # first bin used; growth of bands, and their fewest bins
_CORNERS = 24  # trial corners between the lowest bands and nearly half of the rate
_STEPS = 60  # of the level fit
_FITS = 0.01  # probability of a misfit above which no filter is needed
_GAIN = 16.0  # in -2 ln(likelihood), four standard deviations
_SHARE = 0.5  # least share of a misfit that a filter must explain
_CONSTANTS = 5.0  # time constants of the slowest pole, after which 0.7 % of a filter's response is left


@dataclass(frozen=True, slots=True, kw_only=True)
class Filter:
    """A low-pass filter before the sampling.

    Attributes:
        corner: -3 dB frequency in Hz, to within about a third.
        settling: averaging time in s beyond which its shape does not matter.
    """

    corner: float
    settling: float


def rolloff(values: _Array, rate: float) -> Filter | None:
    """Detect a filter in a record at rest; None if there is none or the record is too short.

    Args:
        values: evenly spaced rate, shape (n,); NaN marks a missing sample.
        rate: sampling rate [Hz].
    """
    from scipy.special import gammaincc  # noqa: PLC0415 - scipy is slow to import

    looked = parts(values)
    if len(looked) < _PER_RECORD:
        return None
    length = looked.shape[1]
    edges = _edges(length)
    size = np.diff(edges)
    power = np.add.reduceat(periodogram(looked, rate)[: edges[-1]], edges[:-1]) / size
    if not (power > 0.0).all():
        return None
    degrees = 2.0 * len(looked) * size / NEIGHBOURS
    frequency = np.arange(1, edges[-1]) * rate / length
    terms = _terms(frequency, rate)
    bare = _misfit(_over(terms, edges), power, degrees)
    if gammaincc((size.size - terms.shape[1] + 1) / 2.0, bare / 2.0) > _FITS:
        return None
    corners = np.geomspace(2.0 * frequency[_FIRST - 1], rate / 2.2, _CORNERS)
    passed = _low_passes(frequency, corners, rate)
    best = int(np.argmin(_misfits(_over(terms * passed[:, :, None], edges), power, degrees)))
    gain = bare - _misfit(_over(terms * passed[best, :, None], edges), power, degrees)
    if gain <= max(_GAIN, _SHARE * bare):
        return None
    kind, place = divmod(best, _CORNERS)
    slowest = 2.0 * math.pi * float(corners[place]) * math.sin(math.pi / (2 * _KINDS[kind][1]))
    return Filter(corner=float(corners[place]), settling=_CONSTANTS / slowest)


def parts(values: _Array) -> _Array:
    """Return windowed, detrended segments without holes, spread over a record: shape (k, length).

    Args:
        values: evenly spaced rate, shape (n,); NaN marks a missing sample.
    """
    length = min(_LONGEST, 1 << max(0, int(math.log2(max(1, values.size // _PER_RECORD)))))
    if length < _SHORTEST:
        return np.empty((0, length))
    count = min(_PARTS, (values.size - length) // (length // 2) + 1)
    starts = np.linspace(0, values.size - length, count).astype(np.int64)
    found = np.lib.stride_tricks.sliding_window_view(values, length)[starts]
    found = found[np.isfinite(found).all(axis=1)]
    time = np.arange(length) - (length - 1) / 2.0
    found = found - found.mean(axis=1, keepdims=True)
    found -= np.outer(found @ time / (time @ time), time)
    return np.asarray(found * np.hanning(length + 1)[:-1], dtype=np.float64)


def periodogram(looked: _Array, rate: float) -> _Array:
    """Return the mean two-sided power density of segments, shape (length // 2 + 1,).

    Args:
        looked: windowed segments, from `parts`.
        rate: sampling rate [Hz].
    """
    scale = rate * float(np.square(np.hanning(looked.shape[1] + 1)[:-1]).sum())
    return np.asarray(np.square(np.abs(np.fft.rfft(looked, axis=1))).mean(axis=0) / scale, dtype=np.float64)


def _edges(length: int) -> NDArray[np.int64]:
    edges = [_FIRST]
    while edges[-1] < length // 2:
        edges.append(min(length // 2, max(edges[-1] + _LEAST, round(edges[-1] * _WIDER))))
    return np.array(edges)


def _terms(frequency: _Array, rate: float) -> _Array:
    """Two-sided spectra of quantisation, white noise, flicker and random walk for unit squares, shape (k, 4)."""
    step = np.square(2.0 * rate * np.sin(np.pi * frequency / rate))
    around = 2.0 * np.pi * frequency
    return np.stack([step / rate, np.ones_like(step), 1.0 / around, 1.0 / step], axis=-1)


_KINDS: tuple[tuple[Callable[[_Array], _Array], int], ...] = (
    (np.sin, 1), (np.abs, 1), (np.abs, 2), (np.abs, 4), (np.tan, 2), (np.tan, 4),
)  # fmt: skip
"""Frequency scale and order of low-passes: one recursive pole, analogue Butterworth, digital (bilinear) Butterworth."""


def _low_passes(frequency: _Array, corners: _Array, rate: float) -> _Array:
    """Return the power response of filters of each kind at each corner, shape (kinds * corners, k)."""
    angle, corner = np.pi * frequency / rate, np.pi * corners[:, None] / rate
    return np.concatenate([1.0 / (1.0 + (warped(angle) / warped(corner)) ** (2 * order)) for warped, order in _KINDS])


def _over(terms: _Array, edges: NDArray[np.int64]) -> _Array:
    """Return means over bands, shape (…, bands, 4), of spectra from the first bin on."""
    sums = np.add.reduceat(terms, edges[:-1] - 1, axis=-2)
    return np.asarray(sums / np.diff(edges)[:, None], dtype=np.float64)


def _misfits(means: _Array, power: _Array, degrees: _Array) -> _Array:
    """Return approximately the smallest excess of -2 ln(likelihood) over a perfect fit, for many models: (models,).

    Non-negative levels come from multiplicative updates, which are cheap but converge slowly.

    Args:
        means: band means of the terms, shape (models, bands, 4).
        power: band means of the record, shape (bands,).
        degrees: degrees of freedom of each band, shape (bands,).
    """
    levels = (power[:, None] / means).min(axis=1) / 2.0
    weighted = degrees * power
    for _ in range(_STEPS):
        model = (means @ levels[:, :, None])[:, :, 0]
        up = ((weighted / np.square(model))[:, None, :] @ means)[:, 0]
        levels = levels * up / ((degrees / model)[:, None, :] @ means)[:, 0]
    model = (means @ levels[:, :, None])[:, :, 0]
    return np.asarray((degrees * (np.log(model / power) + power / model - 1.0)).sum(axis=1), dtype=np.float64)


def _misfit(means: _Array, power: _Array, degrees: _Array) -> float:
    """Return the smallest excess of -2 ln(likelihood) over a perfect fit, for one model with non-negative levels.

    Every set of terms is fitted by iterated least squares relative to the model, which is maximum likelihood.
    """
    size = (means / power[:, None]).max(axis=0)
    terms = means / power[:, None] / size * _SETS[:, None, :]
    missing = np.eye(_SETS.shape[1]) * (1.0 - _SETS)[:, :, None]
    model = np.ones((len(_SETS), power.size))
    levels = np.zeros(_SETS.shape)
    for _ in range(_ITERATIONS):
        weights = degrees / np.square(model)
        weighted = (terms * weights[:, :, None]).swapaxes(1, 2)
        normal = weighted @ terms
        normal = normal + missing + _RIDGE * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(_SETS.shape[1])
        levels = np.linalg.solve(normal, weighted.sum(axis=2)[:, :, None])[:, :, 0]
        model = np.maximum((terms @ levels[:, :, None])[:, :, 0], _LITTLE)
    misfits = (degrees * (np.log(model) + 1.0 / model - 1.0)).sum(axis=1)
    return float(misfits[(levels >= 0.0).all(axis=1)].min())


_SETS = np.array([[float(number >> term & 1) for term in range(4)] for number in range(1, 16)])
_ITERATIONS, _LITTLE, _RIDGE = 30, 1e-3, 1e-12
