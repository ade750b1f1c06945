"""Overlapping Allan variances of a long record at octaves of the averaging time, in one pass over the data.

Sums over 2 m samples are sums over m, added in pairs, so that no running sum of the record is needed. Beyond an
averaging factor of STARTS the differences do not begin at each sample but at every m / STARTS-th: neighbours among them
hold nearly the same samples, and leaving them out costs less than 1 % of the degrees of freedom. What lies beside the
data in memory is a sixteenth of them.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["LONG", "STARTS", "compiled", "octaves"]

_Array: TypeAlias = NDArray[np.float64]

STARTS = 16
"""Differences that begin within one averaging time."""

LONG = 1 << 21
"""Samples from which not every difference is taken."""

_BLOCK = 1 << 15  # samples that are summed at once: these and their sums stay in the processor's cache
_FINE = 8  # octaves that are taken from the samples; the others from sums over 2^8 of them, which are a sixteenth
_Kernel: TypeAlias = Callable[[_Array, float, _Array, _Array], None]


@dataclass(slots=True)
class _Level:
    """Sums over one averaging factor.

    Attributes:
        lag: how many sums further the next one without a common sample is.
        thinned: whether the next octave takes every other sum only.
        kept: the last sums, which differ from sums that are still to come.
        first: number of the first of them.
        power: sum of the squared differences so far.
        count: how many these are.
    """

    lag: int
    thinned: bool
    kept: _Array = field(default_factory=lambda: np.empty(0))
    first: int = 0
    power: float = 0.0
    count: int = 0

    def take(self, sums: _Array) -> _Array:
        """Take the sums that follow; return those over twice the samples."""
        held = np.concatenate([self.kept, sums]) if self.kept.size else sums
        lag, number = self.lag, self.first
        if held.size <= lag:
            self.kept = held.copy()
            return np.empty(0)
        earlier, later = held[:-lag], held[lag:]
        difference: _Array = np.subtract(later, earlier)
        self.power += float(np.einsum("i,i->", difference, difference))
        self.count += difference.size
        self.kept = held[-lag:].copy()
        self.first = number + earlier.size
        if self.thinned:
            later, earlier, difference = later[number % 2 :: 2], earlier[number % 2 :: 2], difference[number % 2 :: 2]
        np.add(later, earlier, out=difference)
        return difference


def octaves(values: _Array, mean: float, count: int) -> tuple[_Array, list[_Array]]:
    """Return Allan variances at averaging factors 1, 2, 4 and so on, and consecutive averages for each of them.

    Model: SP1065 equation 11, summed over every start for m up to STARTS, and over STARTS starts in each m beyond.
    Averages are sums without the mean, all that the record holds, the first 2^14 where these are more.

    Args:
        values: evenly spaced, without holes, shape (n,), n at least LONG.
        mean: of the values.
        count: of averaging factors, at least 9; the last must be within half of the record.
    """
    coarse = np.empty((values.size - (1 << _FINE)) * STARTS // (1 << _FINE) + 1)
    powers = np.empty((2, count))
    _fine()(values, mean, coarse, powers[:, :_FINE])
    levels = [_Level(lag=STARTS, thinned=True) for _ in range(_FINE, count)]
    _through(coarse, levels)
    for place, level in enumerate(levels, start=_FINE):
        powers[:, place] = level.power, level.count
    factors = np.exp2(np.arange(count))
    return powers[0] / (2.0 * factors**2 * powers[1]), _averages(values, mean, coarse, count)


def _averages(values: _Array, mean: float, coarse: _Array, count: int) -> list[_Array]:
    most = 1 << 14
    found = []
    for octave in range(_FINE):
        m = 1 << octave
        part = values[: min(most, values.size // m) * m].reshape(-1, m)
        found.append(np.add.reduce(part, axis=1) - m * mean)
    sums = coarse[::STARTS]
    for _ in range(_FINE, count):
        found.append(sums[:most].copy())
        sums = sums[: sums.size // 2 * 2 : 2] + sums[1::2]
    return found


def _through(sums: _Array, levels: list[_Level]) -> _Array:
    """Give sums to the levels in blocks."""
    for begin in range(0, sums.size, _BLOCK):
        part = sums[begin : begin + _BLOCK]
        for level in levels:
            part = level.take(part)
    return part


def _plain(values: _Array, mean: float, coarse: _Array, powers: _Array) -> None:
    """Fill in the squared differences of the first octaves and their number, and the sums for those that follow."""
    levels = [_Level(lag=min(1 << octave, STARTS), thinned=1 << octave >= STARTS) for octave in range(_FINE)]
    filled = 0
    for begin in range(0, values.size, _BLOCK):
        part = np.subtract(values[begin : begin + _BLOCK], mean)
        for level in levels:
            part = level.take(part)
        part = part[: coarse.size - filled]
        coarse[filled : filled + part.size] = part
        filled += part.size
    for octave, level in enumerate(levels):
        powers[:, octave] = level.power, level.count


@cache
def _fine() -> _Kernel:
    return compiled() or _plain


@cache
def compiled() -> _Kernel | None:
    """Return what does the first octaves where `hil[fast]` is installed and its compiler works, else None."""
    try:
        numba = importlib.import_module("numba")
        options = {"nogil": True, "fastmath": {"reassoc", "contract"}}
        try:
            kernel: _Kernel = numba.njit(cache=True, **options)(_looped)
            kernel(np.arange(1024.0), 0.0, np.empty(49), np.empty((2, _FINE)))
        except RuntimeError:  # no folder for what was compiled
            kernel = numba.njit(**options)(_looped)
            kernel(np.arange(1024.0), 0.0, np.empty(49), np.empty((2, _FINE)))
    except Exception:  # noqa: BLE001 - whatever a compiler may find wrong, the plain way works
        return None
    return kernel


def _looped(values: _Array, mean: float, coarse: _Array, powers: _Array) -> None:
    """Do what `_plain` does, in loops that a compiler makes fast; each row of `held` are the sums of one octave."""
    block, octaves = 4096, powers.shape[1]
    held = np.empty((octaves, block + 64))
    sizes = np.zeros(octaves + 1, dtype=np.int64)
    firsts = np.zeros(octaves, dtype=np.int64)
    powers[:] = 0.0
    filled = 0
    for begin in range(0, values.size, block):
        samples = values[begin : begin + block]  # slices throughout: an index that is computed may be negative
        row = held[0, sizes[0] : sizes[0] + samples.size]
        for place in range(samples.size):
            row[place] = samples[place] - mean
        sizes[0] += samples.size
        for octave in range(octaves):
            lag, size = min(1 << octave, 16), sizes[octave]
            if size <= lag:
                break
            pairs = size - lag
            earlier, later = held[octave, :pairs], held[octave, lag:size]
            power = 0.0
            for place in range(pairs):
                difference = later[place] - earlier[place]
                power += difference * difference
            powers[0, octave] += power
            powers[1, octave] += pairs
            stride = 1 if lag < 16 else 2
            start = firsts[octave] % stride
            count = (pairs - start + stride - 1) // stride
            if octave + 1 < octaves:
                target = held[octave + 1, sizes[octave + 1] : sizes[octave + 1] + count]
                sizes[octave + 1] += count
            else:
                target = coarse[filled : filled + count]
                filled += count
            if stride == 1:
                for place in range(count):
                    target[place] = later[place] + earlier[place]
            else:
                early, late = earlier[start::2], later[start::2]
                for place in range(target.size):
                    target[place] = late[place] + early[place]
            held[octave, :lag] = held[octave, pairs:size]
            sizes[octave] = lag
            firsts[octave] += pairs
