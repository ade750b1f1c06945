"""The hands of a simulated bench: what a file or a person says was done there is done in its physics."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from hil.executive.people.answers import SIMULATED_PERSON
from hil.executive.people.questions import Answer, AnswerSource, Question

__all__ = ["ActedOut", "Hands"]


class Hands(Protocol):
    """The simulated person of a simulated bench."""

    def act(self, form: str, name: str, said: str | float | bool) -> None:
        """Do what somebody says was done."""
        ...


class ActedOut:
    """Lets the simulated person do what others answer; what it answers itself, it has done already.

    Args:
        source: who answers.
        hands: returns the simulated person. None where there is none: on a bench outside this process, in a replay,
            and on a resumed bench before it continues.
    """

    def __init__(self, source: AnswerSource, hands: Callable[[], Hands | None]) -> None:
        self._source = source
        self._hands = hands

    def answer(self, question: Question) -> Answer:
        """Answer as the source does, and do what was answered.

        Raises:
            Refused: if the simulated bench has no such thing.
        """
        answer = self._source.answer(question)
        hands = self._hands()
        if hands is not None and answer.by != SIMULATED_PERSON:
            hands.act(question.form, question.name, answer.value)
        return answer
