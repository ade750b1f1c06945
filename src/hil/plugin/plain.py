"""Plain `pytest testplans --bench NAME`: the same run, under somebody's own pytest."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import pytest

from hil.evidence.package.contents import Package
from hil.executive.setup.configuration import Request, configure
from hil.model.errors import HilError, Refused
from hil.model.identity import Source
from hil.plugin.campaign import Campaign
from hil.plugin.opening import open_new
from hil.plugin.plans.frozen_code import frozen_code
from hil.report.sentences import headline
from hil.report.write import write_reports

__all__ = ["Chosen", "configure_plain"]


class Chosen:
    """Lets whole plans be collected, so that they are planned, and takes out what nobody named.

    Args:
        arguments: folders, files and cases, as pytest was given them.
        plans: the folders of the run's plans.

    Attributes:
        single: whether anything but folders was named.
        whole: what to collect: the plans of named files and cases, and everything else as it was named.
    """

    def __init__(self, arguments: Sequence[str], plans: Sequence[Path]) -> None:
        self._arguments = tuple(arguments)
        whole = (_plan_of(argument, plans) for argument in self._arguments)
        self.whole = list(dict.fromkeys(whole))
        self.single = any(not Path(argument).is_dir() for argument in self._arguments)

    def pytest_collection_modifyitems(
        self, session: pytest.Session, config: pytest.Config, items: list[pytest.Item]
    ) -> None:
        """Deselect every case that nobody named.

        Raises:
            pytest.UsageError: for a name that no case has.
        """
        if session.testsfailed:  # pytest reports what could not be collected
            return
        for argument in self._arguments:
            if not any(_is_meant(item, argument) for item in items):
                raise pytest.UsageError(f"there is no case {argument}")
        named = [item for item in items if any(_is_meant(item, argument) for argument in self._arguments)]
        others = [item for item in items if item not in named]
        if others:
            config.hook.pytest_deselected(items=others)
            items[:] = named


def _plan_of(argument: str, plans: Sequence[Path]) -> str:
    path = Path(argument.partition("::")[0]).resolve()
    return str(path.parent) if path.parent in plans and not path.is_dir() else argument


def _is_meant(item: pytest.Item, argument: str) -> bool:
    place, _, name = argument.partition("::")
    path, own = Path(place).resolve(), item.nodeid.partition("::")[2]
    return item.path.is_relative_to(path) and (not name or own == name or own.startswith((f"{name}::", f"{name}[")))


def configure_plain(config: pytest.Config) -> None:
    """Register a campaign for the plans named on pytest's command line.

    Raises:
        pytest.UsageError: for hardware, for distributed or reordered runs, for a root folder that is not the
            workspace's, and for wrong files.
    """
    try:
        _refuse_others(config)
        configuration = configure(_request(config))
        _refuse_other_root(config, configuration.workspace.root)
        stack = ExitStack()
        config.add_cleanup(stack.close)
        code = stack.enter_context(frozen_code(configuration))
        campaign = Campaign(configuration, partial(open_new, alone=True), code)
    except HilError as error:
        raise pytest.UsageError(str(error)) from None
    config.pluginmanager.register(campaign, "hil_campaign")
    config.pluginmanager.register(_Seal(campaign), "hil_seal")
    chosen = Chosen(config.args, configuration.plans)
    if chosen.single:
        config.args = chosen.whole
        config.pluginmanager.register(chosen, "hil_chosen")


class _Seal:
    """Seals when pytest has ended, and says where the package is."""

    def __init__(self, campaign: Campaign) -> None:
        self._campaign = campaign

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> object:
        """Let the run's exit code be pytest's."""
        running = self._campaign.session
        if running is not None:
            session.exitstatus = running.exit_code(int(exitstatus))
            running.seal(int(session.exitstatus), write_reports)
        return (yield)

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Tell the run's verdict, which is that of all planned cases, and name the package."""
        if self._campaign.session is not None:
            results = Package(self._campaign.session.folder).outcome()
            terminalreporter.write_line(f"{results.verdict}  {headline(results)}")
            terminalreporter.write_line(f"package: {self._campaign.session.folder}")


def _refuse_others(config: pytest.Config) -> None:
    if config.getoption("source") == Source.HARDWARE:
        raise Refused("plain pytest drives in-process simulated benches only", "use hil run")
    if config.getoption("numprocesses", None) or config.getoption("reruns", None):
        raise Refused("a bench has one executive: no -n and no --reruns", "use hil run")


def _refuse_other_root(config: pytest.Config, root: Path) -> None:
    """Refuse what would give cases other names than every other run does."""
    if config.rootpath.resolve() != root.resolve():
        what = f"cases are named from the workspace's folder on, and pytest names them from {config.rootpath} on"
        raise Refused(what, f"give pytest --rootdir {root}")


def _request(config: pytest.Config) -> Request:
    start = Path.cwd()
    named = [Path(str(argument).partition("::")[0]).resolve() for argument in config.args]
    plans = [folder for path in named for folder in _plans_at(path if path.is_dir() else path.parent)]
    output = config.getoption("bench_output")
    return Request(
        start=start,
        plans=tuple(dict.fromkeys(str(plan) for plan in plans)),
        bench=str(config.getoption("bench")),
        dut=str(config.getoption("dut")),
        source=Source.SIMULATED,
        output=Path(output).resolve() if output else None,
    )


def _plans_at(path: Path) -> list[Path]:
    """Return the plan that a path is, or those right below it."""
    if (path / "requirements.yaml").is_file() and list(path.glob("test_*.py")):
        return [path]
    return sorted(found.parent for found in path.glob("*/requirements.yaml"))
