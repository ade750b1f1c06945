"""A soak that goes on where it was interrupted: tests that passed before, on the same commit, are left out.

A whole soak takes longer than most machines are left alone. The file has a name a line; `make soak` keeps one for each
commit, and starts from the beginning where the tree has changes.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

__all__ = ["PassedBefore"]

_SHARED = "passed_before"


class PassedBefore:
    """The tests that passed before, and a file to which those that pass now are added.

    Workers of a distributed run collect the same tests as each other, so that they are told the names once, at their
    start; only the process that they report to reads and writes the file.
    """

    def __init__(self, file: Path, config: pytest.Config) -> None:
        told = getattr(config, "workerinput", {}).get(_SHARED)
        self._file = None if told is not None else file
        names = file.read_text(encoding="utf-8").splitlines() if told is None and file.exists() else told or []
        self._before = frozenset(names)
        self._called: set[str] = set()
        self._new = 0

    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        """Leave out what passed before."""
        done = [item for item in items if item.nodeid in self._before]
        config.hook.pytest_deselected(items=done)
        items[:] = [item for item in items if item.nodeid not in self._before]

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        """Tell a worker at its start."""
        node.workerinput[_SHARED] = sorted(self._before)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Write a test down when it is over: what fails afterwards, as its fixtures are taken down, did not pass."""
        if report.when == "call" and report.passed:
            self._called.add(report.nodeid)
        if report.when == "teardown" and report.passed and report.nodeid in self._called:
            self._new += 1
            self._add([report.nodeid])

    def _add(self, names: Iterable[str]) -> None:
        if self._file is None:
            return
        self._file.parent.mkdir(parents=True, exist_ok=True)
        with self._file.open("a", encoding="utf-8") as file:
            file.writelines(f"{name}\n" for name in names)

    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        """End well where everything has passed before, or the next part of a soak would not begin."""
        if exitstatus == pytest.ExitCode.NO_TESTS_COLLECTED and self._before:
            session.exitstatus = pytest.ExitCode.OK

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Say how many have passed altogether."""
        if self._file is not None:
            terminalreporter.write_line(
                f"{len(self._before) + self._new} tests have passed, {len(self._before)} of them before: {self._file}"
            )
