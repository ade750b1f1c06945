"""Conversion of counts to quantities, with saturated and invalid counts as NaN."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Scale"]

_NONE = 2**31


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """Linear scale of a data sheet: `zero + counts / per_unit * factor`.

    A reading at a rail or beyond full scale is NaN, which no check passes: the measured quantity then exceeds it by an
    unknown amount. So is one whose counts stand for "no sample".

    Attributes:
        per_unit: counts per unit of the data sheet.
        zero: the quantity at 0 counts.
        factor: the data sheet's unit in the quantity's unit, such as 100 for gauss to uT.
        full_scale: largest magnitude of the range, in the data sheet's unit.
        rails: lower and upper counts at and beyond which a reading is NaN.
    """

    per_unit: float
    zero: float = 0.0
    factor: float = 1.0
    full_scale: float = math.inf
    rails: tuple[int, int] = (-_NONE, _NONE)

    @property
    def resolution(self) -> float:
        """The quantity of one count."""
        return self.factor / self.per_unit

    def usable(self, counts: int) -> bool:
        """Return whether counts are between the rails."""
        return self.rails[0] < counts < self.rails[1]

    def number(self, counts: int) -> float:
        """Return the quantity of one reading."""
        units = counts / self.per_unit
        if abs(units) > self.full_scale or not self.usable(counts):
            return math.nan
        return self.zero + units * self.factor

    def numbers(self, counts: NDArray[np.int16]) -> NDArray[np.float64]:
        """Return the quantities of an array of readings of any shape."""
        units = counts / self.per_unit
        least, most = self.rails
        none = (counts <= least) | (counts >= most)
        if self.full_scale < math.inf:
            none |= np.abs(units) > self.full_scale
        numbers = units * self.factor + self.zero
        numbers[none] = np.nan
        return numbers
