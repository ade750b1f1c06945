"""Sources of answers: an answers file, the simulated person, or a person at the terminal."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

from hil.bench.bound import BoundBench
from hil.documents.declared import read_document
from hil.documents.findings import Findings
from hil.documents.node import Place
from hil.documents.suggest import did_you_mean, nearest
from hil.documents.text import named_wrongly
from hil.evidence.events import Answer as Given
from hil.evidence.events import Effect, Event
from hil.evidence.journal.reader import JournalLine
from hil.evidence.state import standing
from hil.executive.people.files import Unfit, problem_of, said_path
from hil.executive.people.questions import (
    FILE,
    FROM_FILE,
    Answer,
    AnswerSource,
    Declined,
    Elsewhere,
    Question,
    form,
    spoken,
    understood,
    witness_problem,
)
from hil.model.errors import Diverged, HilError, Refused
from hil.model.notation import UNWRITTEN, AnyText, Text

__all__ = [
    "SIMULATED_PERSON",
    "SIMULATED_WITNESS",
    "Answered",
    "Answering",
    "AnswersFile",
    "AskedLive",
    "FirstOf",
    "Nobody",
    "NobodyLive",
    "Prepared",
    "Prompt",
    "Recorded",
    "SimulatedPerson",
    "TerminalPerson",
    "load_answers",
]

SIMULATED_PERSON = "simulated person"
"""The name under which the simulated bench's person answers."""

SIMULATED_WITNESS = "simulated witness"

Answering = Callable[[BoundBench, Callable[[], None], Elsewhere], AnswerSource]
"""Makes a run's source of answers from its bench, the scheduling point to pass while waiting, and elsewhere."""

_SCHEMA = "hil/answers/1"
_SOMEBODY = "person at the terminal"
_DECLINED: Mapping[str, type[HilError]] = {each.__name__: each for each in (Declined, Unfit, Refused)}
_CONFIRMS = Question(name="witness", form="confirm", text="")


class Prompt(Protocol):
    """A terminal at which a person sits."""

    def show(self, text: str) -> None:
        """Show a line."""
        ...

    def discard(self) -> None:
        """Discard what was typed so far, and say so."""
        ...

    def line(self) -> str | None:
        """Return a line with its newline if one was entered, None if not yet, an empty string at the end of input.

        It waits a fraction of a second at most.
        """
        ...


