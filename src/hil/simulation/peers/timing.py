"""Timing of peers: scheduled actions, and a device's own clock."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import Cancellable, PeerClock

__all__ = ["Alarm", "Alarms", "BoardClock"]

_PARTS = 10**12
_PARTS_PER_US = _PARTS * 1000


class BoardClock(Stateful):
    """Microseconds since the board's last reset, by a crystal with drift.

    Args:
        drift: rate relative to the bench's clock, minus 1; 0.0001 is 100 ppm fast.
        offset_us: reading at the bench's epoch, before any reset.
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
        """Return the clock's reading at an instant of bench time, in whole elapsed microseconds."""
        return self._offset_us + (when_ns - self._zero_ns) * self._rate // _PARTS_PER_US

    def instants(self, shown_us: int, step_us: int, until_ns: int, most: int) -> list[int]:
        """Return `instant` of the steps after `shown_us` up to `until_ns`, so many at most."""
        zero_ns, offset_us, rate, found = self._zero_ns, self._offset_us, self._rate, []
        for at_us in range(shown_us + step_us, shown_us + (most + 1) * step_us, step_us):
            at_ns = zero_ns - (offset_us - at_us) * _PARTS_PER_US // rate
            if at_ns > until_ns:
                break
            found.append(at_ns)
        return found

    def instant(self, shown_us: int) -> int:
        """Return the first nanosecond of the bench at which the clock shows `shown_us`."""
        return self._zero_ns - (self._offset_us - shown_us) * _PARTS_PER_US // self._rate


class Alarm:
    """A one-shot action, scheduled at most once at a time.

    Args:
        clock: the bench's clock.
        action: what happens.
    """

    __slots__ = ("_action", "_clock", "_event", "due_ns")

    def __init__(self, clock: PeerClock, action: Callable[[], None]) -> None:
        self._clock = clock
        self._action = action
        self._event: Cancellable | None = None
        self.due_ns: int | None = None

    def set(self, when_ns: int) -> None:
        """Schedule it at `when_ns`, replacing any earlier schedule."""
        if self._event is not None:
            self._event.cancel()
        self.due_ns = when_ns
        self._event = self._clock.at(when_ns, self._ring)

    def clear(self) -> None:
        """Cancel it."""
        if self._event is not None:
            self._event.cancel()
        self._event, self.due_ns = None, None

    def state(self) -> list[int] | None:
        """Return when it is due, and its order among simultaneous events; None if not scheduled."""
        return None if self._event is None or self.due_ns is None else [self.due_ns, self._event.number]

    def restore(self, state: object) -> None:
        """Reschedule it from `state`."""
        self.clear()
        if state is not None:
            self.due_ns, number = cast("list[int]", state)
            self._event = self._clock.at(self.due_ns, self._ring, number)

    def _ring(self) -> None:
        self._event, self.due_ns = None, None
        self._action()


class Alarms:
    """A list of one-shot actions, such as the starts of faults.

    Past actions happen at once: a world built after the epoch is restored before time passes.

    Args:
        clock: the bench's clock.
        actions: instants, None for not yet, and what happens then.
    """

    def __init__(self, clock: PeerClock, actions: Sequence[tuple[int | None, Callable[[], None]]]) -> None:
        self._alarms = [Alarm(clock, action) for _, action in actions]
        for place, (when_ns, _) in enumerate(actions):
            self.set(place, when_ns)

    def set(self, place: int, when_ns: int | None) -> None:
        """Schedule one of them at `when_ns`, or cancel it with None."""
        if when_ns is not None:
            self._alarms[place].set(when_ns)

    def state(self) -> list[list[int] | None]:
        """Return the schedules of those still pending."""
        return [alarm.state() for alarm in self._alarms]

    def restore(self, state: object) -> None:
        """Continue from what `state` returned; those that were added after them since then stay as they are."""
        for alarm, due in zip(self._alarms, cast("list[object]", state), strict=False):
            alarm.restore(due)
