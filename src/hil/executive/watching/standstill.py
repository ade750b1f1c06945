"""Standstill: a case that lets no bench time pass is limited by the wall, or it would go on for ever."""

from __future__ import annotations

from hil.clock import wall
from hil.clock.port import Clock

__all__ = ["Standstill"]

_LEAST_S = 5.0
"""Time always allowed for a computation on a slow machine, however short a case's `max_duration` is."""


class Standstill:
    """Counts wall time while bench time stands still.

    It may stand still while a person is asked, and while the bench is held.

    Args:
        clock: the bench's clock.

    Attributes:
        since: wall time since when bench time has stood still without an excuse.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._at_ns = 0
        self._longest_s = 0.0
        self.since = wall.monotonic()

    @property
    def patience_s(self) -> float:
        """Wall-clock seconds after which only a call that does not return keeps a case going."""
        return self._longest_s + _LEAST_S

    def begin(self, longest_s: float) -> None:
        """Begin to count for a case that may take this long."""
        self._longest_s = max(_LEAST_S, longest_s)
        self.excuse()

    def excuse(self) -> None:
        """Count from now."""
        self.since = wall.monotonic()

    def look(self, now: float, *, limited: bool) -> str:
        """Return why the case has taken too long, empty if it has not, or is not `limited`."""
        at_ns = self._clock.now_ns()
        if not limited or at_ns != self._at_ns:
            self._at_ns, self.since = at_ns, now
        elif now - self.since > self._longest_s:
            return f"the case ran for {now - self.since:.0f} s without letting any bench time pass"
        return ""