class Person(Protocol):
    """The simulated person of a simulated bench."""

    def answer(self, form: str, name: str, text: str, options: Sequence[str]) -> str | float | bool:
        """Answer from what is true in the simulated world."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """Content of an answers file.

    Attributes:
        answers: the answers, by name of the question.
        witnesses: the names of those who witness the answers, by name of the question.
        by: who prepared it, empty if it does not say.
        places: where each `answer` and each `witness` is, by that word and the name of the question.
    """

    answers: Mapping[str, Text]
    witnesses: Mapping[str, Text] = field(default_factory=dict)
    by: AnyText = ""
    places: Mapping[tuple[str, str], Place] = field(default_factory=dict, compare=False, metadata=UNWRITTEN)


class AnswersFile:
    """Answers by name, prepared for an unattended run.

    Args:
        prepared: the file's content; a mapping is taken as answers only.
        shown: the file, for messages.
        folder: the base of relative paths of files given as answers.
    """

    def __init__(self, prepared: Prepared | Mapping[str, str], shown: str, folder: Path = Path()) -> None:
        self._prepared = prepared if isinstance(prepared, Prepared) else Prepared(answers=prepared)
        self._answers = self._prepared.answers
        self._shown = shown
        self._folder = folder

    def answer(self, question: Question) -> Answer:
        """Answer from the file."""
        if question.name not in self._answers:
            hint = did_you_mean(question.name, self._answers)
            raise Declined(
                f"{self._shown} has no answer to '{question.name}'{hint}", f"the question was: {question.text}"
            )
        said = self._answers[question.name]
        value = understood(question, said)
        if value is None:
            raise Declined(
                f"{self._shown} answers '{said}' to '{question.name}'",
                f"answer {form(question)}; the question was: {question.text}",
            )
        by = f"{self._prepared.by}{FROM_FILE}" if self._prepared.by else "answers file"
        witness = self._prepared.witnesses.get(question.name, "")
        if problem := witness_problem(question, by, witness):
            raise Declined(
                f"{self._shown}: {problem}", f"name another person under witnesses, as {question.name}: NAME"
            )
        path = said_path(said, self._folder) if question.form == FILE else None
        return Answer(path.name if path else value, by, path=path, witness=witness if question.witness else "")


class SimulatedPerson:
    """The simulated bench's person.

    Args:
        person: returns the person; on a resumed bench there is none before the bench continues.
    """

    def __init__(self, person: Callable[[], Person]) -> None:
        self._person = person

    def answer(self, question: Question) -> Answer:
        """Answer from what is true in the simulated world."""
        value = self._person().answer(question.form, question.name, question.text, question.options)
        return Answer(value, SIMULATED_PERSON, witness=SIMULATED_WITNESS if question.witness else "")


class TerminalPerson:
    """A person at the terminal; monitors and stop requests are served while waiting for an answer.

    A safety confirmation is answered only by what is typed after it is shown, never by what was typed ahead.

    Args:
        prompt: the terminal.
        name: the person's name; if empty, it is asked for with a safety confirmation.
        idle: the scheduling point to pass while waiting.
        elsewhere: takes an answer from another terminal, which may come first.
    """

    def __init__(self, prompt: Prompt, name: str, idle: Callable[[], None], elsewhere: Elsewhere | None = None) -> None:
        self._prompt = prompt
        self._name = name
        self._idle = idle
        self._elsewhere = elsewhere or Elsewhere()

    def answer(self, question: Question) -> Answer:
        """Show the question and wait for a line that answers it, here or elsewhere.

        Raises:
            Declined: if the input has ended, so that no line can come.
        """
        with self._elsewhere.asks(question):
            if question.safety:
                self._prompt.discard()
            self._prompt.show(spoken(question))
            said = self._said(question)
        if isinstance(said, Answer):
            return said
        by = self._name or self._named(question)
        witness = self._witnessed(question, by)
        if isinstance(said, Path):
            return Answer(said.name, by, path=said, witness=witness)
        return Answer(said, by, witness=witness)

    def _said(self, question: Question) -> Answer | Path | str | float | bool:
        while True:
            line = self._line()
            if self._elsewhere.answer is not None:
                return self._elsewhere.answer
            if not line:
                raise Declined(f"'{question.text}' was not answered: the terminal's input has ended")
            value = understood(question, line)
            if value is not None and question.form != FILE:
                return value
            path = said_path(line, Path.cwd())
            problem = problem_of(path, question.options) if value is not None else ""
            if value is not None and not problem:
                return path
            self._prompt.show(f"{problem}. Please give another" if problem else f"Please answer {form(question)}")

    def _witnessed(self, question: Question, by: str) -> str:
        """Ask the witness for name and confirmation, if one is needed."""
        while question.witness:
            self._prompt.show(f"Witness ({question.witness}), your name:")
            if not (line := self._line()):
                break
            witness = line.strip()
            if problem := self._elsewhere.witnesses(question, by, witness):
                self._prompt.show(problem)
                continue
            self._prompt.show(f"{witness}, do you confirm that you were present, and the answer? [yes or no]")
            if not (line := self._line()):
                break
            if understood(_CONFIRMS, line) is True:
                return witness
            if understood(_CONFIRMS, line) is False:
                raise Declined(f"'{question.text}' was not confirmed by its witness, {witness}")
        if question.witness:
            raise Declined(f"'{question.text}' was not witnessed: the terminal's input has ended")
        return ""

    def _named(self, question: Question) -> str:
        name = "" if question.safety or question.witness else _SOMEBODY
        while not name:
            self._prompt.show("Your name:")
            if not (line := self._line()):
                raise Declined(f"'{question.text}' was answered without a name: the terminal's input has ended")
            name = line.strip()
        return name

    def _line(self) -> str:
        """Return what was typed, empty at the end of input and once the question is answered elsewhere."""
        while (line := self._prompt.line()) is None and self._elsewhere.answer is None:
            self._idle()
        return line or ""


class Nobody:
    """Source of answers if nobody can answer."""

    def answer(self, question: Question) -> Answer:
        """Decline, and say what to do."""
        raise Declined(
            f"'{question.text}' needs a person, and there is no terminal",
            f"run from a terminal, or give an answer to '{question.name}' with --answers FILE",
        )


class NobodyLive:
    """Source of safety confirmations if no person can give them."""

    def answer(self, question: Question) -> Answer:
        """Decline, and say what to do."""
        raise Declined(
            f"'{question.text}' is a safety confirmation: a person gives it live, by name, at each arm",
            "run from a terminal; on a bench outside this process neither a file nor the simulated person can give it",
        )


class AskedLive:
    """Routes safety confirmations to a person, whatever answers everything else.

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
    """Answers from the first source that knows the question; the last one decides what happens if none does."""

    def __init__(self, first: AnswersFile, last: AnswerSource, known: frozenset[str]) -> None:
        self._first = first
        self._last = last
        self._known = known

    def answer(self, question: Question) -> Answer:
        """Answer from the file if it has the name, otherwise from the other; a near miss is not guessed at."""
        meant = nearest(question.name, self._known)
        return (self._first if question.name in self._known or meant else self._last).answer(question)


