"""What one simulated board is, and what its analogue inputs see."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.simulation.plants.terminal import SignalPoint

__all__ = ["CHANNELS", "FULL_SCALE", "Article"]

CHANNELS = 6
FULL_SCALE = 4095


@dataclass(frozen=True, slots=True, kw_only=True)
class Article:
    """What this board is: firmware, chip, and what its analogue inputs see.

    Attributes:
        firmware: version, three numbers.
        build: eight bytes of the firmware's commit.
        chip: the twelve bytes of the unique id.
        ring: bytes for stream frames.
        reference: VDDA in V.
        noise: of one conversion, in counts rms.
        inputs: signals in V by channel; the others are 0 V.
    """

    firmware: tuple[int, int, int]
    build: bytes
    chip: bytes
    ring: int
    reference: float
    noise: float
    inputs: Mapping[int, SignalPoint]

    def conversions(self, channel: int, noise: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return raw conversions of a channel now, shape as `noise`, which is in units of its standard deviation."""
        volts = self.inputs[channel].observe() if channel in self.inputs else 0.0
        counts = np.rint(volts / self.reference * FULL_SCALE + self.noise * noise)
        return np.clip(counts, 0, FULL_SCALE).astype(np.int64)
