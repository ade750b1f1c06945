"""Plain `pytest testplans --bench NAME`: the same run, under the user's own pytest."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from _pytest.fixtures import reorder_items  # pytest has no public way to it

from hil.evidence.package.contents import Package
from hil.executive.setup.configuration import Configuration, Request, configure, fitting_plans
from hil.model.errors import HilError, Refused
from hil.model.identity import Source
from hil.plugin.campaign import Campaign
from hil.plugin.opening import open_new
from hil.plugin.plans.frozen_code import frozen_code
from hil.report.sentences import headline
from hil.report.write import write_reports

__all__ = ["Chosen", "configure_plain"]


class Chosen:
    """Collects whole plans, so that they are planned, and deselects what was not named.

    Args:
        arguments: folders, files and cases, as pytest was given them.
        plans: the folders of the run's plans.

    Attributes:
        single: whether anything but folders was named.
        whole: what to collect: the plans of named files and cases, and everything else as it was named.
    """

    def __init__(self, arguments: Sequence[str], plans: Sequence[Path]) -> None:
        self._arguments = tuple(arguments)
        whole = (plan for argument in self._arguments for plan in _plans_of(argument, plans))
        self.whole = list(dict.fromkeys(whole))
        self.single = any(not Path(argument).is_dir() for argument in self._arguments)

    def pytest_collection_modifyitems(
        self, session: pytest.Session, config: pytest.Config, items: list[pytest.Item]
    ) -> None:
        """Deselect every case that was not named.

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


def _plans_of(argument: str, plans: Sequence[Path]) -> Sequence[str]:
    """Return the plans of the run that contain an argument or are in it; the argument itself if there are none."""
    path = Path(argument.partition("::")[0]).resolve()
    if path.parent in plans and not path.is_dir():
        return [str(path.parent)]
    return [str(plan) for plan in plans if path in plan.parents] or [argument]


def _is_meant(item: pytest.Item, argument: str) -> bool:
    place, _, name = argument.partition("::")
    path, own = Path(place).resolve(), item.nodeid.partition("::")[2]
    return item.path.is_relative_to(path) and (not name or own == name or own.startswith((f"{name}::", f"{name}[")))


class _InPlanOrder:
    """Runs the cases in plan order, whatever other plugins and options ask for.

    Args:
        notices: lines for pytest to print once the cases are collected.
    """

    def __init__(self, notices: Sequence[str]) -> None:
        self._notices = list(notices)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> Generator[None, object, object]:
        """Put the remaining cases back into the order in which they were collected."""
        place = {item: number for number, item in enumerate(reorder_items(items))}
        result = yield
        before = list(items)
        items.sort(key=lambda item: place.get(item, len(place)))
        if before != items:
            self._notices.append(
                "hil: the cases run in the order of their plan, not in the one that pytest was to give them"
            )
        return result

    def pytest_report_collectionfinish(self) -> list[str]:
        """Report what differs from what was asked for."""
        return self._notices


def configure_plain(config: pytest.Config) -> None:
    """Register a campaign for the plans named on pytest's command line.

    Raises:
        pytest.UsageError: for hardware, for distributed or repeated cases, for a root folder that is not the
            workspace's, and for wrong files.
    """
    try:
        _refuse_others(config)
        configuration = _configured(config)
        _refuse_other_root(config, configuration.workspace.root)
        stack = ExitStack()
        config.add_cleanup(stack.close)
        code = stack.enter_context(frozen_code(configuration))
        campaign = Campaign(configuration, partial(open_new, alone=True), code)
    except HilError as error:
        raise pytest.UsageError(str(error)) from None
    config.pluginmanager.register(campaign, "hil_campaign")
    config.pluginmanager.register(_Seal(campaign), "hil_seal")
    notices = _notices(config, configuration)
    chosen = Chosen(config.args, configuration.plans)
    config.args = chosen.whole
    if chosen.single:
        config.pluginmanager.register(chosen, "hil_chosen")
    # With it, --lf would not even collect what passed; without it, --lf deselects that afterwards.
    if config.pluginmanager.has_plugin("lfplugin-collwrapper"):
        config.pluginmanager.unregister(name="lfplugin-collwrapper")
    config.pluginmanager.register(_InPlanOrder(notices), "hil_in_plan_order")


def _configured(config: pytest.Config) -> Configuration:
    """Return what the command line asks for; of plans named only by a folder above them, those for the article."""
    request = _request(config)
    named = {Path(str(argument).partition("::")[0]).resolve() for argument in config.args}
    if any(plan in path.parents or path == plan for plan in map(Path, request.plans) for path in named):
        return configure(request)
    return configure(replace(request, plans=fitting_plans(request)))


class _Seal:
    """Seals the run when pytest has ended, and prints where the package is."""

    def __init__(self, campaign: Campaign) -> None:
        self._campaign = campaign

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> object:
        """Make the run's exit code pytest's."""
        running = self._campaign.session
        if running is not None:
            session.exitstatus = running.exit_code(int(exitstatus))
            running.seal(int(session.exitstatus), write_reports)
        return (yield)

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Print the run's verdict, which covers all planned cases, and the package."""
        if self._campaign.session is not None:
            results = Package(self._campaign.session.folder).outcome()
            terminalreporter.write_line(f"{results.verdict}  {headline(results)}")
            terminalreporter.write_line(f"package: {self._campaign.session.folder}")


def _notices(config: pytest.Config, configuration: Configuration) -> list[str]:
    """Return a line for the plans that are not for the article, if any, and one for each `time.sleep`."""
    plans = {plan.name for plan in configuration.plans}
    others = [name for asked in _request(config).plans if (name := Path(asked).name) not in plans]
    left_out = [f"hil: not for {configuration.dut.serial}, left out: {', '.join(others)}"] if others else []
    return [*left_out, *(f"hil: {text}" for text in configuration.inputs.sleeps)]


_REPEATED = "a case has one verdict in a run, and repeats only what its plan says"
_ONE = "a bench has one executive, which runs its cases one after the other"


def _refuse_others(config: pytest.Config) -> None:
    if config.getoption("source") == Source.HARDWARE:
        raise Refused("plain pytest drives in-process simulated benches only", "use hil run")
    if _is_distributed(config):
        raise Refused(f"pytest-xdist: {_ONE}", "leave out -n, --dist and --tx, also in addopts")
    if config.getoption("reruns", None) or config.getoption("force_reruns", None) or _ini(config, "reruns"):
        raise Refused(f"pytest-rerunfailures: {_REPEATED}", "leave out --reruns, also in the settings of pytest")
    if (config.getoption("count", 1) or 1) != 1 and config.pluginmanager.has_plugin("repeat"):
        raise Refused(f"pytest-repeat: {_REPEATED}", "leave out --count, and start the run several times")


def _is_distributed(config: pytest.Config) -> bool:
    asked = [config.getoption(name, None) for name in ("numprocesses", "tx", "looponfail")]
    return any(asked) or config.getoption("dist", "no") != "no"


def _ini(config: pytest.Config, name: str) -> object:
    """Return a setting of another plugin, None if there is no such plugin."""
    with suppress(ValueError):
        return config.getini(name)
    return None


def _refuse_other_root(config: pytest.Config, root: Path) -> None:
    """Refuse a root folder that would give cases other names than in every other run."""
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
    """Return the plan at a path, or those directly below it."""
    if (path / "requirements.yaml").is_file() and list(path.glob("test_*.py")):
        return [path]
    return sorted(found.parent for found in path.glob("*/requirements.yaml"))
