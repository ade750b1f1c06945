"""Distinction of slow noise from deterministic drift: a warm-up or a slow sine.

Averages over the cells of a record are decomposed into cosines (DCT-II), which are nearly independent under white
noise, flicker and random walk; their variances are those of the spectrum at k / 2T. Models are compared by Whittle's
likelihood (1953), each with a straight line: noise alone, and white noise, white noise with flicker, or all noises
with a curve. Curves are exponentials and sines, and with white noise also a jump of the mean; the one that explains
most represents its kind.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Slow", "roughly", "slow"]

_Array: TypeAlias = NDArray[np.float64]

_BLOCK = 1 << 16  # samples processed at once
_TRIED, _NARROWINGS = 7, 2  # shapes tried on either side of a curve's, and rounds of refinement
_CELLS = 512
_FEWEST = 32  # cells needed to distinguish a curve from noise
_WARM_UPS = np.geomspace(1.0 / 60.0, 1.0, 12)  # time constants, as a share of the record
_APART = 8  # cells between trial positions of a jump
_ROUNDS = 5  # of selecting a curve and fitting the residual noise
_STEPS = 40  # of the noise fit
_SETTLED = 1e-3  # convergence: gain of the log likelihood per round
_ALIKE = 1e-9  # share of a curve's second part not explained by the first, below which there is no second part
_CURVE = 30.0  # least gain of twice the log likelihood by a curve; none of 480 records of pure noise reached it
_WALK = -5.0  # by which random walk must be more likely than a curve in its place, which leads by 8 and more by chance
_NOISE = 3.0  # by which slow noise must be more likely than white noise with a curve, which leads by 7 and more


@dataclass(frozen=True, slots=True, kw_only=True)
class Slow:
    """Classification of a record's slow part.

    Attributes:
        curve: description of the curve in the record, empty if there is none.
        noise: whether slow noise is more likely than white noise with a curve or a jump.
        walk: whether random walk is as likely as a curve in its place, with white noise and flicker.
        gain: gain of twice the log likelihood when the curve is added to all noises.
        lead: the same of slow noise over white noise with a curve or a jump.
        open: change of the random-walk coefficient, either way, if the best curve is taken as real, in
            unit * sqrt(Hz).
        shape: shape of the curve: minus its time constant, or its period, in samples; NaN if there is none.
    """

    curve: str
    noise: bool
    walk: bool
    gain: float
    lead: float
    open: float
    shape: float

    def rest(self, values: _Array) -> _Array:
        """Return a copy of values, shape (n,), less mean, line and the curve of this shape, fitted jointly."""
        mean = float(np.nanmean(values))
        normal, right = np.zeros((4, 4)), np.zeros(4)
        for first in range(0, values.size, _BLOCK):
            part = values[first : first + _BLOCK] - mean
            here = np.isfinite(part)
            parts = self._parts(first, values.size)[:, here]
            normal += parts @ parts.T
            right += parts @ part[here]
        shares = np.linalg.lstsq(normal, right, rcond=1e-14)[0]
        bare = values - mean
        for first in range(0, values.size, _BLOCK):
            bare[first : first + _BLOCK] -= shares @ self._parts(first, values.size)
        return bare

    def _parts(self, first: int, samples: int) -> _Array:
        """Return the design of `rest` for a block starting at sample `first`: shape (4, k)."""
        return _design(np.arange(first, min(first + _BLOCK, samples), dtype=np.float64), self.shape, samples)


def slow(values: _Array, rate: float) -> Slow | None:
    """Classify the slow part of a record; None if the record is too short.

    Args:
        values: evenly spaced rate, shape (n,); NaN marks a missing sample.
        rate: sampling rate [Hz].
    """
    means, step = _means(values, rate)
    if means.size < _FEWEST:
        return None
    parts = _cosines(means[:, None])[:, 0]
    if not parts.any():
        return None
    design = _spectra(means.size, step)
    alone = _likelihood(parts, design)
    curves, jumps = (_likelihood(parts, design[:, :1], library) for library in (_curves, _jumps))
    without = _likelihood(parts, design[:, :2], _curves)
    both = _likelihood(parts, design, _curves)
    gain, lead = 2.0 * (both.largest - alone.largest), 2.0 * (alone.largest - max(curves.largest, jumps.largest))
    shape = _shape(both.curve, means) if gain > _CURVE else math.nan
    return Slow(
        curve=_described(shape * step) if gain > _CURVE else "",
        noise=lead > _NOISE,
        walk=2.0 * (alone.largest - without.largest) > _WALK,
        gain=gain,
        lead=lead,
        open=abs(math.sqrt(alone.levels[-1]) - math.sqrt(both.levels[-1])),
        shape=shape * step * rate,
    )


def _means(values: _Array, rate: float) -> tuple[_Array, float]:
    """Return averages over cells, interpolated where a cell has no sample, and the length of a cell in s."""
    cell = -(-values.size // _CELLS)
    rows = values[: values.size // cell * cell].reshape(-1, cell)
    present = np.isfinite(rows)
    if present.all():
        return np.asarray(rows.mean(axis=1), dtype=np.float64), cell / rate
    counts = present.sum(axis=1)
    means = np.where(present, rows, 0.0).sum(axis=1) / np.maximum(counts, 1)
    known = np.flatnonzero(counts)
    return np.interp(np.arange(counts.size), known, means[known]), cell / rate


def _cosines(columns: _Array) -> _Array:
    """Return the orthonormal DCT-II of columns, without the constant."""
    from scipy.fft import dct  # noqa: PLC0415 - scipy is slow to import

    return np.asarray(dct(columns, norm="ortho", axis=0)[1:], dtype=np.float64)


def _spectra(cells: int, step: float) -> _Array:
    """Return the variances of the cosines under unit white noise, flicker and random walk, shape (cells - 1, 3)."""
    angle = np.pi * np.arange(1, cells) / cells
    walk = step * (2.0 + np.cos(angle)) / (12.0 * np.square(np.sin(angle / 2.0)))
    return np.column_stack([np.full(angle.size, 1.0 / step), 1.0 / angle, walk])


@dataclass(frozen=True, slots=True)
class _Library:
    """The cosines of a straight line, shape (k,), and of curves, of two parts each, shape (curves, k).

    A warm-up has a second part of zeros. `products` are those of the parts: first by first, first by second, second by
    second.
    """

    line: _Array
    first: _Array
    second: _Array
    products: tuple[_Array, _Array, _Array]


@lru_cache(maxsize=4)
def _curves(cells: int) -> _Library:
    """Return warm-ups and sines."""
    time = (np.arange(cells) + 0.5) / cells
    angles = 2.0 * np.pi * np.outer(time, _cycles(cells))
    warm = np.exp(-time[:, None] / _WARM_UPS)
    return _taken_apart(np.column_stack([warm, np.cos(angles)]), np.column_stack([np.zeros_like(warm), np.sin(angles)]))


@lru_cache(maxsize=4)
def _jumps(cells: int) -> _Library:
    """Return jumps of the mean at every eighth cell."""
    place = np.arange(cells)
    steps = (place[:, None] >= np.arange(_APART, cells - _APART // 2, _APART)).astype(np.float64)
    return _taken_apart(steps, np.zeros_like(steps))


def _taken_apart(first: _Array, second: _Array) -> _Library:
    """Return the cosines of curves whose two parts are given as columns over the cells."""
    line = _cosines((np.arange(len(first)) + 0.5)[:, None] / len(first))[:, 0]
    one, other = (np.ascontiguousarray(_cosines(each).T) for each in (first, second))
    return _Library(line, one, other, (np.square(one), one * other, np.square(other)))


def _cycles(cells: int) -> _Array:
    slowest = np.arange(0.5, 8.0, 0.25)
    return np.concatenate([slowest, np.arange(8.0, cells / 4.0, 0.5)])


@dataclass(frozen=True, slots=True)
class _Best:
    """Maximum log likelihood up to a constant, its curve's index in the library, and the squared noise coefficients."""

    largest: float
    curve: int
    levels: _Array


