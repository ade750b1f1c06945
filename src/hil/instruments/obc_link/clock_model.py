"""The device's clock against the bench's, from two-way exchanges of time stamps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

__all__ = ["ClockEstimate", "Exchange", "estimate"]

_RESOLUTION_S = 1e-6
_FEWEST = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Exchange:
    """Four stamps of one exchange: t1 and t4 of the bench, t2 and t3 of the device, all in s."""

    sent: float
    device_received: float
    device_sent: float
    received: float

    @property
    def offset(self) -> float:
        """Bench minus device in s, ((t1 - t2) + (t4 - t3)) / 2: RFC 5905, section 8, with the sign of the bench."""
        return ((self.sent - self.device_received) + (self.received - self.device_sent)) / 2.0

    @property
    def delay(self) -> float:
        """Time on the way in s, (t4 - t1) - (t3 - t2): RFC 5905, section 8; half of it bounds the offset's error."""
        return (self.received - self.sent) - (self.device_sent - self.device_received)

    @property
    def device_middle(self) -> float:
        """Device time in the middle of the device's turn, in s."""
        return (self.device_received + self.device_sent) / 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockEstimate:
    """What exchanges tell; None where they are too few.

    Attributes:
        drift: rate of the device's clock against the bench's minus 1.
        drift_uncertainty: standard uncertainty of `drift`.
        offset: bench minus device at the last exchange, in s.
    """

    drift: float | None = None
    drift_uncertainty: float | None = None
    offset: float | None = None


def estimate(exchanges: Sequence[Exchange]) -> ClockEstimate:
    """Estimate drift and offset by a straight line through the offsets of the quicker half.

    Exchanges slower than the median are left out: what made them slow did so on one way only, as a
    rule (Cristian, Probabilistic clock synchronization, Distributed Computing 3, 1989; RFC 5905 keeps the
    quickest of eight). The line is fitted by least squares to offset over device time; its slope b is
    d(bench)/d(device) - 1, so the drift is 1/(1 + b) - 1. Its standard uncertainty comes from the scatter
    about the line with n - 2 degrees of freedom, which is taken to be no smaller than what the stamps'
    steps of 1 us alone make of the mean of two: 1 us / sqrt(12) / sqrt(2). A constant difference between
    the two ways shifts the offset, by half of the delay at most, and leaves the drift alone.

    Args:
        exchanges: at any distances, in any order.
    """
    if not exchanges:
        return ClockEstimate()
    middle_delay = median(exchange.delay for exchange in exchanges)
    kept = [exchange for exchange in exchanges if exchange.delay <= middle_delay]
    end = max(exchange.device_middle for exchange in exchanges)
    times = [exchange.device_middle - end for exchange in kept]
    offsets = [exchange.offset for exchange in kept]
    count = len(kept)
    mean_time, mean_offset = math.fsum(times) / count, math.fsum(offsets) / count
    spread = math.fsum((time - mean_time) ** 2 for time in times)
    if count < _FEWEST or not spread:
        return ClockEstimate(offset=mean_offset)
    pairs = list(zip(times, offsets, strict=True))
    slope = math.fsum((time - mean_time) * (offset - mean_offset) for time, offset in pairs) / spread
    residuals = (offset - mean_offset - slope * (time - mean_time) for time, offset in pairs)
    scatter = math.sqrt(math.fsum(residual**2 for residual in residuals) / (count - 2))
    least = _RESOLUTION_S / math.sqrt(12.0) / math.sqrt(2.0)
    return ClockEstimate(
        drift=-slope / (1.0 + slope),
        drift_uncertainty=max(scatter, least) / math.sqrt(spread) / (1.0 + slope) ** 2,
        offset=mean_offset - slope * mean_time,
    )
