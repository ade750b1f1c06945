"""The past of a journal: the events that a resumed run has to come to again before it adds new ones."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from itertools import islice
from typing import NoReturn

from hil.evidence.journal.quick_json import quick_canonical
from hil.evidence.journal.reader import JournalLine
from hil.model.errors import Diverged

__all__ = ["FROM_OUTSIDE", "Past", "is_of_course"]

FROM_OUTSIDE = frozenset(
    {
        "acknowledged",
        "anomaly",
        "asked-again",
        "attachment",
        "called",
        "clock-jump",
        "confirmed",
        "hold",
        "hold-asked",
        "hold-end",
        "hold-refused",
        "host-gate",
        "note",
        "notified",
        "notify-failed",
        "reached",
        "reboot",
        "recovered",
        "resumed",
        "suspended",
    }
)
"""Kinds that something outside of the run's own course may have caused; they do not come again."""

_ANSWERED = frozenset({"answer", "question"})
"""A replay answers from its record, and asks nobody."""

_SHOWN = 300


def is_of_course(kind: str) -> bool:
    """Return whether events of this kind come again in every run of the same course, its replay included."""
    return kind not in FROM_OUTSIDE and kind not in _ANSWERED


class Past:
    """Events that were written down before.

    Args:
        lines: the journal's lines, from the first event on that is made again.
    """

    def __init__(self, lines: Iterable[JournalLine]) -> None:
        self._lines = deque(lines)

    @property
    def over(self) -> bool:
        """Whether every event that comes again has come."""
        return all(line.body["kind"] in FROM_OUTSIDE for line in self._lines)

    def take(self, kind: str, t: float, fields: Mapping[str, object]) -> bool:
        """Return whether the journal holds this event next; False for one that is new.

        Questions and answers come again, but not at their instants, nor in their places among the readings of monitors:
        a person took time, in which the bench was looked after, and who answers from the record takes none.

        Raises:
            Diverged: if the journal holds another one, and none of them comes from outside.
        """
        for place, line in enumerate(self._lines):
            when = line.body["t"] if kind in _ANSWERED else round(t, 9)
            if quick_canonical({**fields, "seq": line.body["seq"], "t": when, "kind": kind}) == line.raw:
                self._come_to(place)
                return True
            if line.body["kind"] not in FROM_OUTSIDE | _ANSWERED:
                break
        if not self.over and kind not in FROM_OUTSIDE:
            self._refuse(kind, t, fields)
        return False

    def _come_to(self, place: int) -> None:
        """Let the line at this place have come, and with it those before it that do not come again."""
        owed = [line for line in islice(self._lines, place) if line.body["kind"] in _ANSWERED]
        for _ in range(place + 1):
            self._lines.popleft()
        self._lines.extendleft(reversed(owed))

    def skip(self, last: int) -> None:
        """Pass over the events up to sequence number `last`, which are void."""
        while self._lines and self._lines[0].body["seq"] <= last:
            self._lines.popleft()

    def _refuse(self, kind: str, t: float, fields: Mapping[str, object]) -> NoReturn:
        found = quick_canonical({**fields, "t": round(t, 9), "kind": kind})
        held = next(line.raw for line in self._lines if line.body["kind"] not in FROM_OUTSIDE)
        raise Diverged(
            f"the run came to {_text(found)}, but its journal holds {_text(held)}", "seal it as it is with hil seal"
        )


def _text(body: bytes) -> str:
    return body.decode(errors="replace")[:_SHOWN]
