"""Low-pass filters of a sensor: selection for a sampling rate, and noise bandwidths."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["BUTTERWORTH", "Filters"]

BUTTERWORTH = math.pi / 4 / math.sin(math.pi / 4)
"""Ratio of noise bandwidth to -3 dB bandwidth of a second-order Butterworth filter."""


@dataclass(frozen=True, slots=True)
class Filters:
    """A data sheet's table of filters, indexed by code.

    Attributes:
        cut_offs: -3 dB bandwidths [Hz].
        bandwidths: noise bandwidths [Hz].
    """

    cut_offs: tuple[float, ...]
    bandwidths: tuple[float, ...]

    def code(self, rate: float, wanted: float | None) -> int:
        """Return the code of the wanted filter, or of the widest up to half the rate, or else of the narrowest.

        Args:
            rate: sampling rate [Hz].
            wanted: -3 dB bandwidth [Hz] from the table; None to match the rate.
        """
        fitting = max((each for each in self.cut_offs if each <= rate / 2), default=min(self.cut_offs))
        return self.cut_offs.index(fitting if wanted is None else wanted)
