"""Quantisation noise of an angle, seen in the rate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hil.simulation.seeds import Stream
from hil.wire.checkpoint import Kept, Stateful

__all__ = ["AngleQuantisation"]


class AngleQuantisation(Stateful):
    """The error of a quantised angle, differenced: sigma^2 = 3 Q^2/tau^2 (IEEE Std 952-1997, annex C).

    A sample of the rate adds fs (e[k] - e[k-1]), where the errors e are independent and of variance Q^2. Quantisation
    of the rate itself is another thing, which whoever rounds the samples does.

    Args:
        stream: random numbers.
        level: Q, in the unit of the angle.
        rate: samples per second.
        block: samples of a block.
    """

    _last: Kept[float]

    def __init__(self, stream: Stream, level: float, rate: float, block: int) -> None:
        self._stream = stream
        self._scale = level * rate
        self._block = block
        self._last = 0.0

    def block(self, number: int) -> NDArray[np.float64]:
        """Return the samples of block `number`, shape (block,); blocks are taken in their order from 0 on."""
        if not self._scale:
            return np.zeros(self._block)
        errors = self._scale * self._stream.normal_block(number, self._block)
        before, self._last = self._last, float(errors[-1])
        return np.diff(errors, prepend=before)
