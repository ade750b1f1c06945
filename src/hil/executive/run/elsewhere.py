"""Answers from another terminal: a question waits, and takes what a person says to it there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from hil.executive.case.operator import Answer, Question
from hil.executive.run.wording import form, understood

__all__ = ["Elsewhere"]


class Elsewhere:
    """Where a question waits for an answer through the run's inbox (`hil answer`).

    Attributes:
        answer: what was said to the question that waits, None as long as nobody did, and while none waits.
    """

    def __init__(self) -> None:
        self._question: Question | None = None
        self.answer: Answer | None = None

    @contextmanager
    def asks(self, question: Question) -> Iterator[None]:
        """Let a question wait."""
        self._question = question
        try:
            yield
        finally:
            self._question = self.answer = None

    def take(self, name: str, text: str, by: str) -> str:
        """Take what somebody says to the question of this name; return why that is not taken, nothing if it is."""
        question = self._question
        if question is None or question.name != name or self.answer is not None:
            return f"'{name}' is not asked now"
        if not by.strip():
            return f"'{name}' was answered without a name"
        value = understood(question, text)
        if value is None:
            return f"'{text}' is no answer to '{name}', which takes {form(question)}"
        self.answer = Answer(value, by.strip())
        return ""
