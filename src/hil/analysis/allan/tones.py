"""Lines in a record at rest: vibration, mains or a clock, whose Allan variance can look like that of noise.

A sine at a third of the rate has the same part in it at every octave but for 1 / tau^2, as quantisation has; others
raise or lower white noise. The spectrum shows them.
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

_FIRST = 8  # bin that is looked at first: below, a line cannot be told from slow noise
_REACH, _LOBE = 8, 2  # bins on either side that the noise is taken from, and that a line reaches
_BY_CHANCE = 1e-6  # probability of one line or more in a spectrum of noise


@dataclass(frozen=True, slots=True, kw_only=True)
class Tone:
    """A line.

    Attributes:
        frequency: in Hz, to a tenth of a bin of the spectrum.
        square: of its amplitude.
    """

    frequency: float
    square: float

    def variances(self, m: NDArray[np.int64], rate: float) -> _Array:
        """Return its Allan variance at averaging factors: A^2 sin^4(pi m f) / (m sin(pi f))^2, f over the rate.

        Args:
            m: averaging factors.
            rate: samples per second.
        """
        angle = math.pi * self.frequency / rate
        return np.asarray(self.square * np.sin(m * angle) ** 4 / np.square(m * math.sin(angle)), dtype=np.float64)


def tones(values: _Array, rate: float) -> tuple[Tone, ...]:
    """Return the lines of a record at rest; none if it is too short.

    Args:
        values: evenly spaced rate, shape (n,); NaN marks a missing sample.
        rate: samples per second.
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
            continue  # the side of another
        where = float(own @ np.arange(near.start, near.start + own.size)) / float(own.sum())
        found.append(Tone(frequency=where * step, square=4.0 * float(own.sum()) * step))
        left[near] = 0.0
    return tuple(found)
