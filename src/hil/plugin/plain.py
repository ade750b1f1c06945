"""Plain `pytest testplans --bench NAME`: the same run, under somebody's own pytest."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from hil.evidence.package.contents import Package
from hil.executive.setup.configuration import Request, configure
from hil.model.errors import HilError, Refused
from hil.model.identity import Source
from hil.plugin.campaign import Campaign
from hil.plugin.chosen import Chosen
from hil.plugin.opening import open_new
from hil.report.sentences import headline
from hil.report.write import write_reports

__all__ = ["configure_plain"]


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
        campaign = Campaign(configuration, partial(open_new, alone=True))
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
