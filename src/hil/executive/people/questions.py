"""Questions to a person: what is asked, what a line means as the answer, and an answer from another terminal."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

from hil.model.errors import HilError

__all__ = ["Answer", "AnswerSource", "Declined", "Elsewhere", "Question", "form", "spoken", "understood"]

_PERHAPS_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
"""A comma that may be a decimal sign or not: nobody guesses a factor of 1000."""

_YES = frozenset({"true", "y", "yes"})
_NO = frozenset({"false", "n", "no"})


class Declined(HilError):
    """The person said no, or nobody was there to answer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """One question.

    Attributes:
        name: its name in answer files, unique in its case by its ordinal.
        form: `confirm`, `choose`, `measure` or `attach`.
        text: what the person reads.
        options: for `choose` and `attach`, what can be answered.
        unit: for `measure`, the unit of the number.
        safety: whether somebody's safety hangs on it: on a bench outside this process a person answers it live.
        instrument: for `measure`, the name of what is read in the register of instruments; the text tells it.
    """

    name: str
    form: str
    text: str
    options: tuple[str, ...] = ()
    unit: str = ""
    safety: bool = False
    instrument: str = ""


@dataclass(frozen=True, slots=True)
class Answer:
    """What was answered, and by whom; who is never empty."""

    value: str | float | bool
    by: str


class AnswerSource(Protocol):
    """Somebody, or something, that answers."""

    def answer(self, question: Question) -> Answer:
        """Answer, or raise Declined with what to do."""
        ...


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
            return f"'{name}' is not being asked now"
        if not by.strip():
            return f"'{name}' was answered without a name"
        value = understood(question, text)
        if value is None:
            return f"'{text}' is not an answer to '{name}', which takes {form(question)}"
        self.answer = Answer(value, by.strip())
        return ""


def spoken(question: Question) -> str:
    """Return the question with what can be answered."""
    return f"{question.text} [{form(question)}]"


def form(question: Question) -> str:
    """Return what can be answered, in words."""
    match question.form:
        case "confirm":
            return "yes or no"
        case "measure":
            return f"a number in {question.unit}, such as 1.5"
        case "attach":
            return "yes when it is done"
        case _:
            return " or ".join(question.options)


def understood(question: Question, line: str) -> str | float | bool | None:
    """Return the answer that a line gives, None if it gives none."""
    said = line.strip()
    match question.form:
        case "confirm":
            return True if said.lower() in _YES else False if said.lower() in _NO else None
        case "attach" if said.lower() in _YES:
            return question.options[0]
        case "measure":
            return _number(said)
        case _:
            return said if said in question.options else None


def _number(said: str) -> float | None:
    if _PERHAPS_THOUSANDS.fullmatch(said) or "_" in said:
        return None
    try:
        number = float(said.replace(",", "."))
    except ValueError:
        return None
    return number if math.isfinite(number) else None
