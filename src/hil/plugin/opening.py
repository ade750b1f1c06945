"""Open sessions: on simulated instruments, or on the record of an earlier run."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from hil.bench.binding import BoundBench, bind_simulated
from hil.executive.case.case_run import PlannedCase
from hil.executive.case.operator import AnswerSource
from hil.executive.run.answers import AnswersFile, FirstOf, Nobody, SimulatedPerson, TerminalPerson, load_answers
from hil.executive.run.events import Listener
from hil.executive.run.session import Session
from hil.executive.setup.configuration import Configuration, Request
from hil.plugin.prompt import Terminal

__all__ = ["open_simulated"]


def open_simulated(
    configuration: Configuration,
    planned: Sequence[PlannedCase],
    listeners: Sequence[Listener] = (),
    *,
    alone: bool = False,
) -> Session:
    """Open a session on the simulated twin.

    Args:
        configuration: what the run is made of.
        planned: its cases.
        listeners: are shown every event.
        alone: whether no other run may be on the bench; a rehearsal disturbs nobody.
    """
    bench = configuration.workspace.benches / configuration.bench.name
    answers = _answers_of(configuration.request, configuration.workspace.shown)
    return Session(
        configuration,
        planned,
        binder=lambda transcript, _where: bind_simulated(configuration.bench, transcript),
        answers=answers,
        leases=[f"simulated bench {bench}"] if alone else [],
        listeners=listeners,
    )


def _answers_of(
    request: Request, shown: Callable[[Path], str]
) -> Callable[[BoundBench, Callable[[], None]], AnswerSource]:
    prepared = load_answers(request.answers, shown(request.answers)) if request.answers else None

    def make(bench: BoundBench, idle: Callable[[], None]) -> AnswerSource:
        last = _person(request, bench, idle)
        if prepared is None or request.answers is None:
            return last
        file = AnswersFile(prepared, shown(request.answers))
        return file if isinstance(last, Nobody) else FirstOf(file, last, frozenset(prepared))

    return make


def _person(request: Request, bench: BoundBench, idle: Callable[[], None]) -> AnswerSource:
    if not request.person and bench.person is not None:
        return SimulatedPerson(bench.person)
    if sys.stdin.isatty():
        return TerminalPerson(Terminal(), request.operator or "person at the terminal", idle)
    return Nobody()
