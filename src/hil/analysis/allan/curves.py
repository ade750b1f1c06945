"""Whether slow noise of a record is noise, or a curve that is no noise: a warm-up or a slow sine.

Averages over the cells of a record are taken apart into cosines (DCT-II), which are nearly independent under white
noise, flicker and random walk; their variances are those of the spectrum at k / 2T. Models are compared by the
likelihood of Whittle (1953), with a straight line in all of them: noise alone, and white noise, white noise with
flicker, or all noises with a curve. Curves are exponentials and sines; the one that explains most stands for its kind.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Slow", "roughly", "slow"]

_Array: TypeAlias = NDArray[np.float64]

_CELLS = 512
_FEWEST = 32  # cells in which a curve can be told from noise
_WARM_UPS = np.geomspace(1.0 / 60.0, 1.0, 12)  # time constants, of the record
_ROUNDS = 5  # of choosing a curve and fitting the noise that is left
_STEPS = 40  # of fitting noise
_SETTLED = 1e-3  # by which the log likelihood still grows from round to round
_ALIKE = 1e-9  # of the second part of a curve, what the first leaves of it where there is none
_CURVE = 30.0  # by which twice the log likelihood grows with a curve; of 480 records of noise alone none reached it
_WALK = -5.0  # by which random walk must be more likely than a curve in its place, which leads by 8 and more by chance
_NOISE = 3.0  # by which slow noise must be more likely than white noise with a curve, which leads by 7 and more


@dataclass(frozen=True, slots=True, kw_only=True)
class Slow:
    """What the slow part of a record is.

    Attributes:
        curve: description of a curve that the record holds, empty if it shows none.
        noise: whether slow noise is more likely than white noise with a curve.
        walk: whether random walk is as likely as a curve in its place, with white noise and flicker.
        gain: twice the log likelihood that the curve adds to all noises.
        lead: that of slow noise over white noise with a curve.
    """

    curve: str
    noise: bool
    walk: bool
    gain: float
    lead: float


def slow(values: _Array, rate: float) -> Slow | None:
    """Return what the slow part of a record is, None if it is too short to tell.

    Args:
        values: evenly spaced rate, shape (n,); NaN stands for a missing sample.
        rate: samples per second.
    """
    means, step = _means(values, rate)
    if means.size < _FEWEST:
        return None
    parts = _cosines(means[:, None])[:, 0]
    if not parts.any():
        return None
    design = _spectra(means.size, step)
    alone, _ = _likelihood(parts, design, curved=False)
    simple, _ = _likelihood(parts, design[:, :1], curved=True)
    without, _ = _likelihood(parts, design[:, :2], curved=True)
    both, best = _likelihood(parts, design, curved=True)
    gain, lead = 2.0 * (both - alone), 2.0 * (alone - simple)
    curve = _described(best, means.size * step) if gain > _CURVE else ""
    return Slow(curve=curve, noise=lead > _NOISE, walk=2.0 * (alone - without) > _WALK, gain=gain, lead=lead)


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
def _library(cells: int) -> _Library:
    time = (np.arange(cells) + 0.5) / cells
    angles = 2.0 * np.pi * np.outer(time, _cycles(cells))
    warm = np.exp(-time[:, None] / _WARM_UPS)
    first = np.ascontiguousarray(_cosines(np.column_stack([warm, np.cos(angles)])).T)
    second = np.ascontiguousarray(_cosines(np.column_stack([np.zeros_like(warm), np.sin(angles)])).T)
    products = (np.square(first), first * second, np.square(second))
    return _Library(_cosines(time[:, None])[:, 0], first, second, products)


def _cycles(cells: int) -> _Array:
    slowest = np.arange(0.5, 8.0, 0.25)
    return np.concatenate([slowest, np.arange(8.0, cells / 4.0, 0.5)])


def _likelihood(parts: _Array, design: _Array, *, curved: bool) -> tuple[float, int]:
    """Return the largest log likelihood, up to a constant, and the curve that it has."""
    library = _library(parts.size + 1)
    levels = np.full(design.shape[1], float(np.square(parts).mean())) / design.mean(axis=0) / design.shape[1]
    found, best, before = -math.inf, 0, -1
    for _ in range(_ROUNDS):
        left, place = _without(parts, 1.0 / (design @ levels), library, curved=curved)
        squared = np.square(left)
        for _ in range(_STEPS):
            power = design @ levels
            levels = levels * ((squared / np.square(power)) @ design) / ((1.0 / power) @ design)
        power = design @ levels
        now = -0.5 * float((np.log(power) + squared / power).sum())
        settled = place == before and now - found < _SETTLED
        if now > found:
            found, best = now, place
        if settled:
            break
        before = place
    return found, best


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


def _described(best: int, duration: float) -> str:
    if best < _WARM_UPS.size:
        return f"a settling with a time constant near {roughly(_WARM_UPS[best] * duration)} s"
    return f"an oscillation with a period near {roughly(duration / float(_cycles(_CELLS)[best - _WARM_UPS.size]))} s"


def roughly(number: float) -> str:
    """Return a number to two digits, as a person would say it: 300, not 3e+02."""
    return f"{float(f'{number:.2g}'):g}"
