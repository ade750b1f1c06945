"""Whether a sensor still measures: noise moves the last bits of one that does."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hil.instruments.sensors.scale import Scale
from hil.model.errors import NoReply

__all__ = ["Stillness"]

_MOST_EQUAL = 16
# Noise in counts rms below which equal samples mean nothing. With 0.4 of a typical article's noise an article has 0.4
# counts: all three axes equal the last ones with a probability below 0.27, sixteen in a row once in 3e8 samples.
_LEAST_NOISE = 1.0
_QUIET = 0.4
_SELDOM = 1e-9  # of all runs that begin
_LONGEST_RUN = 1000


class Stillness:
    """Counts samples that are equal to the last one.

    Where the range is so wide that the noise stays below one count, equal samples mean nothing, unless more of them are
    waited for, see `patience`. Samples without a number on any axis are not counted, see `Scale.rails`.

    Args:
        device: the sensor's name, for messages.
        scale: of the axes.
        noise: expected noise in counts rms.
        patience: over how many samples the noise is one and the same, at least 1: then equal samples of a sensor whose
            noise is below one count are told, too, after as many as a quiet article gives once in 1e9 times.
    """

    def __init__(self, device: str, scale: Scale, noise: float = math.inf, patience: float = 0.0) -> None:
        self._device = device
        self._scale = scale
        self._most = _MOST_EQUAL if noise >= _LEAST_NOISE else _long_run(noise, patience)
        self._newest: list[int] | None = None
        self._run = 0

    def judge(self, counts: Sequence[int]) -> None:
        """Take one sample of all axes.

        Raises:
            NoReply: too many samples in a row were equal, sixteen usually, this one included.
        """
        if self._most:
            self._count(list(counts), 1, whole=True)

    def judge_many(self, counts: NDArray[np.int16]) -> None:
        """Take samples in their order, shape (n, axes).

        Raises:
            NoReply: sixteen samples in a row were equal, the newest one included.
        """
        if not self._most or not len(counts):
            return
        different = np.flatnonzero((counts != counts[-1]).any(axis=1))
        equal = len(counts) - 1 - int(different[-1]) if len(different) else len(counts)
        self._count(counts[-1].tolist(), equal, whole=equal == len(counts))

    def _count(self, newest: list[int], equal: int, *, whole: bool) -> None:
        """Note how many of the samples that came are equal to the newest; `whole` are all of them."""
        self._run = self._run + equal if whole and newest == self._newest else equal
        self._newest = newest
        if self._run >= self._most and any(self._scale.usable(axis) for axis in newest):
            raise NoReply(
                self._device,
                f"{self._run} consecutive samples are equal, the sensor is stuck",
                "switch the sensor off and on, and start it again",
            )


def _long_run(noise: float, patience: float) -> int:
    """Return after how many equal samples a quiet article with this noise is stuck; 0 where no number would tell."""
    if patience < 1.0 or noise <= 0.0:
        return 0
    # An article in the middle of a count, which is where it moves least.
    same = math.erf(0.5 / (_QUIET * noise * math.sqrt(2.0)))
    equal = (same**2 + (1.0 - same) ** 2 / 2.0) ** 3
    run = math.log(_SELDOM) / math.log(equal) * patience if equal < 1.0 else math.inf
    return max(_MOST_EQUAL, math.ceil(run)) if run <= _LONGEST_RUN else 0
