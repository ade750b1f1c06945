"""Detection of frozen sensors: noise toggles the last bits of one that measures."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hil.instruments.sensors.scale import Scale
from hil.model.errors import NoReply

__all__ = ["Stillness"]

_MOST_EQUAL = 16
# Noise in counts rms below which equal samples mean nothing. A unit with 0.4 of the typical noise has 0.4 counts
# rms: all three axes repeat with a probability below 0.27, sixteen times in a row once in 3e8 samples.
_LEAST_NOISE = 1.0
_QUIET = 0.4
_SELDOM = 1e-9  # probability of a false alarm per run of equal samples
_LONGEST_RUN = 1000


class Stillness:
    """Counter of consecutive equal samples.

    Where the range is so wide that the noise stays below one count, equal samples mean nothing, unless a longer run is
    required, see `patience`. Samples with no valid axis are not counted, see `Scale.rails`.

    Args:
        device: the sensor's name, for messages.
        scale: scale of the axes.
        noise: expected noise in counts rms.
        patience: correlation length of the noise in samples, at least 1: then a sensor with noise below one count is
            detected too, after a run as long as a quiet unit gives once in 1e9 runs. 0 disables this.
    """

    def __init__(self, device: str, scale: Scale, noise: float = math.inf, patience: float = 0.0) -> None:
        self._device = device
        self._scale = scale
        self._most = _MOST_EQUAL if noise >= _LEAST_NOISE else _frozen_run(noise, patience)
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
        """Take samples in order, shape (n, axes).

        Raises:
            NoReply: sixteen samples in a row were equal, the newest one included.
        """
        if not self._most or not len(counts):
            return
        different = np.flatnonzero((counts != counts[-1]).any(axis=1))
        equal = len(counts) - 1 - int(different[-1]) if len(different) else len(counts)
        self._count(counts[-1].tolist(), equal, whole=equal == len(counts))

    def _count(self, newest: list[int], equal: int, *, whole: bool) -> None:
        """Note the number of samples equal to the newest; `whole` if that is all of them."""
        self._run = self._run + equal if whole and newest == self._newest else equal
        self._newest = newest
        if self._run >= self._most and any(self._scale.usable(axis) for axis in newest):
            raise NoReply(
                self._device,
                f"{self._run} consecutive samples are equal, the sensor is stuck",
                "switch the sensor off and on, and start it again",
            )


def _frozen_run(noise: float, patience: float) -> int:
    """Return the run of equal samples that shows a frozen sensor at this noise; 0 where none would."""
    if patience < 1.0 or noise <= 0.0:
        return 0
    # A mean in the middle of a count, where noise toggles the reading least.
    same = math.erf(0.5 / (_QUIET * noise * math.sqrt(2.0)))
    equal = (same**2 + (1.0 - same) ** 2 / 2.0) ** 3
    run = math.log(_SELDOM) / math.log(equal) * patience if equal < 1.0 else math.inf
    return max(_MOST_EQUAL, math.ceil(run)) if run <= _LONGEST_RUN else 0
