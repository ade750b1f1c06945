"""The past of a journal: the events that a resumed run has to repeat before it adds new ones."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from itertools import islice
from typing import NoReturn

from hil.evidence.events import Entry, Event, Origin, Resumed
from hil.evidence.events.codec import encode, stamped
from hil.evidence.journal.reader import JournalLine
from hil.model.errors import Diverged

__all__ = ["Past", "entries"]

_SHOWN = 300


def entries(events: Iterable[Event]) -> tuple[tuple[Entry, float], ...]:
    """Return the points at which a run was resumed after a stop, in order, each with the bench time in s."""
    return tuple((event.entry, event.t) for event in events if isinstance(event, Resumed) and event.entry)


class Past:
    """Events recorded before an interruption.

    Args:
        lines: the journal's lines, from the first event that is repeated.
    """

    def __init__(self, lines: Iterable[JournalLine]) -> None:
        self._lines = deque(lines)

    @property
    def over(self) -> bool:
        """Whether every event that recurs has recurred."""
        return all(line.event.origin is Origin.OUTSIDE for line in self._lines)

    def take(self, event: Event, t: float) -> bool:
        """Return whether this event is the next one in the journal; False for a new one.

        Questions and answers recur, but not at the same instants, nor in the same places among the readings of
        monitors: a person took time, during which the bench was watched, and answers from the record take none.

        Raises:
            Diverged: if the journal holds a different one, and neither comes from outside.
        """
        for place, line in enumerate(self._lines):
            when = line.event.t if event.origin is Origin.PERSON else t
            if encode(stamped(event, line.event.seq, when)) == line.raw:
                self._take_up_to(place)
                return True
            if line.event.recurs:
                break
        if not self.over and event.origin is not Origin.OUTSIDE:
            self._refuse(event, t)
        return False

    def _take_up_to(self, place: int) -> None:
        """Take the line at this place, and those before it that do not recur."""
        owed = [line for line in islice(self._lines, place) if line.event.origin is Origin.PERSON]
        for _ in range(place + 1):
            self._lines.popleft()
        self._lines.extendleft(reversed(owed))

    def skip(self, last: int) -> None:
        """Skip the events up to sequence number `last`, which are void."""
        while self._lines and self._lines[0].event.seq <= last:
            self._lines.popleft()

    def _refuse(self, event: Event, t: float) -> NoReturn:
        held = next(line for line in self._lines if line.event.origin is not Origin.OUTSIDE)
        found = encode(stamped(event, held.event.seq, t))
        raise Diverged(
            f"the run gave {_text(found)}, but its journal holds {_text(held.raw)}",
            "seal it as it is with hil seal",
        )


def _text(body: bytes) -> str:
    return body.decode(errors="replace")[:_SHOWN]
