"""What happens to the clocks of this machine while a run goes on: it was suspended, its time of day was set."""

from __future__ import annotations

from collections.abc import Callable

from hil.clock import wall

__all__ = ["Timekeeping"]

_NOTICED_S = 1.0


class Timekeeping:
    """Compares three clocks: one that stands while the machine is suspended, one that does not, and the time of day.

    Args:
        write: writes an event.
        clocks: tells what they say.
    """

    def __init__(self, write: Callable[..., None], clocks: Callable[[], wall.Clocks] = wall.clocks) -> None:
        self._write = write
        self._clocks = clocks
        self._before = clocks()

    def tick(self) -> None:
        """Look at the clocks and write down what one of them did alone since the last look."""
        before, now = self._before, self._clocks()
        self._before = now
        boot = now.boot - before.boot
        suspended = boot - (now.awake - before.awake)
        jumped = (now.day - before.day) - boot
        if suspended > _NOTICED_S:
            self._write("suspended", text="the machine was suspended", seconds=round(suspended, 1))
        if abs(jumped) > _NOTICED_S:
            self._write("clock-jump", text="the machine's time of day was set", seconds=round(jumped, 1))
