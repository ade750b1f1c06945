"""The campaign: pytest's hooks around one run."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from functools import partial
from types import FrameType
from typing import NoReturn

import pytest

from hil.executive.cases.case_run import CaseRun
from hil.executive.ending.stop import Stopped
from hil.executive.session import Session
from hil.executive.setup.configuration import Configuration
from hil.executive.setup.head import DESELECTED, ENDED_BEFORE, PlannedCase
from hil.model.errors import HilError
from hil.model.verdict import Verdict
from hil.plugin.plans.case_fixtures import case_fixtures
from hil.plugin.plans.collection import plan_cases, skipped_cases
from hil.plugin.plans.fixture_modules import load_fixture_modules
from hil.plugin.plans.frozen_code import FrozenCode
from hil.plugin.plans.markers import MARKERS
from hil.plugin.plans.plan_sources import refuse_sources

__all__ = ["Campaign", "Opener"]

_CALLERS = ("_pytest.", "pluggy.", "hil.plugin.", "hil.executive.")
"""Modules that call a case's own code, or are called by it, and are never interrupted midway."""

_LIBRARIES = sys.stdlib_module_names | {"hil"}
"""Libraries: their code counts as that of whoever calls it."""

_Finalizers = list[Callable[[], object]]

_NOT_PYTHON = re.compile(r"^E +(SyntaxError|IndentationError|TabError): ", re.MULTILINE)

Opener = Callable[[Configuration, Sequence[PlannedCase]], Session]
"""Opens the session once the cases are known."""


