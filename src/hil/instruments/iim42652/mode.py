"""What a wire asks of an IIM-42652, as register values and as physical quantities.

Ranges and rates: Ixm42xxxDefs.h. Filter bandwidths: the family's datasheets (GYRO_ACCEL_CONFIG0 of the ICM-42688-P):
half the rate, or the larger of 400 Hz and the rate over 4, 5, 8, 10, 16, 20 or 40.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

from hil.instruments import settings
from hil.instruments.iim42652.registers import Register
from hil.model.bench import Wire
from hil.model.errors import Refused

__all__ = ["GYRO_ON", "INVALID", "RAIL", "Mode", "celsius"]

INVALID = -32768
"""What data registers and FIFO hold where there is no valid sample."""

RAIL = 32767
"""Counts at which the converter ends, either way."""

GYRO_ON = 0b11 << 2
"""PWR_MGMT0 with the gyroscope in low-noise mode and the accelerometer off."""

# Range in deg/s: (code, counts per deg/s).
_RANGES = {
    2000.0: (0, 16.4),
    1000.0: (1, 32.8),
    500.0: (2, 65.5),
    250.0: (3, 131.0),
    125.0: (4, 262.0),
    62.5: (5, 524.3),
    31.25: (6, 1048.6),
    15.625: (7, 2097.2),
}
# Rate in Hz: code. Faster ones exist; the bus cannot carry them.
_RATES = {12.5: 11, 25.0: 10, 50.0: 9, 100.0: 8, 200.0: 7, 500.0: 15, 1000.0: 6}
_DIVISORS = (4, 5, 8, 10, 16, 20, 40)  # codes 1 to 7
_ORDER = 3
_THIRD_ORDER = 0x1A  # and the reset value of the bits for the decimation filter
_ACCEL_FILTER = 1 << 4  # as after reset
_BIG_ENDIAN_COUNTED_IN_BYTES = 0x30
_NOISE_DENSITY = 0.0038  # deg/s/sqrt(Hz), one-sided, typical
_MOST_LINE = 255


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """What a wire asks for.

    Attributes:
        full_scale: range in deg/s.
        rate: samples per second.
        bandwidth: -3 dB bandwidth of the filter in Hz.
        line: interrupt line of the OBC at which INT1 ends.
    """

    full_scale: float
    rate: float
    bandwidth: float
    line: int

    @classmethod
    def read(cls, wire: Wire) -> Self:
        """Read the settings `range`, `rate`, `bandwidth` and `line` of a wire; Refused where one cannot be."""
        settings.only(wire, "range", "rate", "bandwidth", "line")
        rate = settings.choice(wire, "rate", "Hz", tuple(_RATES), 100.0)
        line = settings.quantity(wire, "line", "") or 0.0
        if line not in range(_MOST_LINE + 1):
            raise Refused(f"wiring {wire.name}: line {line:g} does not exist", "write a number from 0 up")
        return cls(
            full_scale=settings.choice(wire, "range", "deg/s", tuple(_RANGES), 125.0),
            rate=rate,
            bandwidth=settings.choice(wire, "bandwidth", "Hz", tuple(sorted(_filters(rate))), rate / 2),
            line=int(line),
        )

    @property
    def registers(self) -> dict[Register, int]:
        """The settings, in the order in which they are written; the gyroscope is still off."""
        return {
            Register.INTF_CONFIG0: _BIG_ENDIAN_COUNTED_IN_BYTES,
            Register.GYRO_CONFIG0: _RANGES[self.full_scale][0] << 5 | _RATES[self.rate],
            Register.GYRO_CONFIG1: _THIRD_ORDER,
            Register.GYRO_ACCEL_CONFIG0: _ACCEL_FILTER | _filters(self.rate)[self.bandwidth],
            Register.INT_CONFIG1: 0,  # INT_ASYNC_RESET must be cleared, or the pin stays still
        }

    @property
    def sensitivity(self) -> float:
        """Counts per deg/s."""
        return _RANGES[self.full_scale][1]

    @property
    def noise_bandwidth(self) -> float:
        """Noise bandwidth in Hz of a Butterworth filter of third order: pi/6 / sin(pi/6) of its -3 dB bandwidth."""
        angle = math.pi / (2 * _ORDER)
        return self.bandwidth * angle / math.sin(angle)

    @property
    def noise_counts(self) -> float:
        """Standard deviation in counts that the typical noise density leaves behind this filter."""
        return _NOISE_DENSITY * math.sqrt(self.noise_bandwidth) * self.sensitivity

    @property
    def period(self) -> float:
        """Nominal seconds from sample to sample."""
        return 1.0 / self.rate


def celsius(data: bytes) -> float:
    """Return the temperature in degC of two bytes of TEMP_DATA; NaN where it is marked invalid."""
    counts = int.from_bytes(data, "big", signed=True)
    return math.nan if counts == INVALID else 25.0 + counts / 132.48


def _filters(rate: float) -> dict[float, int]:
    """Return the code of each -3 dB bandwidth in Hz; half the rate has its own."""
    wide = {max(400.0, rate) / divisor: code for code, divisor in enumerate(_DIVISORS, 1)}
    return wide | {rate / 2: 0}
