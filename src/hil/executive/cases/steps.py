"""Steps: named parts of a case that make the as-run procedure."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Literal

from hil.documents.text import one_line
from hil.evidence import events
from hil.evidence.events import EventSink
from hil.executive.cases.escapes import OfThisProcess

__all__ = ["Steps", "file_part"]

Outcome = Literal["done", "raised"]


def file_part(text: str) -> str:
    """Return a case's id, or a name given by a case, in a form for file names."""
    return re.sub(r"[^A-Za-z0-9_]+", "-", text.rpartition("::")[2]).strip("-")[:60]


class Steps(OfThisProcess):
    """Numbers nested steps and writes their beginning and end.

    Args:
        case: the case's id.
        journal: where events are written.
        now: bench time in seconds.
        undisturbed: prevents the watching of the bench from moving its time while a step begins or ends.

    Attributes:
        number: the number of the present step, such as `1.2`; empty outside steps.
    """

    said = "`step`"

    def __init__(
        self,
        case: str,
        journal: EventSink,
        now: Callable[[], float],
        undisturbed: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        self.case = case
        self._journal = journal
        self._now = now
        self._undisturbed = undisturbed
        self._titles: list[str] = []
        self._began: list[float] = []
        self._counts = [0]
        self.number = ""

    @contextmanager
    def __call__(self, title: str, turn: int | None = None) -> Iterator[None]:
        """Enter a step; steps nest, and leaving a step leaves those inside it.

        Args:
            title: what is done in it.
            turn: which turn of a loop it is, from 1; a stopped run can be re-entered at its beginning.
        """
        with self._undisturbed():
            began = self._now()  # first of all, because it refuses other threads
            depth = len(self._titles)
            del self._counts[depth + 1 :]
            self._counts[depth] += 1
            self._titles.append(one_line(title))
            self._began.append(began)
            self._counts.append(0)
            self._count()
            self._journal.write(events.Step(case=self.case, path=tuple(self._titles), number=self.number, turn=turn))
        mine = self._counts[: depth + 1]
        outcome: Outcome = "raised"
        try:
            yield
            outcome = "done"
        finally:
            if self._counts[: depth + 1] == mine:
                self._leave(depth, outcome)

    def close(self) -> None:
        """End every step that is still open: those of a loop left by an exception while the case keeps its iterator."""
        self._leave(0, "raised")

    def _leave(self, depth: int, outcome: Outcome) -> None:
        while len(self._titles) > depth:
            self._end(depth, outcome)

    def _end(self, depth: int, outcome: Outcome) -> None:
        with self._undisturbed():
            last = len(self._titles) == depth + 1
            duration = round(self._now() - self._began.pop(), 9)
            ended = events.StepEnd(
                case=self.case,
                path=tuple(self._titles),
                number=self.number,
                outcome=outcome if last else "raised",
                duration=duration,
            )
            try:
                self._journal.write(ended)
            finally:
                self._titles.pop()
                self._count()

    def _count(self) -> None:
        self.number = ".".join(str(count) for count in self._counts[: len(self._titles)])
