"""The low-pass filters of a sensor: which one fits a rate, and how much noise it lets through."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["BUTTERWORTH", "Filters"]

BUTTERWORTH = math.pi / 4 / math.sin(math.pi / 4)
"""Noise bandwidth over -3 dB bandwidth of a Butterworth filter of second order."""


@dataclass(frozen=True, slots=True)
class Filters:
    """A data sheet's table of filters, by their code.

    Attributes:
        cut_offs: bandwidths at -3 dB [Hz].
        bandwidths: noise bandwidths [Hz].
    """

    cut_offs: tuple[float, ...]
    bandwidths: tuple[float, ...]

    def code(self, rate: float, wanted: float | None) -> int:
        """Return the code of a filter: the one that is wanted, or the widest up to half the rate, else the narrowest.

        Args:
            rate: of samples [Hz].
            wanted: bandwidth at -3 dB [Hz], which is in the table; None for the one that fits the rate.
        """
        fitting = max((each for each in self.cut_offs if each <= rate / 2), default=min(self.cut_offs))
        return self.cut_offs.index(fitting if wanted is None else wanted)
