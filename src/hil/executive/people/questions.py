"""Questions to a person: their content, parsing of answers, and answers from another terminal."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from hil.evidence.events import GivenFile, PlanPicture
from hil.executive.people.files import problem_of, spoken_kinds
from hil.model.errors import HilError

__all__ = [
    "FILE",
    "FROM_FILE",
    "Answer",
    "AnswerSource",
    "Declined",
    "Elsewhere",
    "Question",
    "form",
    "spoken",
    "understood",
    "witness_problem",
]

_PERHAPS_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
"""A comma that may or may not be a decimal sign: a factor of 1000 is not guessed."""

FILE = "file"
"""The form of questions answered with a file."""

FROM_FILE = " (answers file)"
"""Suffix to the name of a person whose answers were prepared in a file."""

_YES = frozenset({"true", "y", "yes"})
_NO = frozenset({"false", "n", "no"})


class Declined(HilError):
    """The person said no, or nobody was there to answer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """One question.

    Attributes:
        name: its name in answers files, unique in its case by its ordinal.
        form: `confirm`, `choose`, `measure`, `connect` or `file`; `attach` in older packages, for `connect`.
        text: what the person reads.
        options: for `choose` and `connect`, the possible answers; for `file`, the accepted kinds of files.
        unit: for `measure`, the unit of the number.
        safety: whether somebody's safety depends on it: on a bench outside this process a person answers it live.
        instrument: for `measure`, the instrument to read, by its name in the register; the text mentions it.
        witness: who has to be present, by role or name; empty if no witness is needed.
        picture: the picture of the plan shown beside the text.
    """

    name: str
    form: str
    text: str
    options: tuple[str, ...] = ()
    unit: str = ""
    safety: bool = False
    instrument: str = ""
    witness: str = ""
    picture: PlanPicture | None = None

    @property
    def shown(self) -> str:
        """Path of the picture in the workspace, empty without one."""
        return self.picture.file.removeprefix("data/sources/") if self.picture else ""


@dataclass(frozen=True, slots=True)
class Answer:
    """An answer, and who gave it.

    Attributes:
        value: the answer; for a file its original name.
        by: who answered, never empty.
        path: the path of a given file that the run has not taken yet.
        file: a file that the run already has, from its record.
        witness: who witnessed it, empty if no witness was needed.
    """

    value: str | float | bool
    by: str
    path: Path | None = None
    file: GivenFile | None = None
    witness: str = ""


class AnswerSource(Protocol):
    """A source of answers."""

    def answer(self, question: Question) -> Answer:
        """Answer, or raise Declined with a hint."""
        ...


class Elsewhere:
    """The question pending for an answer through the run's inbox (`hil answer`).

    Attributes:
        answer: the answer to the pending question, None until there is one, and while no question is pending.
        witnesses: returns why a person cannot witness an answer, given the question, who answers, and who witnesses.
    """

    def __init__(self) -> None:
        self.witnesses: Callable[[Question, str, str], str] = witness_problem
        self._question: Question | None = None
        self.answer: Answer | None = None

    @contextmanager
    def asks(self, question: Question) -> Iterator[None]:
        """Make a question the pending one."""
        self._question = question
        try:
            yield
        finally:
            self._question = self.answer = None

    def take(self, name: str, text: str, by: str, path: Path | None = None, witness: str = "") -> str:
        """Take an answer to the question of this name; return why it is not accepted, empty if it is.

        Args:
            name: the question's name.
            text: the answer; for a file its original name.
            by: who answers.
            path: the path of the given file.
            witness: who witnessed it.
        """
        question = self._question
        if question is None or question.name != name or self.answer is not None:
            return f"'{name}' is not being asked now"
        if not by.strip():
            return f"'{name}' was answered without a name"
        problem = self.witnesses(question, by, witness) or _file_problem(question, path)
        value = text if question.form == FILE else understood(question, text)
        if not problem and value is None:
            problem = f"'{text}' is not an answer to '{name}', which takes {form(question)}"
        if not problem and value is not None:
            self.answer = Answer(value, by.strip(), path=path, witness=witness.strip())
        return problem


def _file_problem(question: Question, path: Path | None) -> str:
    """Return why this is not the requested file, empty if it is, or if none is requested."""
    if question.form != FILE:
        return ""
    if path is None:
        return f"'{question.name}' takes {form(question)}, and none came"
    return problem_of(path, question.options)


def witness_problem(question: Question, by: str, witness: str) -> str:
    """Return why an answer lacks its witness, empty if it has one or needs none: a witness is not who answers."""
    if not question.witness:
        return ""
    if not witness.strip():
        return f"'{question.name}' needs a witness ({question.witness}), and none is named"
    if _person(witness) == _person(by):
        return f"'{question.name}' needs a witness ({question.witness}): {witness.strip()} cannot witness an own answer"
    return ""


def _person(name: str) -> str:
    """Return a name normalised for comparison: case and spaces do not distinguish people."""
    return " ".join(unicodedata.normalize("NFKC", name.removesuffix(FROM_FILE)).casefold().split())


def spoken(question: Question) -> str:
    """Return the question with its possible answers."""
    picture = f" (see {question.shown})" if question.picture else ""
    return f"{question.text}{picture} [{form(question)}]"


def form(question: Question) -> str:
    """Return the possible answers, in words."""
    match question.form:
        case "confirm":
            return "yes or no"
        case "measure":
            return f"a number in {question.unit}, such as 1.5"
        case "connect" | "attach":
            return "yes when it is done"
        case "file":
            return f"the path of a {spoken_kinds(question.options)} file"
        case _:
            return " or ".join(question.options)


def understood(question: Question, line: str) -> str | float | bool | None:
    """Return the answer in a line, None if it is not one."""
    said = line.strip()
    match question.form:
        case "confirm":
            return True if said.lower() in _YES else False if said.lower() in _NO else None
        case "connect" | "attach" if said.lower() in _YES:
            return question.options[0]
        case "file":
            return said or None
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
