"""The instants at which a simulated sensor's samples end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Grid"]


@dataclass(frozen=True, slots=True)
class Grid:
    """Sample n, counted from 1, ends n periods after the start.

    Attributes:
        start_ns: when samples began to be counted.
        period_ns: from sample to sample, by the sensor's own oscillator.
    """

    start_ns: int
    period_ns: float

    def count(self, now_ns: int) -> int:
        """Return how many samples have ended."""
        number = int((now_ns - self.start_ns) / self.period_ns) + 1
        while self.end_ns(number) > now_ns:
            number -= 1
        return number

    def end_ns(self, number: int) -> int:
        """Return when a sample ends."""
        return self.start_ns + round(number * self.period_ns)

    def ends_ns(self, first: int, count: int) -> NDArray[np.int64]:
        """Return when `count` samples from `first` on end, shape (count,)."""
        numbers = np.arange(first, first + count, dtype=np.float64)
        return self.start_ns + np.rint(numbers * self.period_ns).astype(np.int64)
