"""Places in the course of a run: where a replay finds what nobody asked for."""

from __future__ import annotations

from typing import Protocol

from hil.wire.replay import Place

__all__ = ["Course", "Places"]


class Course(Protocol):
    """The events of a run."""

    @property
    def course(self) -> int:
        """How many events of the run's own course there are."""
        ...


class Places:
    """Numbers the places of a run's course, live as in a replay.

    A case passes points, and waits, in a replay as it did live. After each of them time may go on by itself.

    Args:
        events: know their number.
    """

    def __init__(self, events: Course) -> None:
        self._events = events
        self._course = self._entered = 0

    def here(self) -> Place:
        """Return the present place."""
        if self._course != self._events.course:
            self._course, self._entered = self._events.course, 0
        return Place(self._course, self._entered)

    def enter(self) -> None:
        """Come to the next point or wait of the case."""
        self.here()
        self._entered += 1
