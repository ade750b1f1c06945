"""Whether the slow part of a record is noise, or a deterministic curve: a warm-up or a slow sine.

Averages over the cells of a record are decomposed into cosines (DCT-II), which are nearly independent under white
noise, flicker and random walk; their variances are those of the spectrum at k / 2T. Models are compared by the
likelihood of Whittle (1953), with a straight line in all of them: noise alone, and white noise, white noise with
flicker, or all noises with a curve. Curves are exponentials and sines, and with white noise also a jump of the mean;
the one that explains most represents its kind.
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

_BLOCK = 1 << 16  # samples that are looked at at once
_TRIED, _NARROWINGS = 7, 2  # shapes on either side of a curve's, and rounds
_CELLS = 512
_FEWEST = 32  # cells in which a curve can be told from noise
_WARM_UPS = np.geomspace(1.0 / 60.0, 1.0, 12)  # time constants, of the record
_APART = 8  # cells between the places of a jump
_ROUNDS = 5  # of choosing a curve and fitting the noise that is left
_STEPS = 40  # of fitting noise
_SETTLED = 1e-3  # by which the log likelihood still grows from round to round
_ALIKE = 1e-9  # of the second part of a curve, what the first leaves of it where there is none
_CURVE = 30.0  # by which twice the log likelihood grows with a curve; of 480 records of noise alone none reached it
_WALK = -5.0  # by which random walk must be more likely than a curve in its place, which leads by 8 and more by chance
_NOISE = 3.0  # by which slow noise must be more likely than white noise with a curve, which leads by 7 and more


@dataclass(frozen=True, slots=True, kw_only=True)
class Slow:
    """The nature of the slow part of a record.

    Attributes:
        curve: description of a curve that the record holds, empty if it shows none.
        noise: whether slow noise is more likely than white noise with a curve or a jump.
        walk: whether random walk is as likely as a curve in its place, with white noise and flicker.
        gain: twice the log likelihood that the curve adds to all noises.
        lead: that of slow noise over white noise with a curve or a jump.
        open: by how much the coefficient of random walk is smaller, or larger, if the curve that explains most is taken
            for real, in unit * sqrt(Hz).
        shape: of the curve: its time constant in samples, negative, or its period in samples; NaN if none shows.
    """

    curve: str
    noise: bool
    walk: bool
    gain: float
    lead: float
    open: float
    shape: float

    def rest(self, values: _Array) -> _Array:
        """Return a copy of values without a mean, a line and the curve of this shape, which are fitted together."""
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
        """Return what `rest` fits, from a sample on for a block: shape (4, k)."""
        return _design(np.arange(first, min(first + _BLOCK, samples), dtype=np.float64), self.shape, samples)


def slow(values: _Array, rate: float) -> Slow | None:
    """Return a description of the slow part of a record, None if it is too short to determine.

    Args:
        values: evenly spaced rate, shape (n,); NaN marks a missing sample.
        rate: samples per second.
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
    """Return averages over cells, those without a sample interpolated, and the length of a cell in s."""
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
    """Variances of the cosines under unit white noise, flicker and random walk, shape (cells - 1, 3)."""
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
    """Return the library of curves whose two parts are columns over the cells."""
    line = _cosines((np.arange(len(first)) + 0.5)[:, None] / len(first))[:, 0]
    one, other = (np.ascontiguousarray(_cosines(each).T) for each in (first, second))
    return _Library(line, one, other, (np.square(one), one * other, np.square(other)))


def _cycles(cells: int) -> _Array:
    slowest = np.arange(0.5, 8.0, 0.25)
    return np.concatenate([slowest, np.arange(8.0, cells / 4.0, 0.5)])


@dataclass(frozen=True, slots=True)
class _Best:
    """The largest log likelihood, up to a constant, the curve in the library that it has, and the squares of noise."""

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
    """Take off the line, and the curve that explains most, by weighted least squares."""
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
    """Return the time constant of a curve of the library in cells, negative, or its period in cells.

    It is the one between its neighbours in the library that leaves least of the averages over cells.
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
    """Return the sum of squares that a curve of this shape leaves of averages over cells."""
    design = _design(np.arange(0.5, means.size), shape, means.size)
    shares = np.linalg.lstsq(design.T, means, rcond=None)[0]
    return float(np.square(means - shares @ design).sum())


def _design(time: _Array, shape: float, span: float) -> _Array:
    """Return a curve in two parts, of which a warm-up has one, a mean and a line over time: shape (4, k)."""
    angle = 2.0 * np.pi / shape * time
    curve = [np.exp(time / shape), np.zeros_like(time)] if shape < 0.0 else [np.cos(angle), np.sin(angle)]
    return np.stack([*curve, np.ones_like(time), time / span - 0.5])


def _described(shape: float) -> str:
    if shape < 0.0:
        return f"a settling with a time constant near {roughly(-shape)} s"
    return f"an oscillation with a period near {roughly(shape)} s"


def roughly(number: float) -> str:
    """Return a number to two digits in plain notation: 300, not 3e+02."""
    return f"{float(f'{number:.2g}'):g}"
