"""Variances of the Allan family at one averaging factor, in blocks that stay in the processor's cache.

The phase is the running sum of the rate in samples: phase[k] = y[0] + ... + y[k-1], shape (n + 1,). Variances are in
the square of the rate's unit. Equation numbers are those of W. J. Riley, "Handbook of Frequency Stability Analysis",
NIST Special Publication 1065, 2008 (SP1065). No function needs more memory than some blocks.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["MOST_MISSING", "hadamard", "modified", "overlapping", "overlapping_with_holes", "total"]

_Array: TypeAlias = NDArray[np.float64]

MOST_MISSING = 0.05
"""Share of an average's samples that may be missing; it raises the deviation of white noise by 2.6 % at most."""

_BLOCK = 1 << 15


def overlapping(phase: _Array, m: int) -> tuple[float, int]:
    """Return the overlapping Allan variance and its number of terms, SP1065 equation 11."""
    terms = phase.size - 2 * m
    squares = [_power(_second(phase, m, first, last)) for first, last in _blocks(0, terms)]
    return math.fsum(squares) / (2.0 * m * m * terms), terms


def overlapping_with_holes(phase: _Array, m: int, holes: NDArray[np.int64]) -> tuple[float, int]:
    """Return the overlapping Allan variance of a record in which samples are missing, and its number of terms.

    An average is taken over the samples that are there. Terms with an average that misses more than MOST_MISSING of its
    samples are left out; no phase is carried over them, because what the rate did in a hole is not known. Without any
    term the variance is NaN.

    Args:
        phase: the running sum, in which a missing sample counts as zero.
        m: averaging factor.
        holes: places of the missing samples, counted from 0, rising.
    """
    squares, terms = [0.0], 0
    for first, last in _blocks(0, phase.size - 2 * m):
        edges = [_missing_before(holes, first + shift, last + shift) for shift in (0, m, 2 * m)]
        missing = [edges[1] - edges[0], edges[2] - edges[1]]
        kept = np.flatnonzero(np.maximum(*missing) <= MOST_MISSING * m)
        at = [phase[first + shift : last + shift][kept] for shift in (0, m, 2 * m)]
        earlier, later = ((at[k + 1] - at[k]) / (m - missing[k][kept]) for k in (0, 1))
        squares.append(_power(later - earlier))
        terms += kept.size
    return (math.fsum(squares) / (2.0 * terms) if terms else math.nan), terms


def modified(phase: _Array, m: int) -> tuple[float, int]:
    """Return the modified Allan variance and its number of terms, SP1065 equation 14.

    The inner sum over m second differences moves by one term for each start: it is carried as a running sum of third
    differences, which keeps the digits that a double running sum of the phase would lose in long records.
    """
    terms = phase.size - 3 * m
    inner = math.fsum(float(_second(phase, m, first, last).sum()) for first, last in _blocks(0, m))
    squares = [inner * inner]
    for first, last in _blocks(0, terms):
        steps = _third(phase, m, first, last)
        np.cumsum(steps, out=steps)
        steps += inner
        squares.append(_power(steps))
        inner = float(steps[-1])
    return math.fsum(squares) / (2.0 * float(m) ** 4 * (terms + 1)), terms + 1


def hadamard(phase: _Array, m: int) -> tuple[float, int]:
    """Return the overlapping Hadamard variance and its number of terms, SP1065 equation 18."""
    terms = phase.size - 3 * m
    squares = [_power(_third(phase, m, first, last)) for first, last in _blocks(0, terms)]
    return math.fsum(squares) / (6.0 * m * m * terms), terms


def total(phase: _Array, m: int) -> tuple[float, int]:
    """Return the total variance and its number of terms, SP1065 equation 25.

    The phase is continued beyond both ends by reflection about its end points; the continuation is never stored. Red
    noise biases it low, see `confidence.total_bias`.
    """
    last = phase.size - 1
    squares = []
    for first, end in _blocks(1, last):
        difference = _reflected(phase, first - m, end - m)
        difference += _reflected(phase, first + m, end + m)
        difference -= 2.0 * phase[first:end]
        squares.append(_power(difference))
    return math.fsum(squares) / (2.0 * m * m * (last - 1)), last - 1


def _blocks(first: int, end: int) -> Iterator[tuple[int, int]]:
    for begin in range(first, end, _BLOCK):
        yield begin, min(begin + _BLOCK, end)


def _missing_before(holes: NDArray[np.int64], first: int, last: int) -> NDArray[np.int64]:
    """Count the holes before each place from `first` to below `last`."""
    before, end = np.searchsorted(holes, (first, last - 1))
    return np.asarray(before + np.cumsum(np.bincount(holes[before:end] - first + 1, minlength=last - first)))


def _power(values: _Array) -> float:
    return float(np.einsum("i,i->", values, values))  # not BLAS: the same on any number of cores


def _second(phase: _Array, m: int, first: int, last: int) -> _Array:
    if 8 * m <= _BLOCK:  # one pass over the block less, for m differences more
        steps = np.subtract(phase[first + m : last + 2 * m], phase[first : last + m])
        return np.subtract(steps[m:], steps[:-m])
    difference = np.subtract(phase[first + 2 * m : last + 2 * m], phase[first + m : last + m])
    difference -= phase[first + m : last + m]
    difference += phase[first:last]
    return difference


def _third(phase: _Array, m: int, first: int, last: int) -> _Array:
    middle = np.subtract(phase[first + 2 * m : last + 2 * m], phase[first + m : last + m])
    middle *= 3.0
    difference = np.subtract(phase[first + 3 * m : last + 3 * m], phase[first:last])
    difference -= middle
    return difference


def _reflected(phase: _Array, first: int, end: int) -> _Array:
    """Return a part of the continued phase as a new array; places below 0 and beyond the last are reflections."""
    last = phase.size - 1
    below = max(0, min(end, 0) - first)
    beyond = max(0, end - max(first, last + 1))
    result = np.empty(end - first)
    result[:below] = 2.0 * phase[0] - phase[-first - below + 1 : -first + 1][::-1]
    result[below : result.size - beyond] = phase[max(first, 0) : max(0, min(end, last + 1))]
    mirror = 2 * last - end + 1
    result[result.size - beyond :] = 2.0 * phase[last] - phase[mirror : mirror + beyond][::-1]
    return result
