"""Overlapping Allan variances of a long record at octaves of the averaging time, in one pass over the data.

Sums over 2 m samples are pairwise sums over m, so that no running sum of the record is needed. Beyond an averaging
factor of STARTS the differences begin not at every sample but at every m / STARTS-th: neighbouring differences share
nearly all their samples, and omitting them costs less than 1 % of the degrees of freedom. Working memory is a sixteenth
of the data.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["LONG", "STARTS", "compiled", "octaves"]

_Array: TypeAlias = NDArray[np.float64]

STARTS = 16
"""Number of differences that begin within one averaging time."""

LONG = 1 << 21
"""Record length in samples from which not every difference is taken."""

_BLOCK = 1 << 15  # samples summed at once: these and their sums fit into the processor's cache
_FINE = 8  # octaves computed from the samples; the others from sums over 2^8 of them, a sixteenth of the data
_Kernel: TypeAlias = Callable[[_Array, float, _Array, _Array], None]


class _Level:
    """Sums over one averaging factor, buffered with room for a block and for the last sums of the previous one.

    Attributes:
        power: sum of the squared differences so far.
        count: number of differences.
    """

    def __init__(self, octave: int, *, room: int) -> None:
        """Take the octave of the averaging factor, and the number of sums that arrive at once."""
        self._lag, self._thinned = min(1 << octave, STARTS), 1 << octave >= STARTS
        self._row = np.empty(room + self._lag)
        self._size = 0
        self._first = 0
        self.power = 0.0
        self.count = 0

    def room(self, count: int) -> _Array:
        """Return the buffer for the next `count` sums, to be filled in."""
        self._size += count
        return self._row[self._size - count : self._size]

    def pairs(self) -> int:
        """Return the number of sums over twice the samples that can be formed."""
        found = max(0, self._size - self._lag)
        return (found + 1 - self._first % 2) // 2 if self._thinned else found

    def pair(self, scratch: _Array, target: _Array) -> None:
        """Accumulate squared differences, write the sums over twice the samples to `target`, and keep the last sums."""
        lag, size = self._lag, self._size
        count = size - lag
        if count <= 0:
            return
        earlier, later, difference = self._row[:count], self._row[lag:size], scratch[:count]
        np.subtract(later, earlier, out=difference)
        self.power += float(np.einsum("i,i->", difference, difference))
        self.count += count
        if self._thinned:
            later, earlier = later[self._first % 2 :: 2], earlier[self._first % 2 :: 2]
        np.add(later[: target.size], earlier[: target.size], out=target)
        self._row[:lag] = self._row[count:size]
        self._first += count
        self._size = lag


def _levels(first: int, end: int) -> list[_Level]:
    """Return levels for octaves from `first` up to, not including, `end`."""
    levels, room = [], _BLOCK
    for octave in range(first, end):
        levels.append(_Level(octave, room=room))
        if 1 << octave >= STARTS:
            room = room // 2 + 1
    return levels


def _climb(levels: list[_Level], scratch: _Array, top: _Array) -> int:
    """Process the levels from first to last, whose paired sums go to `top`; return the number of those."""
    for level, above in pairwise(levels):
        level.pair(scratch, above.room(level.pairs()))
    count = min(top.size, levels[-1].pairs())
    levels[-1].pair(scratch, top[:count])
    return count


def octaves(values: _Array, mean: float, count: int) -> tuple[_Array, list[_Array]]:
    """Return Allan variances at averaging factors 1, 2, 4 and so on, and consecutive averages for each of them.

    Model: SP1065 equation 11, summed over every start for m up to STARTS, and over STARTS starts in each m beyond.
    Averages are mean-free sums, at most the first 2^14.

    Args:
        values: evenly spaced, without holes, shape (n,), n at least LONG.
        mean: mean of the values.
        count: number of averaging factors, at least 9; the last must be within half of the record.
    """
    coarse = np.empty((values.size - (1 << _FINE)) * STARTS // (1 << _FINE) + 1)
    powers = np.empty((2, count))
    _fine()(values, mean, coarse, powers[:, :_FINE])
    levels = _levels(_FINE, count)
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


def _through(sums: _Array, levels: list[_Level]) -> None:
    """Feed sums to the levels in blocks."""
    scratch, beyond = np.empty(_BLOCK), np.empty(_BLOCK)
    for begin in range(0, sums.size, _BLOCK):
        part = sums[begin : begin + _BLOCK]
        levels[0].room(part.size)[:] = part
        _climb(levels, scratch, beyond)


def _plain(values: _Array, mean: float, coarse: _Array, powers: _Array) -> None:
    """Fill in the squared differences of the first octaves and their number, and the sums for the later octaves."""
    levels = _levels(0, _FINE)
    scratch, filled = np.empty(_BLOCK), 0
    for begin in range(0, values.size, _BLOCK):
        part = values[begin : begin + _BLOCK]
        np.subtract(part, mean, out=levels[0].room(part.size))
        filled += _climb(levels, scratch, coarse[filled:])
    for octave, level in enumerate(levels):
        powers[:, octave] = level.power, level.count


@cache
def _fine() -> _Kernel:
    return compiled() or _plain


@cache
def compiled() -> _Kernel | None:
    """Return the compiled kernel of the first octaves if `hil[fast]` is installed and its compiler works, else None."""
    try:
        numba = importlib.import_module("numba")
        options = {"nogil": True, "fastmath": {"reassoc", "contract"}}
        try:
            kernel: _Kernel = numba.njit(cache=True, **options)(_looped)
            kernel(np.arange(1024.0), 0.0, np.empty(49), np.empty((2, _FINE)))
        except RuntimeError:  # no cache folder
            kernel = numba.njit(**options)(_looped)
            kernel(np.arange(1024.0), 0.0, np.empty(49), np.empty((2, _FINE)))
    except Exception:  # noqa: BLE001 - whatever fails in the compiler, the plain version works
        return None
    return kernel


def _looped(values: _Array, mean: float, coarse: _Array, powers: _Array) -> None:
    """Loop version of `_plain` for the compiler; each row of `held` is the sums of one octave."""
    block, octaves = 8192, powers.shape[1]
    held = np.empty((octaves, block + 64))
    sizes = np.zeros(octaves + 1, dtype=np.int64)
    firsts = np.zeros(octaves, dtype=np.int64)
    powers[:] = 0.0
    filled = 0
    for begin in range(0, values.size, block):
        samples = values[begin : begin + block]  # slices throughout: a computed index may be negative
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
                    before, after = earlier[place], later[place]
                    power += (after - before) ** 2
                    target[place] = after + before
            else:
                for place in range(pairs):
                    power += (later[place] - earlier[place]) ** 2
                early, late = earlier[start::2], later[start::2]
                for place in range(target.size):
                    target[place] = late[place] + early[place]
            powers[0, octave] += power
            powers[1, octave] += pairs
            held[octave, :lag] = held[octave, pairs:size]
            sizes[octave] = lag
            firsts[octave] += pairs