class Campaign:
    """One pytest session as one run.

    Create and use it within `frozen_code`, so that what is loaded is what is frozen.

    Args:
        configuration: what the run is made of.
        opener: opens the session.
        code: loads the workspace's modules.

    Raises:
        ConfigurationError: if the workspace's fixtures cannot be loaded, or plans bring hooks of pytest.

    Attributes:
        session: the open session, None before the first case.
        error: why there is none, if a person can fix that.
        collection_errors: files that could not be collected, and why.
    """

    def __init__(self, configuration: Configuration, opener: Opener, code: FrozenCode) -> None:
        self.configuration = configuration
        self.session: Session | None = None
        self.error: HilError | None = None
        self.collection_errors: list[tuple[str, str]] = []
        self._opener = opener
        self._code = code
        refuse_sources(configuration)
        self._fixtures = load_fixture_modules(configuration, code)
        self._planned: dict[str, PlannedCase] = {}
        self._skipped: dict[str, str] = {}
        self._ended: set[str] = set()
        self._deselected: set[str] = set()

    @property
    def running(self) -> Session:
        """The open session."""
        if self.session is None:
            raise RuntimeError("the run has not begun")
        return self.session

    def pytest_configure(self, config: pytest.Config) -> None:
        """Register markers, the bench's fixtures, and the workspace's own."""
        self._code.serve(config)
        for marker in MARKERS:
            config.addinivalue_line("markers", marker)
        roles = dict.fromkeys(wire.role for wire in self.configuration.bench.wiring)
        config.pluginmanager.register(case_fixtures(lambda: self.running, roles), "hil_case_fixtures")
        for name, module in self._fixtures.items():
            config.pluginmanager.register(module, f"hil_workspace_fixtures_{name}")

    @pytest.hookimpl(wrapper=True)
    def pytest_make_collect_report(
        self, collector: pytest.Collector
    ) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
        """Report a module that ends the process as a collection error; of a syntax error, show only the place."""
        try:
            report = yield
        except SystemExit as error:
            text = f"E the module ends the process (sys.exit({error.code!r})): remove it, a run ends by itself"
            return pytest.CollectReport(collector.nodeid, "failed", text, [])
        if report.failed and _NOT_PYTHON.search(report.longreprtext):
            kept = [line for line in report.longreprtext.splitlines() if line.startswith("E ")]
            report.longrepr = "\n".join(kept)  # the import chain is of no use to anybody
        return report

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Keep collection errors, for the error that a person sees.

        The cases of a module that skips itself as a whole would be silently missing from the plan.
        """
        if report.failed:
            self.collection_errors.append((report.nodeid, report.longreprtext))
        elif report.skipped:
            text = "E the module skips itself: skip its cases one by one, so that each is NOT_RUN with its reason"
            self.collection_errors.append((report.nodeid, text))

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> Generator[None, object, object]:
        """Freeze the planned cases before anything is deselected or shuffled."""
        if not self.collection_errors:
            self._plan(items)
        return (yield)

    def _plan(self, items: list[pytest.Item]) -> None:
        try:
            self._planned = plan_cases(items, self.configuration)
            self._skipped = skipped_cases(self._planned, self.configuration.request)
        except HilError as error:
            self._refuse(error)

    def pytest_deselected(self, items: Sequence[pytest.Item]) -> None:
        """Keep what pytest or another plugin deselected."""
        self._deselected.update(item.nodeid for item in items)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtestloop(self, session: pytest.Session) -> Generator[None, object, object]:
        """Arm before the first case and make safe after the last, whatever happens in between."""
        if self.collection_errors or not self._planned or session.config.option.collectonly:
            return (yield)
        try:
            self.session = self._opener(self.configuration, list(self._planned.values()))
        except HilError as error:
            self._refuse(error)
        try:
            self.session.arm({*self._skipped, *self._deselected})
            return (yield)
        finally:
            try:
                self.session.safe()
            finally:
                self._note_not_run()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        """Begin the case before its set-up, and end it after its teardown."""
        reason = self._reason_against(item)
        if reason:
            self._skip(item, reason)
            return (yield)
        run = self.running.begin(self._planned[item.nodeid])
        try:
            return (yield)
        except BaseException as error:
            run.raised(error)
            self._tear_down(item)
            raise
        finally:
            self.running.end(run)
            self._ended.add(item.nodeid)

    def _tear_down(
        self, item: pytest.Item, nextitem: pytest.Item | None = None, begun: Iterable[_Finalizers] = ()
    ) -> None:
        """Tear down what is left of a case that ended pytest or its own teardown; after the seal it would be too late.

        Args:
            item: the case.
            nextitem: the case after it, whose fixtures stay.
            begun: the finalizers that pytest has begun to call.
        """
        run = self.running.current
        with self.running.flags.case_code(partial(_is_own, sys._getframe())):  # noqa: SLF001 - as below
            for finalizers in (*begun, *_left_set_up(item, nextitem)):
                while finalizers:
                    try:
                        finalizers.pop()()
                    except BaseException as error:  # noqa: BLE001 - whatever is raised, the rest is torn down
                        if run is not None:
                            run.raised(error, run.escapes.place_of(error))

    @pytest.hookimpl(wrapper=True, trylast=True)
    def pytest_runtest_setup(self) -> Generator[None, object, object]:
        """Let whatever ends a case's own code end its fixtures' code as well."""
        return (yield from self._fixtures_code(sys._getframe(1)))  # noqa: SLF001 - the only way to the caller

    @pytest.hookimpl(wrapper=True, trylast=True)
    def pytest_runtest_teardown(
        self, item: pytest.Item, nextitem: pytest.Item | None
    ) -> Generator[None, object, object]:
        """Do the same in the teardown, and tear down what pytest leaves after a stop or timeout in it."""
        stack = item.session._setupstate.stack  # noqa: SLF001 - pytest has no public way to it
        before = {node: finalizers for node, (finalizers, _) in reversed(stack.items())}
        try:
            return (yield from self._fixtures_code(sys._getframe(1)))  # noqa: SLF001 - as above
        except Exception:
            raise
        except BaseException:
            self._tear_down(item, nextitem, [before[node] for node in before if node not in stack])
            raise

    def _fixtures_code(self, caller: FrameType) -> Generator[None, object, object]:
        limit = sys.getrecursionlimit()
        with self.running.flags.case_code(partial(_is_own, caller)):
            try:
                return (yield)
            finally:
                sys.setrecursionlimit(limit)  # as below

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_pyfunc_call(self) -> Generator[None, object, object]:
        """Let an urgent stop end the case's own code, wherever it is; note here whatever it raises.

        So code that later makes pytest believe that nothing was raised does not deceive the run.
        """
        run = self.running.current
        caller, limit = sys._getframe(1), sys.getrecursionlimit()  # noqa: SLF001 - as above
        try:
            with self.running.flags.case_code(partial(_is_own, caller)):
                try:
                    return (yield)
                finally:
                    sys.setrecursionlimit(limit)  # a limit set by the case would end the run itself
        except (pytest.skip.Exception, pytest.xfail.Exception) as error:
            _skip_within(run, error)
            raise
        except BaseException as error:
            if run is not None:
                run.raised(error, run.escapes.place_of(error))
            raise

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Let the verdict decide how pytest counts a case."""
        report = yield
        run = self.session.current if self.session else None
        if run is None:
            return report
        if call.excinfo is not None and call.excinfo.errisinstance((pytest.skip.Exception, pytest.xfail.Exception)):
            _skip_within(run, call.excinfo.value)
        elif call.excinfo is not None:
            run.raised(call.excinfo.value, run.escapes.place_of(call.excinfo.value))
            self._stop(item.session, call.excinfo.value)
        run.escapes.hear(run.raised)
        for error in self._code.intact.replaced() if call.when != "setup" else ():
            run.raised(error)
        if call.when == "call":
            run.finish()
            _judge(report, run)
        elif report.failed:
            report.longrepr = "\n".join(run.outcome().reasons)
        return report

    def pytest_report_teststatus(
        self, report: pytest.CollectReport | pytest.TestReport
    ) -> tuple[str, str, tuple[str, dict[str, bool]]] | None:
        """Show the verdict instead of pytest's outcome."""
        verdict = dict(getattr(report, "user_properties", ())).get("verdict")
        if report.when != "call" or not isinstance(verdict, str):
            return None
        good = Verdict(verdict).good
        return report.outcome, "." if good else verdict[0], (verdict, {"green" if good else "red": True})

    def _refuse(self, error: HilError) -> NoReturn:
        """End pytest with its exit code for wrong usage; the launcher reports the error."""
        self.error = error
        pytest.exit(str(error), returncode=pytest.ExitCode.USAGE_ERROR)

    def _stop(self, session: pytest.Session, error: BaseException) -> None:
        if isinstance(error, Stopped) or self.running.flags.reason:
            session.shouldstop = f"stopped by {self.running.flags.reason}"

    def _reason_against(self, item: pytest.Item) -> str:
        """Return why this case is not run, empty if it is."""
        running = self.running
        if known := self._skipped.get(item.nodeid) or running.poison:
            return known
        if running.flags.reason:
            item.session.shouldstop = f"stopped by {running.flags.reason}"
            return str(item.session.shouldstop)
        if item.get_closest_marker("xfail"):
            return "marked xfail: a failure that is expected is no verdict"
        return ""

    def _skip(self, item: pytest.Item, reason: str) -> None:
        self.running.not_run(item.nodeid, reason)
        self._ended.add(item.nodeid)
        item.add_marker(pytest.mark.skip(reason=reason), append=False)

    def _note_not_run(self) -> None:
        """Note the reason for every planned case that never began."""
        stopped = self.running.flags.reason
        reason = f"stopped by {stopped}" if stopped else ENDED_BEFORE
        for case in self._planned:
            if case not in self._ended:
                self.running.not_run(case, DESELECTED if case in self._deselected else reason)


