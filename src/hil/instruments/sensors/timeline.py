"""Sample times from the instants at which the FIFO reached its watermark."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Span", "Timeline"]

# The sensor's oscillator is within a few per cent; a larger difference is not a sampling period.
_LARGEST_ERROR = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """The packets of one read of the FIFO.

    Attributes:
        number: counted from 0; a missing number is a read whose packets were lost.
        at_s: device time in s at which the FIFO reached its watermark.
        watermark: number of packets that entered the FIFO between the previous read and that instant.
        count: number of packets read.
        lost: number of packets, the oldest, that the FIFO dropped before this read.
    """

    number: int
    at_s: float
    watermark: int
    count: int
    lost: int


class Timeline:
    """Assigns a time to every packet, linearly between consecutive watermark instants.

    The first span waits for the second, which gives the period. A span after a lost one keeps the period, and its
    packets are placed before its own instant, so that lost packets leave a gap in time.

    Args:
        period: nominal sampling period in s.
        begun_s: device time at which the FIFO began to fill, None if only the first instant shows it.
    """

    def __init__(self, period: float, begun_s: float | None = None) -> None:
        self._nominal = period
        self._period = period
        self._origin = begun_s or 0.0
        self._anchor = begun_s  # the last known instant
        self._behind = 0  # packets since then
        self._number = -1  # and its span
        self._first: Span | None = None
        self._idle = 0

    def place(self, span: Span) -> list[NDArray[np.float64]]:
        """Return the times, in s since the FIFO began to fill, of this span and any that waited: 0, 1 or 2 arrays."""
        if self._anchor is not None:
            return [self._placed(span)]
        if self._first is None:
            if not span.count:
                self._idle += 1  # an edge from before the FIFO was on
            else:
                self._first = span
            return [] if span.count else [np.empty(0)]
        first, self._first = self._first, None
        return [self._begin(first, span), self._placed(span)]

    def _begin(self, first: Span, second: Span) -> NDArray[np.float64]:
        ahead = min(first.watermark - first.lost, first.count)
        if second.number == first.number + 1:
            self._learn(second.at_s - first.at_s, first.count - ahead + second.watermark)
        self._origin = first.at_s - ((first.number - self._idle) * first.watermark + ahead + first.lost) * self._period
        return self._anchored(first, ahead)

    def _placed(self, span: Span) -> NDArray[np.float64]:
        ahead = span.watermark - span.lost
        if span.count < ahead:  # an edge that was not a watermark: its packets continue from the last ones
            times = self._at(self._anchor or 0.0, 1 + self._behind, span.count)
            self._behind += span.count
            self._number = span.number
            return times
        if span.number == self._number + 1:
            self._learn(span.at_s - (self._anchor or 0.0), self._behind + span.watermark)
        return self._anchored(span, ahead)

    def _anchored(self, span: Span, ahead: int) -> NDArray[np.float64]:
        self._anchor, self._behind, self._number = span.at_s, span.count - ahead, span.number
        return self._at(span.at_s, 1 - ahead, span.count)

    def _at(self, anchor: float, first: int, count: int) -> NDArray[np.float64]:
        steps = np.arange(first, first + count, dtype=np.float64)
        return steps * self._period + (anchor - self._origin)

    def _learn(self, elapsed: float, packets: int) -> None:
        if abs(elapsed / packets / self._nominal - 1.0) <= _LARGEST_ERROR:
            self._period = elapsed / packets
