"""Runs on a served bench `battery`: a plan that has every output on, and ends in whatever way a test wants."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from battery_runs import BatteryWorkspace, battery_workspace
from workspaces import ROOT, Ended, command_line, executive, finish, kill

from hil.simulation.served.folder import ask

__all__ = ["LiveRun", "Served", "guardian_of", "live_workspace", "put_away", "running", "seconds_until", "served"]

_REQUIREMENTS = """\
schema: hil/requirements/1
document: {id: LIVE, issue: "1.0", title: Every output is on}
requirements:
- {id: LIVE-010, rev: 1, text: The plates shall have a temperature., kind: limit, method: test,
   limits: [{parameter: temperature, unit: degC, min: "-50", max: "90"}]}
"""

_PLAN = '''\
"""Every output of the bench is on."""

import os
import re
import signal
import stat
import time
from pathlib import Path

import pytest


def begun():
    """Tell whoever waits for it."""
    Path("on").touch()


@pytest.mark.requirement("LIVE-010")
@pytest.mark.max_duration(36000)
@pytest.mark.repeatable("reading the bench does not change it")
def test_on(supply, thermal, cycler, clock, check, step, operator):
    """The supplies feed, the plates are cooled, and the tester charges the cell."""
    with step("Switch on"):
        supply.apparatus.configure(12.0, 0.5)
        supply.apparatus.enable()
        supply.charge.configure(4.2, 0.7)
        supply.charge.enable()
        supply.tec.configure(12.0, 5.0)
        supply.tec.enable()
        thermal.hold(10.0)
        cycler.prepare(1, time=7200.0)
        cycler.start()
        while cycler.state() != "charge":
            clock.sleep(1.0)
    with step("All is on"):
        begun()
        {body}
    check("LIVE-010", "temperature", thermal.temperature())
'''

_ON = ("psu1.channels.1.on", "psu1.channels.2.on", "psu2.output.on")


@dataclass(frozen=True)
class Served:
    """A bench that a process of its own serves."""

    folder: Path
    process: subprocess.Popen[str]

    def ask(self, **document: object) -> Any:
        """Ask for the one thing and return the answer."""
        ((key, _),) = document.items()
        return ask(self.folder, document)[key]

    def on(self) -> set[str]:
        """Return which outputs are on in truth: channels of supplies, relays, the drive of the coolers."""
        peers, plant = self.ask(state="peers"), self.ask(state="plants.battery")
        found = {path for path in _ON if _at(peers, path)}
        found |= {f"contact {name}" for name in ("charge", "discharge") if plant["inputs"][f"{name}_contact"]}
        return found | ({"coolers"} if plant["inputs"]["tec"] else set())


@dataclass(frozen=True)
class LiveRun:
    """A run that has every output on.

    Attributes:
        bench: where it is.
        workspace: whose plan it is.
        process: the command.
    """

    bench: Served
    workspace: BatteryWorkspace
    process: subprocess.Popen[str]

    @property
    def command(self) -> tuple[str, ...]:
        """What was called."""
        return _command(self.bench)

    @property
    def executive(self) -> int:
        """The process that holds the bench."""
        return executive(self.process)

    @property
    def guardian(self) -> int:
        """The process that watches over it."""
        return guardian_of(self.executive)

    def send(self, number: signal.Signals) -> None:
        """Send a signal to the executive."""
        os.kill(self.executive, number)

    def ended(self) -> Ended:
        """Wait for its end."""
        return finish(self.process)

    @property
    def folder(self) -> Path:
        """The run's folder."""
        return self.workspace.folders()[-1]


def guardian_of(process: int) -> int:
    """Return the guardian that a process has started; threads of that come and go while they are looked through."""
    children: list[int] = []
    for task in Path(f"/proc/{process}/task").iterdir():
        with suppress(FileNotFoundError, ProcessLookupError):
            children += map(int, (task / "children").read_text(encoding="ascii").split())
    return next(each for each in children if b"guardian" in Path(f"/proc/{each}/cmdline").read_bytes())