def _left_set_up(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[_Finalizers]:
    """Yield what is set up and not needed by the next case from pytest's stack, the innermost first."""
    stack = item.session._setupstate.stack  # noqa: SLF001 - as above
    needed = nextitem.listchain() if nextitem else []
    while list(stack) != needed[: len(stack)]:
        yield stack.popitem()[1][0]


def _is_own(caller: FrameType, frame: FrameType | None) -> bool:
    """Return whether an exception raised where a signal arrived ends a case's own code and passes through nothing else.

    Args:
        caller: the frame that calls the hook within which a case's code runs.
        frame: where the signal arrived.
    """
    name = ""
    while frame is not None and not name:
        name = f"{frame.f_globals.get('__name__')}."
        if name.partition(".")[0] in _LIBRARIES and not name.startswith(_CALLERS):
            name, frame = "", frame.f_back  # its caller decides
    if name.startswith(_CALLERS):
        return False
    while frame is not None and frame is not caller:
        frame = frame.f_back
    return frame is not None


def _skip_within(run: CaseRun | None, error: BaseException) -> None:
    if run is not None:
        run.skip(str(error))


def _judge(report: pytest.TestReport, run: CaseRun) -> None:
    outcome = run.outcome()
    report.user_properties.append(("verdict", outcome.verdict.value))
    if outcome.verdict is Verdict.NOT_RUN and report.skipped:
        return
    report.outcome = "passed" if outcome.verdict.good else "failed"
    report.longrepr = None if outcome.verdict.good else "\n".join((outcome.verdict.value, *outcome.reasons))
