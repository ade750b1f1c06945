"""The past of a journal: the events that a resumed run has to come to again before it adds new ones."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from typing import NoReturn

from hil.evidence.journal.quick_json import quick_canonical
from hil.evidence.journal.reader import JournalLine
from hil.model.errors import Diverged

__all__ = ["FROM_OUTSIDE", "Past"]

FROM_OUTSIDE = frozenset(
    {
        "anomaly",
        "attachment",
        "clock-jump",
        "hold",
        "hold-asked",
        "hold-end",
        "hold-refused",
        "note",
        "notified",
        "notify-failed",
        "reboot",
        "recovered",
        "resumed",
        "suspended",
    }
)
"""Kinds that something outside of the run's own course may have caused; they do not come again."""

_SHOWN = 300


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

        Raises:
            Diverged: if the journal holds another one, and none of them comes from outside.
        """
        for place, line in enumerate(self._lines):
            if quick_canonical({**fields, "seq": line.body["seq"], "t": round(t, 9), "kind": kind}) == line.raw:
                for _ in range(place + 1):
                    self._lines.popleft()
                return True
            if line.body["kind"] not in FROM_OUTSIDE:
                break
        if not self.over and kind not in FROM_OUTSIDE:
            self._refuse(kind, t, fields)
        return False

    def _refuse(self, kind: str, t: float, fields: Mapping[str, object]) -> NoReturn:
        found = quick_canonical({**fields, "t": round(t, 9), "kind": kind})
        held = next(line.raw for line in self._lines if line.body["kind"] not in FROM_OUTSIDE)
        raise Diverged(
            f"the run came to {_text(found)}, but its journal holds {_text(held)}", "seal it as it is with hil seal"
        )


def _text(body: bytes) -> str:
    return body.decode(errors="replace")[:_SHOWN]
