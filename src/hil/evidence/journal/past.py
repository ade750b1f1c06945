"""The past of a journal: the events that a resumed run has to repeat before it adds new ones."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import islice
from typing import NoReturn

from hil.evidence.events import Event, Origin, Resumed, Voided
from hil.evidence.events.codec import encode, stamped
from hil.evidence.journal.reader import JournalLine
from hil.model.errors import Diverged

__all__ = ["Entry", "Past", "entries"]

_SHOWN = 300


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """Where a run was resumed after a stop.

    Attributes:
        place: how many events of the run's own course stand up to the one after which it was resumed.
        boundary: the sequence number of that event.
        void_to: the sequence number of the last event that is void; the first is the one after the boundary.
        operations: how many operations the transcript held then; those since the boundary are void, too.
        at: the bench time in s at which it was entered.
        number: the number that the next recording got.
        rows: the void rows of every recording that continued.
        kept: the recording at whose beginning it was resumed and whose rows stand; empty without one.
        over: whether every case had ended, so that nothing was driven any more but the way to the safe state.
    """

    place: int
    boundary: int
    void_to: int
    operations: int
    at: float
    number: int
    rows: tuple[Voided, ...]
    kept: str = ""
    over: bool = False


def entries(events: Iterable[Event]) -> tuple[Entry, ...]:
    """Return where a run was resumed after a stop, in order."""
    return tuple(
        Entry(
            place=event.entry.place,
            boundary=event.entry.boundary,
            void_to=event.entry.void_to,
            operations=event.entry.operations,
            at=event.t,
            number=event.entry.number,
            rows=event.entry.rows,
            kept=event.entry.kept,
            over=bool(event.entry.over),
        )
        for event in events
        if isinstance(event, Resumed) and event.entry
    )


class Past:
    """Events that were written down before.

    Args:
        lines: the journal's lines, from the first event on that is made again.
    """

    def __init__(self, lines: Iterable[JournalLine]) -> None:
        self._lines = deque(lines)

    @property
    def over(self) -> bool:
        """Whether every event that recurs has recurred."""
        return all(line.event.origin is Origin.OUTSIDE for line in self._lines)

    def take(self, event: Event, t: float) -> bool:
        """Return whether the journal holds this event next; False for one that is new.

        Questions and answers recur, but not at their instants, nor in their places among the readings of monitors:
        a person took time, during which the bench was looked after, and who answers from the record takes none.

        Raises:
            Diverged: if the journal holds another one, and none of them comes from outside.
        """
        for place, line in enumerate(self._lines):
            when = line.event.t if event.origin is Origin.PERSON else t
            if encode(stamped(event, line.event.seq, when)) == line.raw:
                self._come_to(place)
                return True
            if line.event.recurs:
                break
        if not self.over and event.origin is not Origin.OUTSIDE:
            self._refuse(event, t)
        return False

    def _come_to(self, place: int) -> None:
        """Take the line at this place, and with it those before it that do not recur."""
        owed = [line for line in islice(self._lines, place) if line.event.origin is Origin.PERSON]
        for _ in range(place + 1):
            self._lines.popleft()
        self._lines.extendleft(reversed(owed))

    def skip(self, last: int) -> None:
        """Pass over the events up to sequence number `last`, which are void."""
        while self._lines and self._lines[0].event.seq <= last:
            self._lines.popleft()

    def _refuse(self, event: Event, t: float) -> NoReturn:
        held = next(line for line in self._lines if line.event.origin is not Origin.OUTSIDE)
        found = encode(stamped(event, held.event.seq, t))
        raise Diverged(
            f"the run came to {_text(found)}, but its journal holds {_text(held.raw)}",
            "seal it as it is with hil seal",
        )


def _text(body: bytes) -> str:
    return body.decode(errors="replace")[:_SHOWN]
