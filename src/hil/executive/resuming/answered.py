"""The answers of an interrupted run: nobody is asked a second time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

from hil.evidence.events import Answer as Given
from hil.evidence.events import Effect, Event
from hil.evidence.journal.reader import JournalLine
from hil.evidence.state import standing
from hil.executive.people.answers import SIMULATED_PERSON
from hil.executive.people.questions import Answer, AnswerSource, Declined, Question
from hil.model.errors import Diverged

__all__ = ["Answered"]


class Answered:
    """The answers that persons gave before the interruption: nobody is asked a second time.

    The simulated person is: what it does with its hands belongs to a world that goes on from before it did it.

    Args:
        lines: the journal's lines.
        source: who answers what is new.
        goes_on: tells whether the simulated world goes on already.
    """

    def __init__(self, lines: Sequence[JournalLine], source: AnswerSource, goes_on: Callable[[], bool]) -> None:
        self._told = deque(filter(_is_answer, standing([line.event for line in lines])))
        self._source = source
        self._goes_on = goes_on

    def answer(self, question: Question) -> Answer:
        """Answer as it was answered then."""
        if not self._told:
            return self._source.answer(question)
        told = self._told.popleft()
        if not isinstance(told, Given):
            raise Declined(f"'{question.name}' was declined before the run was interrupted")
        if told.name != question.name:
            raise Diverged(f"the case asks '{question.name}', but its journal holds an answer to '{told.name}'")
        if told.by == SIMULATED_PERSON and self._goes_on():
            return self._source.answer(question)
        return Answer(told.value, told.by)


def _is_answer(event: Event) -> bool:
    declined = isinstance(event, Effect) and event.effect == "asks" and event.raised == Declined.__name__
    return declined or isinstance(event, Given)
