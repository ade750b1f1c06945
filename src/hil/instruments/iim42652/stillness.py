"""Whether a gyroscope still measures: noise moves the last bits of one that does."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hil.instruments.iim42652.mode import INVALID, RAIL
from hil.model.errors import NoReply

__all__ = ["Stillness"]

_MOST_EQUAL = 16
# Typical noise in counts rms below which equal samples mean nothing. With 0.4 of it an article has 0.4 counts: all
# three axes equal the last ones with a probability below 0.27, sixteen in a row once in 3e8 samples.
_LEAST_NOISE = 1.0


class Stillness:
    """Counts samples that are equal to the last one.

    Where the range is so wide that the noise stays below one count, equal samples mean nothing and are not counted;
    neither are samples that are invalid or at a rail on all axes.

    Args:
        device: the sensor's name, for messages.
        noise: expected noise in counts rms.
    """

    def __init__(self, device: str, noise: float) -> None:
        self._device = device
        self._watching = noise >= _LEAST_NOISE
        self._newest: NDArray[np.int16] | None = None
        self._run = 0

    def judge(self, counts: NDArray[np.int16]) -> None:
        """Take samples in their order, shape (n, 3).

        Raises:
            NoReply: sixteen samples in a row were equal, the newest one included.
        """
        if not self._watching or not len(counts):
            return
        newest = counts[-1]
        different = np.flatnonzero((counts != newest).any(axis=1))
        if len(different):
            self._run = len(counts) - 1 - int(different[-1])
        elif self._newest is not None and (self._newest == newest).all():
            self._run += len(counts)
        else:
            self._run = len(counts)
        self._newest = newest
        if self._run >= _MOST_EQUAL and not np.isin(newest, (INVALID, -RAIL, RAIL)).all():
            raise NoReply(
                self._device,
                f"{self._run} samples in a row are equal, the sensor stands still",
                "switch the sensor off and on, and start it again",
            )
