"""White noise behind the low-pass filter of a sensor."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from hil.simulation.noise.autoregression import autoregressive
from hil.simulation.seeds import Stream
from hil.wire.checkpoint import Kept, Stateful

__all__ = ["White"]


class White(Stateful):
    """White noise N, two-sided power density S(f) = N^2 (IEEE Std 952-1997, annex C), filtered, then sampled.

    A filter with the noise bandwidth BW lets the variance 2 N^2 BW through, whatever the sample rate fs is. A density
    that a datasheet gives is one-sided: sqrt(2) N.

    Wider than fs/2, everything folds into the band: samples are independent, and an Allan analysis of them finds
    N sqrt(2 BW/fs). Narrower, samples are a first-order autoregression of that variance, whose coefficient
    (r - 1)/(r + 1) with r = fs/(2 BW) keeps N at low frequencies. A bandwidth of fs/2 gives the textbook's N sqrt(fs).

    Args:
        stream: random numbers.
        level: N, in the unit of the rate per sqrt(Hz).
        rate: samples per second.
        bandwidth: noise bandwidth of the filter in Hz.
        block: samples of a block.
    """

    _last: Kept[float]

    def __init__(self, stream: Stream, level: float, *, rate: float, bandwidth: float, block: int) -> None:
        ratio = max(1.0, rate / (2 * bandwidth))
        self._stream = stream
        self._sigma = level * sqrt(2 * bandwidth)
        self._coefficient = (ratio - 1) / (ratio + 1)
        self._block = block
        self._last = 0.0

    def block(self, number: int) -> NDArray[np.float64]:
        """Return the samples of block `number`, shape (block,); blocks are taken in their order from 0 on."""
        if not self._sigma:
            return np.zeros(self._block)
        drivers = self._stream.normal_block(number, self._block)
        drivers *= self._sigma
        if not self._coefficient:
            return drivers
        start = drivers[0]
        drivers *= sqrt(1 - self._coefficient**2)
        if number == 0:
            drivers[0] = start
        values = autoregressive(drivers, self._coefficient, self._last)
        self._last = float(values[-1])
        return values
