"""The plans `solar_cells` and `solar_inspection` on copies of the committed bench."""

from __future__ import annotations

import shutil
from pathlib import Path

from workspaces import ROOT, Workspace

__all__ = ["COMMAND", "DOCUMENTS", "ON_BENCH", "solar_workspace"]

DOCUMENTS = "fixtures/documents/solar"
ON_BENCH = {"bench": "solar", "dut": "SIM-SOL-1"}
COMMAND = ("--bench", "solar", "--dut", "SIM-SOL-1", "--source", "simulated")
"""What follows `run` and the plan's name."""


def solar_workspace(root: Path, plan: str = "solar_cells") -> Workspace:
    """Copy bench, fixtures and one of the two plans into a folder that does not exist yet."""
    for each in ("fixtures", f"testplans/{plan}"):
        shutil.copytree(ROOT / each, root / each, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "testplans/requirements.yaml", root / "testplans")
    (root / "hil.toml").touch()
    return Workspace(root, root / "testplans" / plan)