def _likelihood(parts: _Array, design: _Array, curves: Callable[[int], _Library] | None = None) -> _Best:
    library = (curves or _curves)(parts.size + 1)
    levels = np.full(design.shape[1], float(np.square(parts).mean())) / design.mean(axis=0) / design.shape[1]
    found, before = _Best(-math.inf, 0, levels), -1
    for _ in range(_ROUNDS):
        left, place = _without(parts, 1.0 / (design @ levels), library, curved=curves is not None)
        squared = np.square(left)
        for _ in range(_STEPS):
            power = design @ levels
            levels = levels * ((squared / np.square(power)) @ design) / ((1.0 / power) @ design)
        power = design @ levels
        now = -0.5 * float((np.log(power) + squared / power).sum())
        settled = place == before and now - found.largest < _SETTLED
        if now > found.largest:
            found = _Best(now, place, levels)
        if settled:
            break
        before = place
    return found


def _without(parts: _Array, weight: _Array, library: _Library, *, curved: bool) -> tuple[_Array, int]:
    """Subtract the line, and the curve that explains most, by weighted least squares."""
    line = library.line * weight
    size = float(line @ library.line)
    bare = parts - library.line * (float(line @ parts) / size)
    if not curved:
        return bare, 0
    sides = np.column_stack([line, bare * weight])
    (first_line, first), (second_line, second) = (library.first @ sides).T, (library.second @ sides).T
    one, cross, two = (each @ weight for each in library.products)
    one, cross = one - first_line**2 / size, cross - first_line * second_line / size
    two = two - second_line**2 / size
    rest = two - cross**2 / one
    pair = rest > _ALIKE * two
    ahead = np.where(pair, (second - cross / one * first) / np.where(pair, rest, 1.0), 0.0)
    best = int((first**2 / one + ahead**2 * rest).argmax())
    back = (first[best] - cross[best] * ahead[best]) / one[best]
    along = (first_line[best] * back + second_line[best] * ahead[best]) / size
    curve = back * library.first[best] + ahead[best] * library.second[best] - along * library.line
    return np.asarray(bare - curve, dtype=np.float64), best


