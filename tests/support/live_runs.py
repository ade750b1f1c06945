"""Runs on a served bench `battery`: a plan that has every output on, and ends in whatever way a test wants."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from battery_runs import BatteryWorkspace, battery_workspace
from workspaces import ROOT, finish, kill

from hil.simulation.served.client import ask

__all__ = ["OUTPUTS", "ON", "Served", "live_workspace", "on_plan", "served", "wait_for"]

_REQUIREMENTS = """\
schema: hil/requirements/1
document: {id: "LIVE", issue: "1.0", title: Every output is on}
requirements:
- {id: LIVE-010, rev: 1, text: The plates shall have a temperature., kind: limit, method: test,
   limits: [{parameter: temperature, unit: degC, min: "-50", max: "90"}]}
"""

ON = '''\
"""Every output of the bench is on."""

import time

import numpy as np
import pytest


@pytest.mark.requirement("LIVE-010")
@pytest.mark.max_duration(3600)
def test_on(supply, thermal, cycler, clock, record, check, step, operator):
    """The supplies feed, the plates are cooled, and the tester charges the cell."""
    with step("Switch on"):
        supply.apparatus.configure(12.0, 0.5)
        supply.apparatus.enable()
        supply.charge.configure(4.2, 0.7)
        supply.charge.enable()
        supply.tec.configure(12.0, 5.0)
        supply.tec.enable()
        thermal.hold(10.0)
        clock.sleep(1.0)
        cycler.prepare(1, time=7200.0)
        cycler.start()
        clock.sleep(6.0)
    with step("All is on"):
        {body}
    check("LIVE-010", "temperature", thermal.temperature())
'''

OUTPUTS = {
    "psu1 1": "peers.psu1.outputs.1.on",
    "psu1 2": "peers.psu1.outputs.2.on",
}


@dataclass(frozen=True)
class Served:
    """A bench that a process of its own serves."""

    folder: Path
    process: subprocess.Popen[str]

    def ask(self, **document: object) -> object:
        """Ask the one thing and return the answer."""
        ((key, _),) = document.items()
        return ask(self.folder, document)[key]

    def state(self, path: str) -> object:
        """Return what is true."""
        return self.ask(state=path)


@contextmanager
def served(folder: Path, workspace: Path = ROOT, bench: str = "battery", speed: float = 1.0) -> Iterator[Served]:
    """Serve a bench in a folder of a short name until the context is left."""
    command = [sys.executable, "-m", "hil.cli", "simulate", bench, "--folder", str(folder), "--speed", f"{speed:g}"]
    process = subprocess.Popen(command, cwd=workspace, stdout=subprocess.PIPE, text=True)
    try:
        for line in process.stdout or ():
            if line == "ready\n":
                break
        yield Served(folder, process)
    finally:
        kill(process)
        finish(process)


def live_workspace(root: Path, body: str = "clock.sleep(600.0)", changes: Mapping[str, str] | None = None):
    """Return a workspace with the bench `battery` and a plan that has every output on while `body` runs."""
    workspace: BatteryWorkspace = battery_workspace(root, "battery_charge", changes)
    plan = root / "testplans" / "on"
    plan.mkdir()
    (plan / "requirements.yaml").write_text(_REQUIREMENTS)
    (plan / "parameters.yaml").write_text("schema: hil/parameters/1\nparameters: []\n")
    (plan / "test_on.py").write_text(ON.replace("{body}", body.replace("\n", "\n        ")))
    return BatteryWorkspace(workspace.root, plan, workspace.environment)


def wait_for(true, seconds: float, what: str) -> float:
    """Wait until something is true and return after how many seconds it was."""
    began = time.monotonic()
    while not true():
        if time.monotonic() - began > seconds:
            raise AssertionError(f"{what}: not within {seconds:g} s")
        time.sleep(0.01)
    return time.monotonic() - began
