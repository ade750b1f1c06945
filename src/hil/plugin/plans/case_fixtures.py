"""The fixtures that every case can ask for, and one per role of the bench."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from types import ModuleType
from typing import Any

import pytest

from hil.executive.cases.case_run import CaseRun
from hil.executive.cases.waiting import CaseClock
from hil.executive.session import Session

__all__ = ["CASE_FIXTURES", "case_fixtures"]

CASE_FIXTURES = ("artifact", "chart", "check", "clock", "iterations", "operator", "parameters", "record", "step")
"""The fixtures that every case can ask for, on any bench."""


def case_fixtures(session: Callable[[], Session], roles: Iterable[str]) -> ModuleType:
    """Return a module of fixtures, created per run because the roles depend on the bench."""
    module = ModuleType("hil_case_fixtures", "Fixtures of one bench.")

    def provide(name: str, make: Callable[[Session, CaseRun], Any], doc: str) -> None:
        def fixture() -> Any:  # noqa: ANN401 - whatever the fixture provides
            running = session()
            if running.current is None:
                raise RuntimeError(f"'{name}' is for cases only, not for fixtures that outlive them")
            return make(running, running.current)

        fixture.__doc__ = doc
        setattr(module, name, pytest.fixture(name=name)(fixture))

    provide("step", lambda _, run: run.steps, "A named part of the case.")
    provide("record", lambda _, run: run.record, "Sample roles into a recording.")
    provide("check", lambda _, run: run.check, "Evaluate one criterion of the catalogue.")
    provide("operator", lambda _, run: run.operator, "A person's hands and eyes.")
    provide("artifact", lambda _, run: run.artifact, "Keep a file with the evidence.")
    provide("chart", lambda _, run: run.chart, "Draw a chart on the first page of the report.")
    provide("iterations", lambda _, run: run.iterations, "A loop that may be re-entered.")
    provide("clock", lambda _, run: CaseClock(run), "Bench time.")
    provide("parameters", _parameters, "The plan's parameters.")
    for role in roles:
        provide(role, partial(_role, role), f"The bench's {role}.")
    return module


def _role(role: str, session: Session, run: CaseRun) -> object:
    return session.roles(run)[role]


def _parameters(session: Session, run: CaseRun) -> object:
    return session.configuration.parameters[run.planned.plan]
