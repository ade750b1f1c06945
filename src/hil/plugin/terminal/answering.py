"""Sources of answers to a run's questions: a file, the simulated person, or the person at the terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from hil.bench.bound import BoundBench
from hil.executive.people.answers import (
    Answering,
    AnswersFile,
    AskedLive,
    FirstOf,
    Nobody,
    NobodyLive,
    SimulatedPerson,
    TerminalPerson,
    load_answers,
)
from hil.executive.people.hands import ActedOut
from hil.executive.people.questions import AnswerSource, Elsewhere
from hil.executive.people.witnesses import Witnessed, Witnesses
from hil.executive.setup.configuration import Request
from hil.plugin.terminal.prompt import NoTerminal, Terminal

__all__ = ["acted_out", "answers_of"]


def answers_of(request: Request, shown: Callable[[Path], str], witnesses: Witnesses) -> Answering:
    """Return the factory of the source of answers.

    On a bench outside this process only a person gives safety confirmations, whatever file was prepared.

    Args:
        request: names the answers file, and says whether a person answers instead of the simulated one.
        shown: returns a path as people see it.
        witnesses: knows who may witness an answer.

    Raises:
        ConfigurationError: with everything that is wrong with the answers file.
    """
    prepared = load_answers(request.answers, shown(request.answers)) if request.answers else None

    def make(bench: BoundBench, idle: Callable[[], None], elsewhere: Elsewhere) -> AnswerSource:
        elsewhere.witnesses = witnesses.problem
        last = _person(request, bench, idle, elsewhere)
        source = last
        if prepared is not None and request.answers is not None:
            file = AnswersFile(prepared, shown(request.answers), request.answers.resolve().parent)
            source = file if isinstance(last, Nobody) else FirstOf(file, last, frozenset(prepared.answers))
        if bench.live is not None:
            source = AskedLive(last if isinstance(last, TerminalPerson) else NobodyLive(), source)
        return Witnessed(source, witnesses)

    return make


def acted_out(answering: Answering) -> Answering:
    """Let the simulated person of a simulated bench carry out what is answered, whoever answers."""

    def make(bench: BoundBench, idle: Callable[[], None], elsewhere: Elsewhere) -> AnswerSource:
        source = answering(bench, idle, elsewhere)
        if not bench.has_person:
            return source
        return ActedOut(source, lambda: bench.world.person if bench.world is not None else None)

    return make


def _person(request: Request, bench: BoundBench, idle: Callable[[], None], elsewhere: Elsewhere) -> AnswerSource:
    if not request.person and bench.has_person:
        return SimulatedPerson(lambda: bench.person)
    if sys.stdin.isatty():
        return TerminalPerson(Terminal(), request.operator, idle, elsewhere)
    if request.unattended:  # the person on call, or started it, answers from any terminal
        return TerminalPerson(NoTerminal(), "", idle, elsewhere)
    return Nobody()
