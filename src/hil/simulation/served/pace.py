"""How the virtual clock of a served bench follows wall time."""

from __future__ import annotations

from collections.abc import Callable

from hil.clock.port import NANOSECONDS
from hil.clock.virtual import VirtualClock

__all__ = ["Pace"]

_STEP_NS = NANOSECONDS
_BUDGET_S = 0.1


class Pace:
    """Moves a virtual clock up to the scaled wall time, and never beyond it.

    A world that cannot keep up slips: what it could not live through within a tenth of a second of computing is not
    caught up with, so that its clients go on being served. A pause of the process is caught up with where that is
    quick.

    Args:
        wall: seconds on a clock that only goes forward.
        speed: seconds of the bench in one second of the wall.
        now_ns: where the bench's clock stands now.

    Attributes:
        slipped_s: seconds of the wall that the world could not keep up with so far.
    """

    def __init__(self, wall: Callable[[], float], speed: float, now_ns: int = 0) -> None:
        self.speed = speed
        self.slipped_s = 0.0
        self._wall = wall
        self._origin_s = wall() - now_ns / NANOSECONDS / speed

    def present_ns(self) -> int:
        """Return the bench's time that it should be now."""
        return int((self._wall() - self._origin_s) * self.speed * NANOSECONDS)

    def seconds_until(self, when_ns: int) -> float:
        """Return the seconds of the wall until an instant of the bench, 0 if it has come."""
        return max(0.0, when_ns / NANOSECONDS / self.speed - (self._wall() - self._origin_s))

    def follow(self, clock: VirtualClock) -> None:
        """Let everything happen on the bench that is due by now."""
        present_ns, enough_s = self.present_ns(), self._wall() + _BUDGET_S
        while clock.now_ns() < present_ns:
            # In steps, because a plant lives through a wait without events as a whole.
            clock.run(min(present_ns, clock.now_ns() + _STEP_NS), lambda: self._wall() > enough_s, "the served bench")
            if self._wall() > enough_s and clock.now_ns() < present_ns:
                self._slip((present_ns - clock.now_ns()) / NANOSECONDS / self.speed)
                return

    def _slip(self, seconds: float) -> None:
        self._origin_s += seconds
        self.slipped_s += seconds