def _shape(curve: int, means: _Array) -> float:
    """Return minus the time constant, or the period, of a library curve in cells.

    It is refined between its neighbours in the library to minimise the residual of the cell averages.
    """
    cycles = _cycles(means.size)
    all_shapes = np.concatenate([-_WARM_UPS, 1.0 / cycles]) * means.size
    kind = all_shapes[: _WARM_UPS.size] if curve < _WARM_UPS.size else all_shapes[_WARM_UPS.size :]
    place = curve if curve < _WARM_UPS.size else curve - _WARM_UPS.size
    low, best, high = float(kind[max(0, place - 1)]), float(kind[place]), float(kind[min(place + 1, kind.size - 1)])
    for _ in range(_NARROWINGS):
        tried = np.concatenate([np.geomspace(low, best, _TRIED), np.geomspace(best, high, _TRIED)[1:]])
        least = int(np.argmin([_left(means, each) for each in tried.tolist()]))
        low, best, high = (float(tried[min(max(each, 0), tried.size - 1)]) for each in (least - 1, least, least + 1))
    return best


def _left(means: _Array, shape: float) -> float:
    """Return the residual sum of squares of the cell averages after fitting a curve of this shape."""
    design = _design(np.arange(0.5, means.size), shape, means.size)
    shares = np.linalg.lstsq(design.T, means, rcond=None)[0]
    return float(np.square(means - shares @ design).sum())


def _design(time: _Array, shape: float, span: float) -> _Array:
    """Return the two parts of a curve (a warm-up has one), a mean and a line over time: shape (4, k)."""
    angle = 2.0 * np.pi / shape * time
    curve = [np.exp(time / shape), np.zeros_like(time)] if shape < 0.0 else [np.cos(angle), np.sin(angle)]
    return np.stack([*curve, np.ones_like(time), time / span - 0.5])


def _described(shape: float) -> str:
    if shape < 0.0:
        return f"a settling with a time constant near {roughly(-shape)} s"
    return f"an oscillation with a period near {roughly(shape)} s"


def roughly(number: float) -> str:
    """Return a number to two significant digits in plain notation: 300, not 3e+02."""
    return f"{float(f'{number:.2g}'):g}"
