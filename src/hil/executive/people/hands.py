"""Hands of a simulated bench: what a file or a person says was done is carried out in its physics."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from hil.executive.people.answers import SIMULATED_PERSON
from hil.executive.people.questions import Answer, AnswerSource, Question

__all__ = ["ActedOut", "Hands"]


class Hands(Protocol):
    """The simulated person of a simulated bench."""

    def act(self, form: str, name: str, said: str | float | bool) -> None:
        """Carry out what somebody says was done."""
        ...


class ActedOut:
    """Lets the simulated person carry out the answers of others; its own it has carried out already.

    Args:
        source: answers.
        hands: returns the simulated person, or None if there is none: on a bench outside this process, in a replay,
            and on a resumed bench before it continues.
    """

    def __init__(self, source: AnswerSource, hands: Callable[[], Hands | None]) -> None:
        self._source = source
        self._hands = hands

    def answer(self, question: Question) -> Answer:
        """Answer as the source does, and carry out the answer.

        Raises:
            Refused: if the simulated bench cannot do that.
        """
        answer = self._source.answer(question)
        hands = self._hands()
        if hands is not None and answer.by != SIMULATED_PERSON:
            hands.act(question.form, question.name, answer.value)
        return answer