@contextmanager
def served(
    folder: Path, workspace: Path = ROOT, bench: str = "battery", speed: float = 1.0, first_port: int = 0
) -> Iterator[Served]:
    """Serve a bench in a folder of a short name until the context is left."""
    process = subprocess.Popen(
        command_line(
            "simulate", bench, "--folder", str(folder), "--speed", f"{speed:g}", "--first-port", str(first_port)
        ),
        cwd=workspace,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        for line in process.stdout or ():
            if line == "ready\n":
                break
        yield Served(folder, process)
    finally:
        kill(process)
        process.communicate()


def live_workspace(
    root: Path, body: str = "clock.sleep(36000.0)", changes: Mapping[str, str] | None = None, *, watched: bool = True
):
    """Return a workspace with the bench `battery` and a plan that has every output on while `body` runs.

    Args:
        root: its folder.
        body: statements of the case.
        changes: texts of the bench file.
        watched: whether the bench is watched after the end of a run, for some seconds.
    """
    # Nobody here waits for what a cell and its plates do afterwards.
    shorter = {
        'max: "0.02", for: 60 s': 'max: "0.02", for: 4 s',
        'tolerance: "4", within: 180 s': 'tolerance: "40", within: 8 s',
    }
    workspace = battery_workspace(root, "battery_charge", {**shorter, **(changes or {})})
    if not watched:
        file = root / "fixtures/benches/battery/bench.yaml"
        text = re.sub(r"^watch_after:\n(- .*\n)+", "", file.read_text(encoding="utf-8"), flags=re.MULTILINE)
        file.write_text(text, encoding="utf-8")
    plan = root / "testplans" / "on"
    plan.mkdir()
    (plan / "requirements.yaml").write_text(_REQUIREMENTS)
    (plan / "parameters.yaml").write_text("schema: hil/parameters/1\nparameters: []\n")
    (plan / "test_on.py").write_text(_PLAN.replace("{body}", body.replace("\n", "\n        ")))
    live = BatteryWorkspace(workspace.root, plan, workspace.environment)
    live.lock()
    return live


@contextmanager
def running(bench: Served, workspace: BatteryWorkspace, limit_s: float = 120.0) -> Iterator[LiveRun]:
    """Start a run and give it once every output is on, within a limit [s]; nothing of it is left behind."""
    begun = workspace.root / "on"
    begun.unlink(missing_ok=True)
    process = workspace.start(*_command(bench), stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    try:
        seconds_until(lambda: begun.exists() or process.poll() is not None, limit_s, "outputs on")
        assert process.poll() is None, process.communicate()[0]
        seconds_until(lambda: bench.on() >= {*_ON, "contact charge"}, 10.0, "every output on")
        yield LiveRun(bench, workspace, process)
    finally:
        put_away(process, workspace)


def put_away(process: subprocess.Popen[str], workspace: BatteryWorkspace) -> None:
    """Leave nothing of a run that a test broke off: no process, and no latch."""
    if process.poll() is None:
        kill(process)
        process.communicate()
        acknowledged = ("ack", workspace.folders()[-1].name, "--by", "Ada", "--text", "a test broke off")
        seconds_until(lambda: workspace.hil(*acknowledged).code == 0, 60.0, "acknowledged")


def _command(bench: Served) -> tuple[str, ...]:
    named = ("run", "on", "--bench", "battery", "--dut", "SIM-BAT-1", "--source", "simulated")
    return (*named, "--served", str(bench.folder))


def seconds_until(
    true: Callable[[], object], limit_s: float, what: str | Callable[[], str], every_s: float = 0.01
) -> float:
    """Wait until something is true, looking so often, and return after how many seconds it was."""
    began = time.monotonic()
    while not true():
        if time.monotonic() - began > limit_s:
            raise AssertionError(f"{what() if callable(what) else what}: not within {limit_s:g} s")
        time.sleep(every_s)
    return time.monotonic() - began


def _at(document: Any, path: str) -> Any:
    for name in path.split("."):
        document = document[name]
    return document
