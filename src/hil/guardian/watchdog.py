"""The watchdog: whether the executive is alive, judged by its beats and by this machine's clocks."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

__all__ = ["Clocks", "Watchdog"]

_LONGEST_JUMP_S = 1.0
_LEAST_LOOK_S = 0.01
_MOST_LOOK_S = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Clocks:
    """The clocks of the watchdog.

    Attributes:
        boot: seconds since boot, suspend included.
        awake: the same without suspend.
    """

    boot: Callable[[], float] = lambda: time.clock_gettime(time.CLOCK_BOOTTIME)
    awake: Callable[[], float] = time.monotonic


class Watchdog:
    """Watches the executive's beats.

    Args:
        hang_s: the longest silence allowed [s].
        clocks: where time is read.
    """

    def __init__(self, hang_s: float, clocks: Clocks | None = None) -> None:
        self._hang_s = hang_s
        self._clocks = clocks or Clocks()
        self._fresh_until = 0.0
        self._beat = 0.0
        self._suspended = 0.0
        self.restart()

    def restart(self) -> None:
        """Restart the timeout: at the start, and after the executive had to wait."""
        now = self._clocks.boot()
        self._beat = now
        self._fresh_until = now + self._hang_s
        self._suspended = now - self._clocks.awake()

    def beat(self, fresh_until: float) -> None:
        """Take a beat, with the time until which the executive's last check of its bench is valid."""
        self._beat = self._clocks.boot()
        self._fresh_until = fresh_until

    @property
    def silent_s(self) -> float:
        """Seconds since the last beat."""
        return self._clocks.boot() - self._beat

    def why(self) -> str:
        """Return what is wrong, empty while nothing is."""
        now = self._clocks.boot()
        suspended = now - self._clocks.awake() - self._suspended
        if suspended > _LONGEST_JUMP_S:
            return f"this machine was suspended for {suspended:.1f} s"
        if now - self._beat > self._hang_s:
            return f"the executive was silent for {now - self._beat:.2f} s"
        if not now <= self._fresh_until:
            return "the executive is alive, but did not check the envelope in time"
        return ""

    def next_s(self) -> float:
        """Return the time to the next check [s]."""
        now = self._clocks.boot()
        left = min(self._beat + self._hang_s, self._fresh_until) - now
        return min(max(left, _LEAST_LOOK_S), _MOST_LOOK_S)
