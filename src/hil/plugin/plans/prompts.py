"""Questions that cases may ask, found in their code before anything is opened, and who answers them."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import CodeType, FunctionType
from typing import TYPE_CHECKING, cast

import pytest

from hil.documents.node import Place
from hil.documents.suggest import did_you_mean
from hil.evidence.results.eligibility import is_asked_for
from hil.executive.people.answers import Prepared, load_answers
from hil.executive.people.files import KINDS, kinds_of, problem_of, said_path
from hil.executive.people.questions import FILE, Question, form, understood
from hil.executive.people.witnesses import SOMEBODY, Witnesses
from hil.model.errors import ConfigurationError, Finding, Misused, Refused
from hil.requirements.catalogue import Catalogue

if TYPE_CHECKING:
    from hil.executive.setup.configuration import Request
    from hil.executive.setup.head import PlannedCase

__all__ = ["Attended", "Foreseen", "foreseen", "require_answers", "require_pictures", "require_witness_points"]

_WHO = "operator"
_FORMS = {
    "confirm": "confirm",
    "choose": "choose",
    "measure": "measure",
    "connect": "connect",
    "attach": FILE,
    "witness": "confirm",
}
_OF_CONNECT = 2
"""With this many texts `attach` is the `connect` of older plans."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Foreseen:
    """A call of `operator` in the code reachable from a case.

    Attributes:
        pattern: the names that the question may have.
        name: its name, empty if it is composed.
        question: what is known about it.
        options: whether its options are known.
        where: file and line of the call.
        picture: the picture that it shows, empty if none, or if its name is composed.
    """

    pattern: re.Pattern[str]
    name: str
    question: Question
    options: bool
    where: str
    picture: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Attended:
    """Who answers in a run.

    Attributes:
        terminal: whether a person can answer at a terminal, or through the inbox.
        simulated: the answers that the simulated person knows besides confirmations, by name, if it answers; no files.
        safety: whether only a person may give a safety confirmation, because the bench is outside this process.
    """

    terminal: bool
    simulated: frozenset[str] | None
    safety: bool

    def answers(self, foreseen: Foreseen) -> bool:
        """Return whether somebody answers a question that no file answers; for a composed name, whether one may."""
        if self.simulated is None:
            return self.terminal
        form = foreseen.question.form
        return form == "confirm" or (form != FILE and any(map(foreseen.pattern.fullmatch, self.simulated)))


def foreseen(item: pytest.Item, root: Path) -> tuple[Foreseen, ...]:
    """Return the questions that a case may ask: in its own code, in its fixtures, and in what they call in `root`."""
    functions = [getattr(item, "function", None)]
    info = getattr(item, "_fixtureinfo", None)
    for found in getattr(info, "name2fixturedefs", {}).values():
        functions += [each.func for each in found]
    return tuple(dict.fromkeys(each for one in _reached(functions, root) for each in _asked(one, root)))


def _reached(functions: Iterable[object], root: Path) -> Iterator[FunctionType]:
    """Yield functions and what they use from the workspace; of a class, the methods whose names occur in them."""
    waiting, tried, names = [*functions], set[int](), set[str]()
    classes: dict[type, None] = {}
    while waiting:
        each = waiting.pop()
        if id(each) not in tried and isinstance(each, FunctionType | type) and _is_own(each, root):
            if isinstance(each, type):
                classes[each] = None
            else:
                yield each
                used = set(_names(each.__code__))
                names |= used
                waiting += [each.__globals__.get(name) for name in used]
                waiting.append(getattr(each, "__wrapped__", None))
        tried.add(id(each))
        if not waiting:
            methods = [(name, it) for one in classes for name, it in vars(one).items() if isinstance(it, FunctionType)]
            waiting += [it for name, it in methods if id(it) not in tried and (name in names or name.startswith("__"))]


def _is_own(thing: object, root: Path) -> bool:
    try:
        return Path(inspect.getfile(cast("type", thing))).is_relative_to(root)
    except (OSError, TypeError):
        return False


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield from _names(each)


@lru_cache(maxsize=1024)
def _asked(function: FunctionType, root: Path) -> tuple[Foreseen, ...]:
    try:
        lines, start = inspect.getsourcelines(function)
        tree = ast.parse(textwrap.dedent("".join(lines)))
    except (OSError, TypeError, SyntaxError):
        return ()
    file = Path(inspect.getfile(function)).relative_to(root).as_posix()
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and _is_prompt(node.func)]
    return tuple(_foreseen(call, f"{file}:{start + call.lineno - 1}", function.__globals__) for call in calls)


def _is_prompt(function: ast.expr) -> bool:
    if not isinstance(function, ast.Attribute) or function.attr not in _FORMS:
        return False
    who = function.value
    name = who.id if isinstance(who, ast.Name) else who.attr if isinstance(who, ast.Attribute) else ""
    return name.strip("_") == _WHO


