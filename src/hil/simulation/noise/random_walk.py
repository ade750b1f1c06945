"""Random walk: the sum of white noise."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from hil.simulation.seeds import Stream
from hil.wire.checkpoint import Kept, Stateful

__all__ = ["RandomWalk"]


class RandomWalk(Stateful):
    """Random walk of the rate, two-sided power density S(f) = (K/(2 pi f))^2 (IEEE Std 952-1997, annex C).

    A sample adds K/sqrt(fs) times a standard normal number. The Allan variance of the samples is
    K^2 (2 m^2 + 1)/(6 m fs), which tends to K^2 tau/3. It begins at zero.

    Args:
        stream: random numbers.
        level: K, in the unit of the rate times sqrt(Hz).
        rate: samples per second.
        block: samples of a block.
    """

    _last: Kept[float]

    def __init__(self, stream: Stream, level: float, rate: float, block: int) -> None:
        self._stream = stream
        self._step = level / sqrt(rate)
        self._block = block
        self._last = 0.0

    def block(self, number: int) -> NDArray[np.float64]:
        """Return the samples of block `number`, shape (block,); blocks are taken in their order from 0 on."""
        if not self._step:
            return np.zeros(self._block)
        steps = self._stream.normal_block(number, self._block)
        steps *= self._step
        steps[0] += self._last
        values = np.cumsum(steps)
        self._last = float(values[-1])
        return values
