"""The simulated board's time: a clock that is not the bench's."""

from __future__ import annotations

from hil.wire.checkpoint import Kept, Stateful

__all__ = ["BoardClock"]

_PARTS = 10**12
_PARTS_PER_US = _PARTS * 1000


class BoardClock(Stateful):
    """Microseconds since the board's last reset, by a crystal that is a little wrong.

    Args:
        drift: rate against the bench's clock minus 1; 0.0001 is 100 ppm fast.
        offset_us: what it shows at the bench's epoch, before any reset.
    """

    _zero_ns: Kept[int]
    _offset_us: Kept[int]

    def __init__(self, drift: float, offset_us: int) -> None:
        self._rate = _PARTS + round(drift * _PARTS)
        self._offset_us = offset_us
        self._zero_ns = 0

    def reset(self, now_ns: int) -> None:
        """Count from 0 at this instant."""
        self._zero_ns, self._offset_us = now_ns, 0

    def at(self, when_ns: int) -> int:
        """Return what the clock shows at an instant of the bench, whole microseconds that have passed."""
        return self._offset_us + (when_ns - self._zero_ns) * self._rate // _PARTS_PER_US

    def instant(self, shown_us: int) -> int:
        """Return the first nanosecond of the bench at which the clock shows `shown_us`."""
        return self._zero_ns - (self._offset_us - shown_us) * _PARTS_PER_US // self._rate
