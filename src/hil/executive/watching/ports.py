"""What a scheduler lets take turns, and what it reports to."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Protocol

from hil.bench.envelope import Trip
from hil.bench.gate import Gate
from hil.model.figure import Figure

__all__ = ["Beside", "Outside", "Watch"]


class Watch(Protocol):
    """What a scheduler reports to."""

    def reading(self, limit: str, t: float, figure: Figure) -> None:
        """Take one reading of a monitor."""
        ...

    def fed(self, limit: str, recording: str) -> None:
        """Note that every row of a recording is judged against a limit from now on."""
        ...

    def late(self, limit: str, seconds: float) -> None:
        """Note a monitor that took its turn so long after it was due."""
        ...

    def trip(self, trip: Trip) -> None:
        """Make the bench safe; called once, before the case learns of it."""
        ...

    def safe(self) -> None:
        """Make the bench safe."""
        ...

    def give_up(self) -> None:
        """End the run here: the present case never will."""
        ...

    def tick(self) -> None:
        """Do what has to be done every fraction of a wall second: flush, look into the inbox."""
        ...


class Beside(Protocol):
    """Something that takes turns beside a case: a stream that has to be emptied, a role that is sampled."""

    @property
    def due_ns(self) -> int:
        """The bench time of the next turn."""
        ...

    def take(self) -> None:
        """Take the turn; the next one is due later."""
        ...

    def begin_again(self) -> None:
        """Begin anew: the bench was made safe in the meantime."""
        ...


class Outside(Protocol):
    """What a bench outside of this process needs of the machine that drives it, and of people.

    Attributes:
        people: gives the gates that people open.
    """

    people: Callable[[], Iterable[Gate]]

    def gates(self) -> Iterator[Gate]:
        """Yield what has to hold before anything is driven."""
        ...

    def distress(self) -> str:
        """Return why the bench cannot be driven any more, nothing while it can."""
        ...

    def end(self) -> list[str]:
        """Let go of it; return what is not safe."""
        ...

    def latch(self, why: str) -> None:
        """Latch a bench that was not proven safe, so that a named person looks at it before anybody drives it."""
        ...
