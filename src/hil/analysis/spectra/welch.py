"""Power spectral density by Welch's method with confidence intervals, in memory independent of the record length.

Source: P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", IEEE Transactions on
Audio and Electroacoustics 15 (1967). Densities are one-sided: their sum over the frequencies from 0 to half the rate,
times the frequency spacing, is the variance. The two-sided density is half of that.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, TypeAlias

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from hil.analysis.allan.deviation import MOST_MISSING
from hil.analysis.tracing import traced
from hil.model.errors import Refused

__all__ = ["DETRENDS", "WINDOWS", "Detrend", "Spectrum", "Welch", "degrees", "interval", "smear", "spectrum"]

_Array: TypeAlias = NDArray[np.float64]
Detrend: TypeAlias = Literal["none", "constant", "linear"]

DETRENDS: tuple[Detrend, ...] = ("none", "constant", "linear")
"""Detrending of each segment: none, its mean, or its straight line."""

WINDOWS: Mapping[str, tuple[float, ...]] = {
    "hann": (0.5, 0.5),
    "blackmanharris": (0.35875, 0.48829, 0.14128, 0.01168),
    "flattop": (0.21557895, 0.41663158, 0.277263158, 0.083578947, 0.006947368),
    "boxcar": (1.0,),
}
"""Windows by name: coefficients a of the sum of a[k] (-1)^k cos(2 pi k n / segment). `boxcar` is no window."""

_LEAST, _SHARE, _LONGEST = 16, 8, 1 << 20  # samples, parts of the record, samples: of a segment that nobody chose
_FEW = 4  # segments
_MODEL = 2048  # samples of a window from which its correlations are taken, whatever the length of a segment
_BLOCK = 1 << 16  # samples that are transformed at once, if a segment is not longer: they stay in the cache
_TOGETHER, _LONG = 4, 1 << 17  # segments that the processor transforms in one go, and the longest of which it pays


@dataclass(frozen=True, slots=True, kw_only=True)
class Welch:
    """Settings of a spectrum.

    Attributes:
        segment: samples per segment, at least 4; by default the largest power of two within an eighth of the record,
            less where segments of that length have holes.
        window: a key of WINDOWS.
        overlap: overlap of neighbouring segments, from 0 to below 1.
        detrend: detrending of each segment: none, constant (its mean) or linear.
        confidence: confidence level of the intervals, between 0 and 1.
    """

    segment: int | None = None
    window: str = "hann"
    overlap: float = 0.5
    detrend: Detrend = "constant"
    confidence: float = 0.68

    def __post_init__(self) -> None:
        for what, given, known in (("window", self.window, WINDOWS), ("detrend", self.detrend, DETRENDS)):
            if given not in known:
                raise Refused(f"'{given}' is no {what} that is known", f"choose one of {', '.join(known)}")
        if not (0.0 <= self.overlap < 1.0 and 0.0 < self.confidence < 1.0):
            raise Refused(
                f"overlap {self.overlap:g} with confidence {self.confidence:g} is not possible",
                "the overlap is from 0 to below 1, the confidence between 0 and 1",
            )


_USUAL = Welch()


@dataclass(frozen=True, slots=True, kw_only=True)
class Spectrum:
    """A one-sided power spectral density; arrays of shape (segment // 2 + 1,), in ascending order of frequency.

    Attributes:
        unit: unit of the data; densities are in its square per Hz.
        rate: sampling rate [Hz].
        samples: length of the record, missing samples included.
        missing: number of missing samples.
        segment: samples per segment.
        step: samples from the start of one segment to that of the next.
        segments: number averaged, without those that lack more than MOST_MISSING of their samples.
        window: name of the window, a key of WINDOWS.
        detrend: detrending of each segment.
        bandwidth: equivalent noise bandwidth of a point [Hz].
        confidence: probability that an interval contains the true density.
        frequency: frequencies [Hz].
        density: one-sided densities.
        edf: effective degrees of freedom.
        low: lower ends of the confidence intervals.
        high: upper ends of the confidence intervals.
    """

    unit: str
    rate: float
    samples: int
    missing: int
    segment: int
    step: int
    segments: int
    window: str
    detrend: Detrend
    bandwidth: float
    confidence: float
    frequency: _Array
    density: _Array
    edf: _Array
    low: _Array
    high: _Array


@traced
def spectrum(data: ArrayLike, rate: float, *, unit: str = "1", how: Welch = _USUAL, holes: bool = False) -> Spectrum:
    """Return the one-sided power spectral density of evenly spaced data, with a chi-square interval for each point.

    With the window w, the density at f is the mean over the segments of 2 |sum w x exp(-2 pi i f t)|^2 / (rate sum
    w^2), without the factor 2 at zero and at half the rate. Its effective degrees of freedom are 2 K / (1 + 2 sum (1 -
    j / K) rho_j) for K segments, rho_j the squared autocorrelation of the window at j steps (Welch 1967), half of that
    at both ends.

    A missing sample is replaced by the mean of its segment, and the segment is normalised by the remaining window, so
    that white noise keeps its level.

    Args:
        data: shape (n,), in `unit`.
        rate: sampling rate [Hz].
        unit: unit of the data.
        how: segments, window, overlap, detrending and confidence level.
        holes: whether NaN marks a missing sample.

    Raises:
        Refused: segment or rate is invalid, the data are not finite or too short, or every segment has holes.
    """
    values = np.asarray(data, dtype=np.float64)
    if values.ndim != 1:
        raise Refused(f"data of shape {values.shape} have no spectrum", "give one axis at a time")
    if values.size < _LEAST:
        raise Refused(f"{values.size} samples are too few for a spectrum", f"give {_LEAST} or more")
    whole = math.isfinite(float(values.min()) + float(values.max()))
    missing = 0 if whole else int(np.isnan(values).sum())
    if not whole and not (holes and np.isfinite(values[~np.isnan(values)]).all()):
        raise Refused("the data are not all finite", "leave such samples out, or say holes=True if they are missing")
    length = _default(values, holes=bool(missing)) if how.segment is None else how.segment
    if not 4 <= length <= values.size:
        raise Refused(
            f"a segment of {length} samples is not possible",
            f"the record has {values.size} samples: choose 4 to {values.size}",
        )
    if not 0.0 < rate < math.inf:
        raise Refused(f"{rate:g} Hz is no sampling rate", "give a number above zero")
    step = length - int(how.overlap * length)
    shape = _window(how.window, length)
    power, count = _mean_power(values, shape, step, how.detrend, holes=bool(missing))
    power *= 2.0 / rate
    power[0] /= 2.0
    if length % 2 == 0:
        power[-1] /= 2.0
    edf = _degrees(how.window, step, count, length)
    low, high = interval(power, edf, how.confidence)
    return Spectrum(
        unit=unit, rate=float(rate), samples=values.size, missing=missing, segment=length, step=step,
        segments=count, window=how.window, detrend=how.detrend, confidence=how.confidence,
        bandwidth=float(rate * np.square(shape).sum() / shape.sum() ** 2),
        frequency=np.arange(power.size, dtype=np.float64) * float(rate / length),
        density=power, edf=edf, low=low, high=high,
    )  # fmt: skip


def _default(values: _Array, *, holes: bool) -> int:
    """Return a power of two within an eighth of the record that gives at least four segments with few holes."""
    length = min(_LONGEST, 1 << max(4, (values.size // _SHARE).bit_length() - 1))
    before = np.concatenate([[0], np.cumsum(np.isnan(values))]) if holes else np.zeros(1)
    while holes and length > _LEAST:
        starts = np.arange(0, values.size - length + 1, length // 2)
        if (before[starts + length] - before[starts] <= MOST_MISSING * length).sum() >= _FEW:
            break
        length //= 2
    return length


def _window(name: str, length: int) -> _Array:
    angle = 2.0 * np.pi * np.arange(length) / length
    return np.asarray(sum(((-1) ** k * a * np.cos(k * angle) for k, a in enumerate(WINDOWS[name])), np.zeros(length)))


def smear(name: str) -> tuple[_Array, _Array]:
    """Return the offsets, in points, and weights with which a window averages the spectrum."""
    half, parts = len(WINDOWS[name]), 16
    power = np.square(np.abs(np.fft.fft(_window(name, 128), 128 * parts)))
    offsets = np.arange(-half * parts, half * parts + 1)
    weights = power[offsets]
    return offsets / parts, weights / weights.sum()


def _mean_power(values: _Array, window: _Array, step: int, detrend: Detrend, *, holes: bool) -> tuple[_Array, int]:
    """Return the mean over segments of |transform|^2 / sum w^2, and the number of segments."""
    from scipy import fft  # noqa: PLC0415 - scipy is slow to import

    total, count = np.zeros(window.size // 2 + 1), 0
    buffer = np.empty((_rows(window.size), window.size))  # reused: fresh memory costs as much as the arithmetic
    for block in _blocks(values, window.size, step):
        work = _filled(block, window) if holes else block
        if len(work):
            parts = fft.rfft(_without_trend(work, window, detrend, buffer[: len(work)]), axis=-1).view(np.float64)
            powers = np.einsum("ij,ij->j", parts, parts)
            total += powers[::2] + powers[1::2]
            count += len(work)
    if not count:
        raise Refused(
            f"every segment of {window.size} samples misses more than {MOST_MISSING:.0%} of them",
            "choose a shorter segment, or a part of the record with fewer gaps",
        )
    return total / (count * float(np.square(window).sum())), count


def _blocks(values: _Array, length: int, step: int) -> Iterator[_Array]:
    """Yield views of the segments in cache-sized groups, shape (k, length)."""
    segments: _Array = sliding_window_view(values, length)[::step]
    rows = _rows(length)
    for first in range(0, len(segments), rows):
        yield segments[first : first + rows]


def _rows(length: int) -> int:
    return max(_TOGETHER if length <= _LONG else 1, _BLOCK // length)


def _filled(segments: _Array, window: _Array) -> _Array:
    """Return the segments with few missing samples, these replaced by means, rescaled to the remaining window."""
    absent = np.isnan(segments)
    kept = absent.mean(axis=1) <= MOST_MISSING
    absent, rows = absent[kept], segments[kept]
    if not absent.any():
        return np.asarray(rows, dtype=np.float64)
    means = np.nanmean(rows, axis=1, keepdims=True)
    left = (~absent) @ np.square(window) / np.square(window).sum()
    filled: _Array = np.where(absent, 0.0, rows - means) / np.sqrt(left)[:, None] + means
    return filled


def _without_trend(segments: _Array, window: _Array, detrend: Detrend, made: _Array) -> _Array:
    """Write detrended and windowed segments into `made`, and return that."""
    if detrend == "none":
        return np.multiply(segments, window, out=made)
    np.subtract(segments, segments.mean(axis=1, keepdims=True), out=made)
    if detrend == "linear":
        along = np.arange(window.size) - (window.size - 1) / 2.0
        made -= np.outer(made @ along / float(along @ along), along)
    return np.multiply(made, window, out=made)


def degrees(window: str, step: float, segments: int, points: int) -> float:
    """Return the effective degrees of freedom of a mean over adjacent points of a spectrum.

    That is 2 K n over the sum of the squares of the correlations between all segments and points, of which there are
    K and n: two points d apart in segments j steps apart have that of sum w[i] w[i + j step] exp(-2 pi i d / segment).

    Args:
        window: a key of WINDOWS.
        step: from one segment to the next, as a fraction of a segment.
        segments: number of segments averaged.
        points: number of points averaged.
    """
    total = 0.0
    for j, squares in enumerate(_alike(window, step)[:segments]):
        weights = 1.0 - np.arange(min(points, squares.size)) / points
        weights[1:] *= 2.0
        total += (2.0 if j else 1.0) * (1.0 - j / segments) * float(weights @ squares[: weights.size])
    return 2.0 * segments * points / total


@lru_cache(maxsize=64)
def _alike(window: str, step: float) -> _Array:
    """Return squared correlations by distance in steps and points, shape (steps, 16)."""
    taps = _window(window, _MODEL)
    moved = [round(j * step * _MODEL) for j in range(math.ceil(1.0 / step)) if round(j * step * _MODEL) < _MODEL]
    products = np.stack([np.append(taps[: _MODEL - by] * taps[by:], np.zeros(by)) for by in moved])
    found: _Array = np.square(np.abs(np.fft.rfft(products, axis=1)[:, :16])) / float(taps @ taps) ** 2
    return found


def _degrees(window: str, step: int, count: int, length: int) -> _Array:
    edf = np.full(length // 2 + 1, degrees(window, step / length, count, 1))
    edf[0] /= 2.0
    if length % 2 == 0:
        edf[-1] /= 2.0
    return edf


def interval(density: _Array, edf: _Array, confidence: float) -> tuple[_Array, _Array]:
    """Return the ends of chi-square intervals: density edf / chi^2 at (1 + confidence) / 2 and (1 - confidence) / 2."""
    from scipy.special import gammaincinv  # noqa: PLC0415 - scipy is slow to import

    kinds, place = np.unique(edf / 2.0, return_inverse=True)
    upper, lower = (kinds / gammaincinv(kinds, (1.0 + sign * confidence) / 2.0) for sign in (1.0, -1.0))
    return density * upper[place], density * lower[place]