def _foreseen(call: ast.Call, where: str, known: Mapping[str, object]) -> Foreseen:
    function = cast("ast.Attribute", call.func).attr
    given = {each.arg: each.value for each in call.keywords}
    attached = function == "attach" and len(call.args) < _OF_CONNECT
    shape = FILE if attached else "connect" if function == "attach" else _FORMS[function]
    name = _word(given.get("name"), known)
    options = _words(given.get("accepts", ast.Tuple(elts=[])), known) if attached else ()
    if shape == "choose":
        options = _words(call.args[1] if len(call.args) > 1 else given.get("options"), known)
    if attached and options is not None:
        try:
            options = kinds_of(options)
        except Misused:  # the call reports it
            options = None
    place = 1 if shape == "connect" or function == "witness" else 0
    text = _word(call.args[place] if len(call.args) > place else given.get("text"), known)
    witness = given.get("witness")
    if function == "witness":
        witness = call.args[0] if call.args else given.get("who")
    return Foreseen(
        pattern=re.compile(re.escape(name) if name else _pattern(given.get("name"))),
        name=name,
        question=Question(
            name=name,
            form=shape,
            text=text or "the question",
            options=options or (tuple(KINDS) if attached else ()),
            unit=_word(call.args[1] if shape == "measure" and len(call.args) > 1 else given.get("unit"), known),
            safety=isinstance(each := given.get("safety"), ast.Constant) and each.value is True,
            witness=(_word(witness, known) or SOMEBODY) if witness is not None else "",
        ),
        options=options is not None and shape != "connect",
        where=where,
        picture=_word(given.get("picture"), known),
    )


def _word(node: ast.expr | None, known: Mapping[str, object]) -> str:
    """Return a text that is a literal or a constant of its module; empty for anything else."""
    if isinstance(node, ast.Name):
        value = known.get(node.id)
        return value if isinstance(value, str) else ""
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""


def _words(node: ast.expr | None, known: Mapping[str, object]) -> tuple[str, ...] | None:
    if isinstance(node, ast.Name):
        value = known.get(node.id)
        node = ast.Tuple(elts=[ast.Constant(each) for each in value]) if isinstance(value, tuple | list) else None
    if not isinstance(node, ast.Tuple | ast.List):
        return None
    words = tuple(_word(each, known) for each in node.elts)
    return words if all(words) else None


def _pattern(node: ast.expr | None) -> str:
    if isinstance(node, ast.JoinedStr):
        parts = (re.escape(str(each.value)) if isinstance(each, ast.Constant) else ".*" for each in node.values)
        return "".join(parts)
    return ".*"


def require_answers(
    asked: Sequence[Foreseen],
    due: Sequence[Foreseen],
    request: Request,
    attended: Attended,
    witnesses: Witnesses,
    shown: Callable[[Path], str],
) -> None:
    """Require, before anything is opened, that the answers file or somebody present will answer every question.

    Args:
        asked: the questions of all cases of the plans, whether they are run or not.
        due: the questions of the cases that are run.
        request: names the answers file.
        attended: who answers what the file does not.
        witnesses: knows who may witness an answer.
        shown: returns a path as people see it.

    Raises:
        ConfigurationError: with every answer that no case asks for, that does not fit its question, or whose file is
            unusable, by its place in the answers file, and with every question without an answer.
        Refused: with the questions that nobody is there to answer, if there is no answers file.
    """
    prepared = load_answers(request.answers, shown(request.answers)) if request.answers else Prepared(answers={})
    findings = list(_surplus(prepared, asked)) if request.answers else []
    folder = request.answers.resolve().parent if request.answers else Path()
    for each in asked:
        if each.name in prepared.answers and not (attended.safety and each.question.safety):
            findings += _unfit(each, prepared, folder, witnesses)
    open_questions = [each for each in due if not _is_answered(each, prepared, attended)]
    if open_questions and request.answers:
        file = shown(request.answers)
        findings += [Finding(file, 0, 0, f"no answer to {_described(each)}") for each in open_questions]
    for each in due if attended.simulated is None else ():
        file, _, line = each.where.rpartition(":")
        if problem := witnesses.missing(each.question):
            findings.append(Finding(file, int(line), 1, problem))
    if findings:
        raise ConfigurationError(tuple(dict.fromkeys(findings)))
    if open_questions:
        told = "; ".join(dict.fromkeys(map(_described, open_questions)))
        hint = "each needs a person: give answers with --answers FILE, or run from a terminal"
        if attended.simulated is not None:
            hint = "the simulated person has no files, and knows what simulated.person in the bench file maps: give"
            hint += " answers with --answers FILE, or --ask to answer at the terminal"
        raise Refused(f"there is nobody to answer {told}", hint)


