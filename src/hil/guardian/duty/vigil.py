"""Whether the executive is alive and well, told by its beats and by the clocks of this machine."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

__all__ = ["Clocks", "Vigil"]

_LONGEST_JUMP_S = 1.0
_LEAST_LOOK_S = 0.01
_MOST_LOOK_S = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Clocks:
    """What time is read from.

    Attributes:
        boot: seconds since this machine's start, suspends included.
        awake: seconds since then without them.
    """

    boot: Callable[[], float] = lambda: time.clock_gettime(time.CLOCK_BOOTTIME)
    awake: Callable[[], float] = time.monotonic


class Vigil:
    """Watches beats.

    Args:
        hang_s: how long they may be missing.
        clocks: what time is read from.
    """

    def __init__(self, hang_s: float, clocks: Clocks | None = None) -> None:
        self._hang_s = hang_s
        self._clocks = clocks or Clocks()
        self._fresh_until = 0.0
        self._beat = 0.0
        self._suspended = 0.0
        self.excuse()

    def excuse(self) -> None:
        """Begin, or go on after the executive had to wait: the next beat is due from now on."""
        now = self._clocks.boot()
        self._beat = now
        self._fresh_until = now + self._hang_s
        self._suspended = now - self._clocks.awake()

    def beat(self, fresh_until: float) -> None:
        """Take a beat, and how long what the executive knows of its bench is good."""
        self._beat = self._clocks.boot()
        self._fresh_until = fresh_until

    @property
    def silent_s(self) -> float:
        """How long no beat has come [s]."""
        return self._clocks.boot() - self._beat

    def why(self) -> str:
        """Return what is wrong, nothing while nothing is."""
        now = self._clocks.boot()
        suspended = now - self._clocks.awake() - self._suspended
        if suspended > _LONGEST_JUMP_S:
            return f"this machine was suspended for {suspended:.1f} s"
        if now - self._beat > self._hang_s:
            return f"the executive was silent for {now - self._beat:.2f} s"
        if not now <= self._fresh_until:
            return "the executive lives, but has not looked at the envelope in time"
        return ""

    def next_s(self) -> float:
        """Return after how long to look again [s]."""
        now = self._clocks.boot()
        left = min(self._beat + self._hang_s, self._fresh_until) - now
        return min(max(left, _LEAST_LOOK_S), _MOST_LOOK_S)
