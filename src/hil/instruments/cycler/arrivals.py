"""When lines of level 1 were sent: they have no time, only an order, a rate and the instants of two looks."""

from __future__ import annotations

import math

from hil.instruments.cycler.lines import LINE_S

__all__ = ["Arrivals"]

_TOLERANCE = 0.005  # of the device's resonator
_SHORTEST_S, _LONGEST_S = LINE_S * (1 - _TOLERANCE), LINE_S * (1 + _TOLERANCE)
_ON_THE_LINE_S = 0.05  # a line of 30 bytes takes 31 ms; part of it may have come before the look


class Arrivals:
    """Bounds of the instants at which the newest line was sent, in s of the bench's clock.

    A line came between two looks at the port, and 5 s after the line before it by a clock that is right within 0.5 %.
    Both bounds hold, so that the narrower ones count. Lines are missing where the two cannot agree otherwise.

    Attributes:
        uncertainty: standard uncertainty of the newest instant, that of an even distribution between its bounds.
    """

    def __init__(self) -> None:
        self._low: float | None = None
        self._high = 0.0

    @property
    def uncertainty(self) -> float | None:
        """Standard uncertainty of the newest instant in s, None before the first."""
        return None if self._low is None else (self._high - self._low) / math.sqrt(12)

    def begin(self, low: float, high: float) -> None:
        """Count from the start of a test, which was between these instants."""
        self._low, self._high = low, high

    def place(self, since: float, until: float, behind: int, lost: int) -> tuple[float, int]:
        """Return when a line was sent, and how many before it cannot have come.

        Args:
            since: when the port was looked at without finding it.
            until: when it was found.
            behind: how many lines were found with it that were sent later.
            lost: how many before it are missing at least, by what it tells.
        """
        since, until = since - _ON_THE_LINE_S, until - behind * _SHORTEST_S
        since = min(since, until)
        if self._low is None:
            self._low, self._high = since, until
            return (since + until) / 2, 0
        low, high = self._low + (1 + lost) * _SHORTEST_S, self._high + (1 + lost) * _LONGEST_S
        while high < since:
            low, high, lost = low + _SHORTEST_S, high + _LONGEST_S, lost + 1
        low, high = (max(low, since), min(high, until)) if low <= until else (since, until)
        self._low, self._high = low, high
        return (low + high) / 2, lost
