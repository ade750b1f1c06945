"""Clock of a bench outside this process: boot time, frozen between operations."""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import timedelta

from hil.clock import wall
from hil.clock.port import NANOSECONDS, ClockError

__all__ = ["LiveClock"]

_SLICE_NS = 100_000_000
"""Longest slice of a wait between pulses in ns."""


class LiveClock:
    """Bench time that follows boot time, but advances only at `look` and at the end of a wait.

    A run then learns of time only from its waits, which end at their nominal instant, and from its port operations,
    whose ends are in the transcript. So its record contains all that a replay needs. See ADR 0037. Until it begins,
    waits return at once: a resumed run catches up with its past in no time.

    Args:
        epoch: UTC of the bench's time zero, ISO 8601.
        speed: bench seconds per second of boot time; other than 1 only for a served bench.
        real_ns: returns boot time in ns.
        pause: lets up to this many seconds of boot time pass.

    Attributes:
        pulse: called at every `look`, and about ten times a second during a wait.
    """

    def __init__(
        self,
        epoch: str,
        *,
        speed: float = 1.0,
        real_ns: Callable[[], int] = wall.boot_ns,
        pause: Callable[[float], None] = time.sleep,
    ) -> None:
        self.pulse: Callable[[], None] = lambda: None
        self._epoch = wall.moment_of(epoch)
        self._speed = speed
        self._real_ns = real_ns
        self._pause = pause
        self._start_ns = self._now_ns = 0
        self._began_ns: int | None = None

    @property
    def began(self) -> bool:
        """Whether it follows boot time."""
        return self._began_ns is not None

    def begin(self) -> None:
        """Start to follow boot time."""
        self._start_ns, self._began_ns = self._now_ns, self._real_ns()

    def now_ns(self) -> int:
        """Return the bench time of the last operation or wait."""
        return self._now_ns

    def now(self) -> float:
        """Return the bench time of the last operation or wait in s."""
        return self._now_ns / NANOSECONDS

    def look(self) -> int:
        """Advance bench time to the present moment, and return it in ns."""
        if self._began_ns is not None:
            self.pulse()
            self._now_ns = max(self._now_ns, self._present_ns(self._began_ns))
        return self._now_ns

    def utc(self) -> str:
        """Return the bench's UTC: epoch plus bench time."""
        moment = self._epoch + timedelta(microseconds=self._now_ns // 1000)
        return moment.isoformat(timespec="microseconds").replace("+00:00", "Z")

    def sleep(self, seconds: float) -> None:
        """Let `seconds` pass."""
        if not seconds >= 0:
            raise ClockError(f"cannot sleep for {seconds} s")
        self.wait_until(self._now_ns + round(seconds * NANOSECONDS))

    def wait_until(self, when_ns: int) -> None:
        """Let time pass until `when_ns`, which is then the bench time even if the wait overran."""
        if self._began_ns is not None:
            while (missing_ns := when_ns - self._present_ns(self._began_ns)) > 0:
                self.pulse()
                self._pause(min(missing_ns / self._speed, _SLICE_NS) / NANOSECONDS)
        self._now_ns = max(self._now_ns, when_ns)

    def boot_s_of(self, when_ns: int) -> float:
        """Return the boot time in s of an instant of bench time, or of the present moment before the clock begins."""
        if self._began_ns is None:
            return self._real_ns() / NANOSECONDS
        return (self._began_ns + (when_ns - self._start_ns) / self._speed) / NANOSECONDS

    def lag_ns(self) -> int:
        """Return how far `look` would advance bench time in ns."""
        return 0 if self._began_ns is None else max(0, self._present_ns(self._began_ns) - self._now_ns)

    def soon_ns(self) -> int:
        """Return the latest end in ns of a wait before the bench must be serviced."""
        present_ns = self._now_ns if self._began_ns is None else self._present_ns(self._began_ns)
        return max(self._now_ns, present_ns) + round(_SLICE_NS * self._speed)

    def _present_ns(self, began_ns: int) -> int:
        return self._start_ns + round((self._real_ns() - began_ns) * self._speed)
