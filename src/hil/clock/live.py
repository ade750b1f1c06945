"""The clock of a bench that lives outside this process: boot time, which stands still between operations."""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import timedelta

from hil.clock import wall
from hil.clock.port import NANOSECONDS, ClockError

__all__ = ["LiveClock"]

_SLICE_NS = 100_000_000
"""How long a wait lasts at most before it looks up."""


class LiveClock:
    """Bench time that follows boot time, but moves on only where somebody looks, and where a wait ends.

    All that a run learns of time then comes from its waits, which end at the instant they were for, and from its port
    operations, whose ends are in the transcript. So its record contains all that a replay has to know. See ADR 0037.
    Until it begins nobody waits: a resumed run catches up with its past in no time.

    Args:
        epoch: UTC of the bench's time zero, ISO 8601.
        speed: seconds of the bench in one second of boot time; other than 1 for a served bench only.
        real_ns: returns boot time.
        pause: lets seconds of boot time pass, or less.

    Attributes:
        pulse: called wherever the clock is looked at, and about ten times a second while it waits.
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
        """Follow boot time from here on."""
        self._start_ns, self._began_ns = self._now_ns, self._real_ns()

    def now_ns(self) -> int:
        """Return the bench time of the last operation or wait."""
        return self._now_ns

    def now(self) -> float:
        """Return the same in seconds."""
        return self._now_ns / NANOSECONDS

    def look(self) -> int:
        """Return the bench time of this moment; from here on `now_ns` returns it, too."""
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
        """Let time pass until `when_ns`, which is then the bench time however late it is."""
        if self._began_ns is not None:
            while (missing_ns := when_ns - self._present_ns(self._began_ns)) > 0:
                self.pulse()
                self._pause(min(missing_ns / self._speed, _SLICE_NS) / NANOSECONDS)
        self._now_ns = max(self._now_ns, when_ns)

    def boot_s_of(self, when_ns: int) -> float:
        """Return the boot time in s of an instant of bench time, of this moment where the clock has not begun."""
        if self._began_ns is None:
            return self._real_ns() / NANOSECONDS
        return (self._began_ns + (when_ns - self._start_ns) / self._speed) / NANOSECONDS

    def behind_ns(self) -> int:
        """Return how much `look` would move the bench time on."""
        return 0 if self._began_ns is None else max(0, self._present_ns(self._began_ns) - self._now_ns)

    def soon_ns(self) -> int:
        """Return until when a wait may last before somebody has to look after the bench."""
        present_ns = self._now_ns if self._began_ns is None else self._present_ns(self._began_ns)
        return max(self._now_ns, present_ns) + round(_SLICE_NS * self._speed)

    def _present_ns(self, began_ns: int) -> int:
        return self._start_ns + round((self._real_ns() - began_ns) * self._speed)
