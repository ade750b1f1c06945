"""The watch behind the last safe-off: whether what was switched off behaves like something that is off."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import isnan, nan

from hil.bench.safe_off import SafeResult
from hil.clock.port import NANOSECONDS, Clock
from hil.model.cutting import WatchAfter
from hil.model.errors import HilError
from hil.model.figure import Figure
from hil.model.prefixed import prefixed

__all__ = ["EVERY_S", "WATCHED", "watch_after"]

EVERY_S = 5.0
"""How far its readings are apart; a few more seconds where an instrument is slow to answer."""

WATCHED = "watched"
"""What stands in the place of the state of a line of the safe-off."""

_CLOSER = 0.9
"""What goes toward a value has at most this part of its longest distance left in the end."""

Reading = Callable[[WatchAfter, float, float], None]
"""Takes what was read: of which line, at which bench time [s], and the value, NaN where there was none."""


def watch_after(
    watches: Sequence[WatchAfter],
    roles: Mapping[str, object],
    clock: Clock,
    reading: Reading,
    tell: Callable[[SafeResult], None],
) -> bool:
    """Watch every line for its time, all of them at once, and return whether they hold.

    A line holds that stays between its bounds, or that comes to, or closer to, the value to which it goes by itself.
    An output that cannot be read in the end was not seen to be safe.

    Args:
        watches: the lines of the bench file.
        roles: the role instances by their dotted names.
        clock: the bench's clock.
        reading: is told every reading.
        tell: called with every result as soon as it is known.
    """
    start_ns = clock.now_ns()
    under_way = [_Line(watch) for watch in watches]
    held = True
    while under_way:
        for line in tuple(under_way):
            line.take(roles[line.watch.output], clock, reading)
            seconds = (clock.now_ns() - start_ns) / NANOSECONDS
            if line.beyond or seconds >= line.watch.seconds:
                under_way.remove(line)
                ok, detail = line.judged()
                held = held and ok
                tell(SafeResult(line.watch.output, WATCHED, ok, detail, seconds))
        if under_way:
            clock.sleep(EVERY_S)
    return held


class _Line:
    """One line with what was read so far."""

    def __init__(self, watch: WatchAfter) -> None:
        self.watch = watch
        self.beyond = False
        self._first = self._last = self._farthest = nan
        self._trouble = ""

    def take(self, role: object, clock: Clock, reading: Reading) -> None:
        """Read once."""
        watch = self.watch
        try:
            figure: Figure = getattr(role, watch.quantity)()
            self._last, self._trouble = figure.value, ""
        except HilError as error:
            self._last, self._trouble = nan, str(error)
        if isnan(self._first):
            self._first = self._farthest = self._last
        if watch.toward is not None and abs(self._last - watch.toward) > abs(self._farthest - watch.toward):
            self._farthest = self._last
        reading(watch, clock.now(), self._last)
        if watch.minimum is not None and watch.maximum is not None and not isnan(self._last):
            self.beyond = not watch.minimum <= self._last <= watch.maximum

    def judged(self) -> tuple[bool, str]:
        """Return whether it holds, and what was seen."""
        watch = self.watch
        if self._trouble or isnan(self._last):
            return False, f"its {watch.quantity} could not be read: {self._trouble or 'no number came'}"
        way = [self._first, self._farthest, self._last] if watch.toward is not None else [self._first, self._last]
        came = f"its {watch.quantity} went {' to '.join(prefixed(value, watch.unit) for value in dict.fromkeys(way))}"
        if watch.toward is None:
            bounds = f"{watch.minimum:g} to {watch.maximum:g} {watch.unit}"
            return not self.beyond, f"{came}, {bounds} {'is' if self.beyond else 'was'} safe"
        if self._comes(watch.toward):
            return True, came
        return False, f"{came}, and not toward {watch.toward:g} {watch.unit}: something still drives it"

    def _comes(self, toward: float) -> bool:
        before, behind = self._farthest - toward, self._last - toward
        same_side = before * behind > 0
        return abs(behind) <= (self.watch.tolerance or 0.0) or (same_side and abs(behind) <= _CLOSER * abs(before))
