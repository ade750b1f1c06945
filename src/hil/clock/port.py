"""Interface of a bench's clock."""

from __future__ import annotations

from typing import Protocol

__all__ = ["FOREVER_NS", "NANOSECONDS", "Clock", "ClockError"]

NANOSECONDS = 1_000_000_000
FOREVER_NS = 2**62
"""An instant beyond the life of any bench."""


class ClockError(RuntimeError):
    """Time cannot continue: nothing is due, or too much is due at one instant."""


class Clock(Protocol):
    """A bench's clock: monotonic, counted in nanoseconds from the bench's epoch."""

    def now_ns(self) -> int:
        """Return the nanoseconds since the bench's epoch."""
        ...

    def now(self) -> float:
        """Return the seconds since the bench's epoch."""
        ...

    def look(self) -> int:
        """Return the present bench time in ns: time outside this process advances between calls."""
        ...

    def sleep(self, seconds: float) -> None:
        """Let `seconds` pass; a negative number is refused."""
        ...

    def wait_until(self, when_ns: int) -> None:
        """Let time pass until `when_ns`; an instant in the past returns at once."""
        ...

    def utc(self) -> str:
        """Return the bench's UTC as ISO 8601 with microseconds and `Z`."""
        ...
