"""Things that a peer does later: they survive a restore, their order among others of the same instant included."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

from hil.wire.peer import Cancellable, PeerClock

__all__ = ["Alarm", "Alarms"]


class Alarm:
    """One thing that happens later, at most once at a time.

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
        """Let it happen at `when_ns`, and not when it was due before."""
        if self._event is not None:
            self._event.cancel()
        self.due_ns = when_ns
        self._event = self._clock.at(when_ns, self._ring)

    def clear(self) -> None:
        """Let it not happen."""
        if self._event is not None:
            self._event.cancel()
        self._event, self.due_ns = None, None

    def state(self) -> list[int] | None:
        """Return when it is due, and its place among all events of that instant; None is never."""
        return None if self._event is None or self.due_ns is None else [self.due_ns, self._event.number]

    def restore(self, state: object) -> None:
        """Be due as `state` says it."""
        self.clear()
        if state is not None:
            self.due_ns, number = cast("list[int]", state)
            self._event = self._clock.at(self.due_ns, self._ring, number)

    def _ring(self) -> None:
        self._event, self.due_ns = None, None
        self._action()


class Alarms:
    """Things that happen once each, such as the begin of a fault.

    What lies in the past happens at once: a world that is built later than the epoch is restored before time passes.

    Args:
        clock: the bench's clock.
        actions: instants, None for not yet, and what happens then.
    """

    def __init__(self, clock: PeerClock, actions: Sequence[tuple[int | None, Callable[[], None]]]) -> None:
        self._alarms = [Alarm(clock, action) for _, action in actions]
        for place, (when_ns, _) in enumerate(actions):
            self.set(place, when_ns)

    def set(self, place: int, when_ns: int | None) -> None:
        """Let one of them happen at `when_ns`, None for not at all."""
        if when_ns is not None:
            self._alarms[place].set(when_ns)

    def state(self) -> list[list[int] | None]:
        """Return which of them are still to come."""
        return [alarm.state() for alarm in self._alarms]

    def restore(self, state: object) -> None:
        """Go on from what `state` returned; those that were added behind them since then stay as they are."""
        for alarm, due in zip(self._alarms, cast("list[object]", state), strict=False):
            alarm.restore(due)
