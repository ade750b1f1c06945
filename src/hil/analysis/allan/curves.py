"""Whether slow noise of a record is noise, or a curve that is no noise: a warm-up or a slow sine.

Averages over the cells of a record are taken apart into cosines (DCT-II), which are nearly independent under white
noise, flicker and random walk; their variances are those of the spectrum at k / 2T. Models are compared by the
likelihood of Whittle (1953), with a straight line in all of them: noise alone, white noise with a curve, and all noises
with a curve. Curves are exponentials and sines; the one that explains most stands for its kind.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Slow", "slow"]

_Array: TypeAlias = NDArray[np.float64]

_CELLS = 512
_FEWEST = 32  # cells in which a curve can be told from noise
_WARM_UPS = np.geomspace(1.0 / 60.0, 1.0, 12)  # time constants, of the record
_ROUNDS = 5  # of choosing a curve and fitting the noise that is left
_STEPS = 40  # of fitting noise
_CURVE = 30.0  # by which twice the log likelihood grows with a curve; of 480 records of noise alone none reached it
_NOISE = 3.0  # by which slow noise must be more likely than white noise with a curve, which leads by 7 and more


@dataclass(frozen=True, slots=True, kw_only=True)
class Slow:
    """What the slow part of a record is.

    Attributes:
        curve: description of a curve that the record holds, empty if it shows none.
        noise: whether slow noise is more likely than white noise with a curve.
        gain: twice the log likelihood that the curve adds to all noises.
        lead: that of slow noise over white noise with a curve.
    """

    curve: str
    noise: bool
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
    alone, _ = _likelihood(parts, design, None)
    simple, _ = _likelihood(parts, design[:, :1], _library(means.size))
    both, best = _likelihood(parts, design, _library(means.size))
    gain, lead = 2.0 * (both - alone), 2.0 * (alone - simple)
    curve = _described(best, means.size * step) if gain > _CURVE else ""
    return Slow(curve=curve, noise=lead > _NOISE, gain=gain, lead=lead)


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


@lru_cache(maxsize=4)
def _library(cells: int) -> tuple[_Array, _Array]:
    """Return the cosines of the line, (k, 1), and of each curve, (curves, k, 2); a warm-up has one column of zeros."""
    time = (np.arange(cells) + 0.5) / cells
    warm = [np.column_stack([np.exp(-time / each), np.zeros(cells)]) for each in _WARM_UPS.tolist()]
    sines = [np.column_stack([np.cos(each * time), np.sin(each * time)]) for each in 2.0 * np.pi * _cycles(cells)]
    return _cosines(time[:, None]), np.stack([_cosines(each) for each in (*warm, *sines)])


def _cycles(cells: int) -> _Array:
    slowest = np.arange(0.5, 8.0, 0.25)
    return np.concatenate([slowest, np.arange(8.0, cells / 4.0, 0.5)])


def _likelihood(parts: _Array, design: _Array, library: tuple[_Array, _Array] | None) -> tuple[float, int]:
    """Return the largest log likelihood, up to a constant, and the curve that it has."""
    trend, curves = library or (_library(parts.size + 1)[0], None)
    levels = np.full(design.shape[1], float(np.square(parts).mean())) / design.mean(axis=0) / design.shape[1]
    found, best = -math.inf, 0
    for _ in range(_ROUNDS):
        weight = 1.0 / np.sqrt(design @ levels)
        left, place = _without(parts, weight, trend, curves)
        for _ in range(_STEPS):
            power = design @ levels
            levels = levels * ((np.square(left / power) @ design) / ((1.0 / power) @ design))
        power = design @ levels
        now = -0.5 * float((np.log(power) + np.square(left) / power).sum())
        if now > found:
            found, best = now, place
    return found, best


def _without(parts: _Array, weight: _Array, trend: _Array, curves: _Array | None) -> tuple[_Array, int]:
    """Take off the line, and the curve that explains most, by weighted least squares."""
    line = trend[:, 0] * weight
    line /= np.linalg.norm(line)
    white = parts * weight
    white = white - line * float(line @ white)
    if curves is None:
        return white / weight, 0
    first, second = curves[:, :, 0] * weight, curves[:, :, 1] * weight
    first -= np.outer(first @ line, line)
    second -= np.outer(second @ line, line)
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-12)
    second -= np.einsum("ck,ck->c", first, second)[:, None] * first
    second /= np.maximum(np.linalg.norm(second, axis=1, keepdims=True), 1e-12)
    along = np.column_stack([first @ white, second @ white])
    best = int(np.square(along).sum(axis=1).argmax())
    return (white - along[best, 0] * first[best] - along[best, 1] * second[best]) / weight, best


def _described(best: int, duration: float) -> str:
    if best < _WARM_UPS.size:
        return f"a settling with a time constant near {_WARM_UPS[best] * duration:.2g} s"
    return f"an oscillation with a period near {duration / float(_cycles(_CELLS)[best - _WARM_UPS.size]):.2g} s"
