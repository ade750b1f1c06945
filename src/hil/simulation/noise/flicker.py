"""Flicker noise: a sum of autoregressive processes, one per octave."""

from __future__ import annotations

from math import log, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from hil.simulation.noise.autoregression import autoregressive
from hil.simulation.seeds import Stream
from hil.wire.checkpoint import Kept, Stateful

__all__ = ["Flicker"]

_COEFFICIENT = 0.5
_INNOVATION = sqrt(1 - _COEFFICIENT**2)
_SLOW_OCTAVES = 10

# The fastest octave and white noise of variance 2 together are one process: y[k] = y[k-1]/2 + c (w[k] - d w[k-1]).
# Both sides of c^2 |1 - d z|^2 = 3/4 + 2 |1 - z/2|^2 agree for c^2 d = 1 and c^2 (1 + d^2) = 13/4.
_DELAYED = (13 / 4 - sqrt((13 / 4) ** 2 - 4)) / 2
_PRESENT = 1 / sqrt(_DELAYED)


class Flicker(Stateful):
    """Flicker noise of level B, two-sided power density S(f) = B^2/(2 pi f) (IEEE Std 952-1997, annex C).

    Octave j holds every value of a first-order autoregression (coefficient 1/2) for 2^j samples. All octaves have the
    variance v. The Allan variance of a process, integrated over ln tau, is 2 ln 2 times its variance whatever its
    spectrum is (from IEEE Std 952-1997, annex C, and the integral of sin^4 u/u^3 from 0 to infinity, ln 2), so the sum
    over all octaves is flat at 2 v; the floor 2 ln 2/pi B^2 of flicker noise asks for v = B^2 ln 2/pi. Octaves faster
    than a sample are white noise of variance 2 v, chosen so that the deviation stays within 5 % of its floor 0.664 B
    from two samples on. At one sample it is 22 % above, where flicker noise cut off at half the rate is 9 % above. The
    sum of processes of many time constants is the classical model of 1/f noise (van der Ziel, Physica 16 (1950) 359).

    Ten octaves go on above the block: with 2^14 samples of a block the slowest holds its value for 2^23 samples, and
    the floor is flat up to about 2^21 of them, 5.8 h at 100 Hz. All octaves begin in their stationary state.

    Args:
        stream: random numbers.
        level: B, in the unit of the rate.
        block: samples of a block, a power of two.
    """

    _last: Kept[list[float]]
    _driver: Kept[float]

    def __init__(self, stream: Stream, level: float, block: int) -> None:
        self._stream = stream
        self._sigma = level * sqrt(log(2) / pi)
        self._sizes = [block >> octave for octave in range(block.bit_length() - 1)]
        self._last = [0.0] * (len(self._sizes) + _SLOW_OCTAVES)
        self._driver = 0.0

    def block(self, number: int) -> NDArray[np.float64]:
        """Return the samples of block `number`, shape (block,); blocks are taken in their order from 0 on."""
        if not self._sigma:
            return np.zeros(self._sizes[0])
        end = sum(self._sizes)
        drivers = self._stream.normal_block(number, end + _SLOW_OCTAVES)
        held = np.array([self._slow(number, drivers[end:])])
        for octave in reversed(range(len(self._sizes))):
            size = self._sizes[octave]
            held = np.repeat(held, size // held.size)
            held += self._octave(number, octave, drivers[end - size : end])
            end -= size
        held *= self._sigma
        return held

    def _octave(self, number: int, octave: int, drivers: NDArray[np.float64]) -> NDArray[np.float64]:
        if octave == 0:
            coming = _PRESENT * drivers
            coming[1:] -= _PRESENT * _DELAYED * drivers[:-1]
            coming[0] -= _PRESENT * _DELAYED * self._driver
            self._driver = float(drivers[-1])
        else:
            coming = _INNOVATION * drivers
            coming[0] = drivers[0] if number == 0 else coming[0]
        values = autoregressive(coming, _COEFFICIENT, self._last[octave])
        self._last[octave] = float(values[-1])
        return values

    def _slow(self, number: int, drivers: NDArray[np.float64]) -> float:
        """Return the sum of the octaves that hold their value for a block or longer."""
        total = 0.0
        for octave, driver in enumerate(drivers.tolist()):
            place = len(self._sizes) + octave
            if number == 0:
                self._last[place] = driver
            elif number % (1 << octave) == 0:
                self._last[place] = _COEFFICIENT * self._last[place] + _INNOVATION * driver
            total += self._last[place]
        return total