def require_witness_points(catalogue: Catalogue, run: Sequence[tuple[PlannedCase, Sequence[Foreseen]]]) -> None:
    """Require that every witness demanded by a requirement is asked for by one of its cases.

    Otherwise the run could not close the requirement, and the witness would learn only afterwards of being needed.

    Args:
        catalogue: the requirements.
        run: the cases that are run, each with the questions that it may ask.

    Raises:
        ConfigurationError: with every requirement whose witness no case asks for.
    """
    findings = []
    for name in dict.fromkeys(name for case, _ in run for name in case.requirements):
        item = catalogue.requirement(name)
        asked = [each.question.witness for case, found in run if name in case.requirements for each in found]
        due = item.witness or (SOMEBODY if item.independent else "")
        if due and not any(each == SOMEBODY or (each and is_asked_for(item.witness, each)) for each in asked):
            told = f"{name} needs a witness ({due}), and no question of its cases asks for one"
            what = f"{told}; add operator.witness({due!r}, TEXT, name=NAME) where that person has to be present"
            findings.append(Finding(item.place.path, item.place.line, item.place.column, what))
    if findings:
        raise ConfigurationError(tuple(findings))


def require_pictures(
    run: Sequence[tuple[PlannedCase, Sequence[Foreseen]]], picture_of: Callable[[str, str], object]
) -> None:
    """Require the pictures that the cases show, rather than miss them in the middle of the run.

    Args:
        run: the cases that are run, each with the questions that it may ask.
        picture_of: returns a picture by the name of its plan and its path in it.

    Raises:
        ConfigurationError: with every picture that is missing, or is not a picture, by the place of its question.
    """
    findings: dict[Finding, None] = {}
    for case, found in run:
        for each in found:
            try:
                if each.picture:
                    picture_of(case.plan, each.picture)
            except Misused as error:
                file, _, line = each.where.rpartition(":")
                findings[Finding(file, int(line), 1, f"{error.message}; {error.hint}")] = None
    if findings:
        raise ConfigurationError(tuple(findings))


def _is_answered(each: Foreseen, prepared: Prepared, attended: Attended) -> bool:
    """Return whether a question gets an answer; for one with a composed name, whether any answer may be its."""
    if attended.safety and each.question.safety:
        return attended.terminal
    return attended.answers(each) or any(map(each.pattern.fullmatch, prepared.answers))


def _described(each: Foreseen) -> str:
    question = each.question
    pattern = re.sub(r"\\(.)", r"\1", each.pattern.pattern.replace(".*", "..."))
    name = f"'{question.name}'" if question.name else f"a question named {pattern}"
    safety = " is a safety confirmation: a person gives it live, by name, at each arm" if question.safety else ""
    takes = safety or f", which takes {form(question) or 'one of its options'}"
    return f"{name} ({each.where}: {question.text}){takes}"


def _surplus(prepared: Prepared, asked: Sequence[Foreseen]) -> Iterator[Finding]:
    names = [each.name for each in asked if each.name]
    for key, given in (("answer", prepared.answers), ("witness", prepared.witnesses)):
        for name in given:
            if not any(each.pattern.fullmatch(name) for each in asked):
                near = did_you_mean(name, names)
                yield _at(prepared, key, name, f"no case asks '{name}'{near}; correct the name, or remove it")
            elif key == "witness" and not any(each.pattern.fullmatch(name) and each.question.witness for each in asked):
                yield _at(prepared, key, name, f"'{name}' asks for no witness; remove it, or ask for one in the case")


def _unfit(each: Foreseen, prepared: Prepared, folder: Path, witnesses: Witnesses) -> Iterator[Finding]:
    """Yield what is wrong with an answer, before it is given."""
    question, said = each.question, prepared.answers[each.name]
    if question.form == FILE:
        if problem := problem_of(said_path(said, folder), question.options):
            yield _at(prepared, "answer", each.name, f"'{each.name}': {problem}")
    elif (each.options or question.form in {"confirm", "measure"}) and understood(question, said) is None:
        yield _at(prepared, "answer", each.name, f"'{said}' does not answer '{each.name}': answer {form(question)}")
    witness = prepared.witnesses.get(each.name, "")
    if problem := witnesses.problem(question, prepared.by, witness):
        told = f"{problem}; name another person under witnesses, as {each.name}: NAME"
        yield _at(prepared, "witness" if witness else "answer", each.name, told)


def _at(prepared: Prepared, key: str, name: str, message: str) -> Finding:
    place = prepared.places.get((key, name), Place(path=""))
    return Finding(place.path, place.line, place.column, message)
