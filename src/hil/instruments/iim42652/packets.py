"""FIFO packets of the gyroscope alone, decoded block by block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.instruments.iim42652.mode import RAIL

__all__ = ["PACKET_BYTES", "Packets", "rates"]

PACKET_BYTES = 8
"""Header, three axes of 16 bits with the high byte first, temperature of 8 bits."""

_LAYOUT = np.dtype([("header", "u1"), ("gyro", ">i2", (3,)), ("temperature", "i1")])
# Bit 7: the FIFO is empty; 6: accelerometer; 5: gyroscope; 4: 20 bits. The others tell of clocks.
_EMPTY = 0x80
_KIND = 0xF0
_GYROSCOPE_ALONE = 0x20


@dataclass(frozen=True, slots=True)
class Packets:
    """The packets of one read.

    Attributes:
        counts: of the three axes, shape (n, 3), packets that are none included.
        usable: which packets are what they should be, shape (n,).
    """

    counts: NDArray[np.int16]
    usable: NDArray[np.bool_]

    @classmethod
    def read(cls, data: bytes) -> Packets:
        """Decode whole packets; from the first one on that says `empty` there are none."""
        packets = np.frombuffer(data, _LAYOUT)
        headers = packets["header"]
        if len(headers) and headers.max() >= _EMPTY:
            packets = packets[: int(np.argmax(headers >= _EMPTY))]
            headers = packets["header"]
        return cls(packets["gyro"].astype(np.int16), (headers & _KIND) == _GYROSCOPE_ALONE)


def rates(counts: NDArray[np.int16], sensitivity: float) -> NDArray[np.float64]:
    """Return rates in deg/s, any shape; NaN where a sample is marked invalid (-32768) or at a rail (+/-32767).

    Args:
        counts: as read.
        sensitivity: counts per deg/s.
    """
    numbers = counts / sensitivity
    numbers[(counts >= RAIL) | (counts <= -RAIL)] = np.nan
    return numbers