def load_answers(path: Path, shown: str) -> Prepared:
    """Read an answers file.

    Raises:
        ConfigurationError: with all errors in it.
    """
    findings = Findings()
    document = read_document(path, shown, findings, Prepared, schema=_SCHEMA)
    found = findings.require(document)
    prepared = found.model
    places = {("answer", name): found.place(("answers", name)) for name in prepared.answers}
    places |= {("witness", name): found.place(("witnesses", name)) for name in prepared.witnesses}
    people = {("by",): prepared.by} | {("witnesses", name): who for name, who in prepared.witnesses.items()}
    for at, who in people.items():
        if who and (problem := named_wrongly(who)):
            findings.add(found.place(at), f"the name {'; '.join(problem)}")
    findings.raise_if_any()
    return replace(prepared, places=places)


class Answered:
    """Answers given before the interruption: nobody is asked a second time.

    The simulated person is the exception: its actions belong to a world that continues from before they were done.

    Args:
        lines: the journal's lines.
        source: answers new questions.
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
            raise _again(told, question)
        if told.name != question.name:
            raise Diverged(f"the case asks '{question.name}', but its journal holds an answer to '{told.name}'")
        if told.by == SIMULATED_PERSON and self._goes_on():
            return self._source.answer(question)
        return Answer(told.value, told.by, file=told.file, witness=told.witness)


class Recorded:
    """Source of answers in a replay: the record itself answers, and what was declined there is declined again.

    Args:
        effects: the effects of the record.
    """

    def __init__(self, effects: Iterable[Effect]) -> None:
        self._declined = [each for each in effects if each.effect == "asks" and each.raised]

    def answer(self, question: Question) -> Answer:
        """Decline, as it was declined then."""
        for place, each in enumerate(self._declined):
            if each.name == f"operator.{question.name}":
                del self._declined[: place + 1]
                raise _again(each, question)
        return Nobody().answer(question)


def _again(event: Event, question: Question) -> HilError:
    """Return the error with which the question was declined then; its text is in the reasons of its case."""
    effect = event if isinstance(event, Effect) else None
    kind = _DECLINED.get(effect.raised, Declined) if effect else Declined
    if effect and effect.why:
        return kind(effect.why, effect.hint)
    return kind(f"'{question.name}' was declined before the run was interrupted", "see the run's journal")


def _is_answer(event: Event) -> bool:
    declined = (
        isinstance(event, Effect) and event.effect == "asks" and event.raised in {Declined.__name__, Unfit.__name__}
    )
    return declined or isinstance(event, Given)
