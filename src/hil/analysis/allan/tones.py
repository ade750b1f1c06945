"""Spectral lines in a record at rest, such as vibration, mains or a clock, whose Allan variance can mimic noise.

A sine at a third of the rate contributes to every octave as 1 / tau^2, as quantisation does; others raise or lower
white noise. The spectrum shows them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hil.analysis.allan.rolloff import NEIGHBOURS, parts, periodogram

__all__ = ["Tone", "tones"]

_Array: TypeAlias = NDArray[np.float64]

_FIRST = 8  # first bin searched: below it a line cannot be distinguished from slow noise
_REACH, _LOBE = 8, 2  # bins on either side for the noise floor, and for the width of a line
_BY_CHANCE = 1e-6  # probability of any line in a spectrum of noise


@dataclass(frozen=True, slots=True, kw_only=True)
class Tone:
    """A spectral line.

    Attributes:
        frequency: in Hz, to a tenth of a bin of the spectrum.
        square: squared amplitude, in the square of the rate's unit.
    """

    frequency: float
    square: float

    def variances(self, m: NDArray[np.int64], rate: float) -> _Array:
        """Return its Allan variance, shape (k,): A^2 sin^4(pi m f) / (m sin(pi f))^2, f relative to the rate.

        Args:
            m: averaging factors in samples, shape (k,).
            rate: sampling rate [Hz].
        """
        angle = math.pi * self.frequency / rate
        return np.asarray(self.square * np.sin(m * angle) ** 4 / np.square(m * math.sin(angle)), dtype=np.float64)


def tones(values: _Array, rate: float) -> tuple[Tone, ...]:
    """Return the spectral lines of a record at rest; none if it is too short.

    Args:
        values: evenly spaced rate, shape (n,); NaN marks a missing sample.
        rate: sampling rate [Hz].
    """
    from scipy.special import gammaincc  # noqa: PLC0415 - scipy is slow to import

    looked = parts(values)
    if not looked.size:
        return ()
    power = periodogram(looked, rate)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(power, _REACH, mode="reflect"), 2 * _REACH + 1)
    floor = np.median(around, axis=1)
    if not (floor > 0.0).all():
        return ()
    half = max(1.0, len(looked) / NEIGHBOURS)
    chance = np.asarray(gammaincc(half, half * power / floor))
    chance[:_FIRST] = 1.0
    found, left = [], power - floor
    step = rate / looked.shape[1]
    for peak in np.argsort(chance, kind="stable").tolist():
        if chance[peak] * power.size > _BY_CHANCE:
            break
        near = slice(max(0, peak - _LOBE), peak + _LOBE + 1)
        own = np.maximum(left[near], 0.0)
        if left[peak] < own.max() or not own.any():
            continue  # a skirt of another line
        where = float(own @ np.arange(near.start, near.start + own.size)) / float(own.sum())
        found.append(Tone(frequency=where * step, square=4.0 * float(own.sum()) * step))
        left[near] = 0.0
    return tuple(found)
