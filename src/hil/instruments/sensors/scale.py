"""How counts become quantities, and which counts are none."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Scale"]

_NONE = 2**31


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """The line of a data sheet: `zero + counts / per_unit * factor`.

    A number is NaN, which no check passes, where its counts are at a rail or beyond the full scale: what is measured is
    then larger by an unknown amount. So is one whose counts stand for "no sample".

    Attributes:
        per_unit: counts per unit of the data sheet.
        zero: the quantity at 0 counts.
        factor: what a unit of the data sheet is in the unit of the quantity, such as 100 uT for a gauss.
        full_scale: the largest magnitude of the range, in the unit of the data sheet.
        rails: counts at which, and beyond which, there is no number.
    """

    per_unit: float
    zero: float = 0.0
    factor: float = 1.0
    full_scale: float = math.inf
    rails: tuple[int, int] = (-_NONE, _NONE)

    @property
    def resolution(self) -> float:
        """What one count is."""
        return self.factor / self.per_unit

    def usable(self, counts: int) -> bool:
        """Return whether these counts are between the rails."""
        return self.rails[0] < counts < self.rails[1]

    def number(self, counts: int) -> float:
        """Return the quantity of one reading."""
        units = counts / self.per_unit
        if abs(units) > self.full_scale or not self.usable(counts):
            return math.nan
        return self.zero + units * self.factor

    def numbers(self, counts: NDArray[np.int16]) -> NDArray[np.float64]:
        """Return the quantities of many readings, any shape."""
        units = counts / self.per_unit
        least, most = self.rails
        none = (counts <= least) | (counts >= most)
        if self.full_scale < math.inf:
            none |= np.abs(units) > self.full_scale
        numbers = units * self.factor + self.zero
        numbers[none] = np.nan
        return numbers
