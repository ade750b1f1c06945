"""Whole runs of the battery plans on copies of the committed bench `battery`."""

from __future__ import annotations

import io
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from workspaces import ROOT, Ran, Workspace

from hil.evidence.package.contents import Package
from hil.executive.setup.configuration import Request
from hil.model.identity import Source
from hil.plugin.running import run

__all__ = ["BatteryWorkspace", "battery_workspace"]

_BENCH = "fixtures/benches/battery/bench.yaml"


@dataclass(frozen=True)
class BatteryWorkspace(Workspace):
    """A workspace whose bench is the battery's."""

    def request(self, **changes) -> Request:
        """Return the request for the plan on the simulated bench."""
        wanted = {"start": self.root, "plans": (self.plan.name,), "bench": "battery", "dut": "SIM-BAT-1"}
        return Request(**{**wanted, "source": Source.SIMULATED, **changes})

    @property
    def run_arguments(self) -> tuple[str, ...]:
        """`run` for the plan on the simulated bench."""
        return ("run", self.plan.name, "--bench", "battery", "--dut", "SIM-BAT-1", "--source", "simulated")

    def run(self, **changes) -> Ran:
        """Run the plan in this process, and return how it ended."""
        before, out = self.folders(), io.StringIO()
        code = run(self.request(**changes), out)
        (folder,) = [folder for folder in self.folders() if folder not in before]
        return Ran(code, out.getvalue(), Package(folder))


def battery_workspace(root: Path, plan: str, changes: Mapping[str, str] | None = None) -> BatteryWorkspace:
    """Copy bench, fixtures and one plan as they are committed into `root`, which must not exist yet.

    Args:
        root: the workspace's folder.
        plan: `battery_charge`, for example.
        changes: texts of the bench file, each of which is there once.
    """
    skipped = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "fixtures", root / "fixtures", ignore=skipped)
    shutil.copytree(ROOT / "testplans" / plan, root / "testplans" / plan, ignore=skipped)
    shutil.copy(ROOT / "testplans/requirements.yaml", root / "testplans")
    (root / "hil.toml").touch()
    workspace = BatteryWorkspace(root, root / "testplans" / plan)
    workspace.change(_BENCH, changes or {})
    return workspace
