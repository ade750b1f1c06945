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


class Stillness:
    """Counts samples that are equal to the last one.

    Where the range is so wide that the noise stays below one count, equal samples mean nothing and are not counted;
    neither are samples without a number on any axis, see `Scale.rails`.

    Args:
        device: the sensor's name, for messages.
        scale: of the axes.
        noise: expected noise in counts rms.
    """

    def __init__(self, device: str, scale: Scale, noise: float = math.inf) -> None:
        self._device = device
        self._scale = scale
        self._watching = noise >= _LEAST_NOISE
        self._newest: list[int] | None = None
        self._run = 0

    def judge(self, counts: Sequence[int]) -> None:
        """Take one sample of all axes.

        Raises:
            NoReply: sixteen samples in a row were equal, this one included.
        """
        if self._watching:
            newest = list(counts)
            self._count(newest, 1, whole=True)

    def judge_many(self, counts: NDArray[np.int16]) -> None:
        """Take samples in their order, shape (n, axes).

        Raises:
            NoReply: sixteen samples in a row were equal, the newest one included.
        """
        if not self._watching or not len(counts):
            return
        different = np.flatnonzero((counts != counts[-1]).any(axis=1))
        equal = len(counts) - 1 - int(different[-1]) if len(different) else len(counts)
        self._count(counts[-1].tolist(), equal, whole=equal == len(counts))

    def _count(self, newest: list[int], equal: int, *, whole: bool) -> None:
        """Note how many of the samples that came are equal to the newest; `whole` are all of them."""
        self._run = self._run + equal if whole and newest == self._newest else equal
        self._newest = newest
        if self._run >= _MOST_EQUAL and any(self._scale.usable(axis) for axis in newest):
            raise NoReply(
                self._device,
                f"{self._run} consecutive samples are equal, the sensor is stuck",
                "switch the sensor off and on, and start it again",
            )
