"""Who answers questions: an answers file, the simulated person, or a person at the terminal."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from hil.bench.bound import BoundBench
from hil.documents.declared import read_document
from hil.documents.findings import Findings
from hil.documents.suggest import did_you_mean, nearest
from hil.evidence.events import Answer as Given
from hil.evidence.events import Effect, Event
from hil.evidence.journal.reader import JournalLine
from hil.evidence.state import standing
from hil.executive.people.questions import Answer, AnswerSource, Declined, Elsewhere, Question, form, spoken, understood
from hil.model.errors import Diverged
from hil.model.notation import Text

__all__ = [
    "SIMULATED_PERSON",
    "Answered",
    "Answering",
    "AnswersFile",
    "AskedLive",
    "FirstOf",
    "Nobody",
    "NobodyLive",
    "Prompt",
    "SimulatedPerson",
    "TerminalPerson",
    "load_answers",
]

SIMULATED_PERSON = "simulated person"
"""The name under which the simulated bench's own person answers."""

Answering = Callable[[BoundBench, Callable[[], None], Elsewhere], AnswerSource]
"""Makes what answers a run's questions, from its bench, the scheduling point to pass while waiting, and elsewhere."""

_SCHEMA = "hil/answers/1"
_SOMEBODY = "person at the terminal"


class Prompt(Protocol):
    """A terminal at which a person sits."""

    def show(self, text: str) -> None:
        """Show a line."""
        ...

    def discard(self) -> None:
        """Throw away what was typed so far, and say so."""
        ...

    def line(self) -> str | None:
        """Return a line with its newline if one was entered, None if not yet, an empty text at the end of input.

        It waits a fraction of a second at most.
        """
        ...


class Person(Protocol):
    """The simulated person of a simulated bench."""

    def answer(self, form: str, name: str, text: str, options: Sequence[str]) -> str | float | bool:
        """Answer from what is true in the simulated world."""
        ...


class AnswersFile:
    """Answers by name, prepared for a run that nobody attends.

    Args:
        answers: name of the question to the answer.
        shown: the file, for messages.
    """

    def __init__(self, answers: Mapping[str, str], shown: str) -> None:
        self._answers = answers
        self._shown = shown

    def answer(self, question: Question) -> Answer:
        """Answer from the file."""
        if question.name not in self._answers:
            hint = did_you_mean(question.name, self._answers)
            raise Declined(
                f"{self._shown} has no answer to '{question.name}'{hint}", f"the question was: {question.text}"
            )
        value = understood(question, self._answers[question.name])
        if value is None:
            raise Declined(
                f"{self._shown} answers '{self._answers[question.name]}' to '{question.name}'",
                f"answer {form(question)}; the question was: {question.text}",
            )
        return Answer(value, "answers file")


class SimulatedPerson:
    """The simulated bench's own person.

    Args:
        person: returns it; on a resumed bench there is none before the bench continues.
    """

    def __init__(self, person: Callable[[], Person]) -> None:
        self._person = person

    def answer(self, question: Question) -> Answer:
        """Answer from what is true in the simulated world."""
        value = self._person().answer(question.form, question.name, question.text, question.options)
        return Answer(value, SIMULATED_PERSON)


class TerminalPerson:
    """A person at the terminal; monitors and stop requests are served while an answer is awaited.

    A safety confirmation is answered by what is typed once it is shown, never by what was typed ahead.

    Args:
        prompt: the terminal.
        name: the person's name; asked for, with a safety confirmation, where it is empty.
        idle: the scheduling point to pass while waiting.
        elsewhere: takes the answer of a person at another terminal, who may be first.
    """

    def __init__(self, prompt: Prompt, name: str, idle: Callable[[], None], elsewhere: Elsewhere | None = None) -> None:
        self._prompt = prompt
        self._name = name
        self._idle = idle
        self._elsewhere = elsewhere or Elsewhere()

    def answer(self, question: Question) -> Answer:
        """Show the question and wait for a line that answers it, here or elsewhere.

        Raises:
            Declined: if the input has ended, so that no line will ever come.
        """
        with self._elsewhere.asks(question):
            if question.safety:
                self._prompt.discard()
            self._prompt.show(spoken(question))
            said = self._said(question)
        return said if isinstance(said, Answer) else Answer(said, self._name or self._named(question))

    def _said(self, question: Question) -> Answer | str | float | bool:
        while True:
            line = self._line()
            if self._elsewhere.answer is not None:
                return self._elsewhere.answer
            if not line:
                raise Declined(f"'{question.text}' was not answered: the terminal's input has ended")
            value = understood(question, line)
            if value is not None:
                return value
            self._prompt.show(f"Please answer {form(question)}")

    def _named(self, question: Question) -> str:
        name = "" if question.safety else _SOMEBODY
        while not name:
            self._prompt.show("Your name:")
            if not (line := self._line()):
                raise Declined(f"'{question.text}' was answered without a name: the terminal's input has ended")
            name = line.strip()
        return name

    def _line(self) -> str:
        """Return what was typed, nothing at the end of input and once the question is answered elsewhere."""
        while (line := self._prompt.line()) is None and self._elsewhere.answer is None:
            self._idle()
        return line or ""


class Nobody:
    """What answers where nobody can."""

    def answer(self, question: Question) -> Answer:
        """Decline, and say what to do."""
        raise Declined(
            f"'{question.text}' needs a person, and there is no terminal",
            f"run from a terminal, or give an answer to '{question.name}' with --answers FILE",
        )


class NobodyLive:
    """What answers safety confirmations where no person can."""

    def answer(self, question: Question) -> Answer:
        """Decline, and say what to do."""
        raise Declined(
            f"'{question.text}' is a safety confirmation: a person gives it live, by name, at each arm",
            "run from a terminal; on a bench outside this process neither a file nor the simulated person can give it",
        )


class AskedLive:
    """Lets a safety confirmation be given by a person only, whatever answers everything else.

    Args:
        person: the person, or `NobodyLive`.
        otherwise: answers all other questions.
    """

    def __init__(self, person: AnswerSource, otherwise: AnswerSource) -> None:
        self._person = person
        self._otherwise = otherwise

    def answer(self, question: Question) -> Answer:
        """Answer, or let the person answer."""
        return (self._person if question.safety else self._otherwise).answer(question)


class FirstOf:
    """The first source that knows the question answers; the last one decides what is said if none does."""

    def __init__(self, first: AnswersFile, last: AnswerSource, known: frozenset[str]) -> None:
        self._first = first
        self._last = last
        self._known = known

    def answer(self, question: Question) -> Answer:
        """Answer from the file where it has the name, else from the other; a near miss is not guessed at."""
        meant = nearest(question.name, self._known)
        return (self._first if question.name in self._known or meant else self._last).answer(question)


@dataclass(frozen=True, slots=True, kw_only=True)
class _File:
    """An answers file."""

    answers: Mapping[str, Text]


def load_answers(path: Path, shown: str) -> Mapping[str, str]:
    """Read an answers file.

    Raises:
        ConfigurationError: with everything that is wrong with it.
    """
    findings = Findings()
    document = read_document(path, shown, findings, _File, schema=_SCHEMA)
    findings.raise_if_any()
    return document.model.answers if document else {}


class Answered:
    """The answers that persons gave before the interruption: nobody is asked a second time.

    The simulated person is: what it does with its hands belongs to a world that continues from before it did it.

    Args:
        lines: the journal's lines.
        source: who answers what is new.
        goes_on: returns whether the simulated world already continues.
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
