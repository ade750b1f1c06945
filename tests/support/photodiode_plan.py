"""The plan `photodiode` on copies of the committed bench, short or whole."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

from workspaces import ROOT, Workspace

__all__ = ["ON_BENCH", "photodiode_workspace"]

PLAN = "photodiode"
ON_BENCH = {"bench": PLAN, "dut": "SIM-OUT-1"}
_TRUE = '        lamp_heat: "3"\n'


def _shortened(leg: int) -> dict[str, dict[str, str]]:
    """Return what makes the plan short: times, and a box as much lighter, whose thermometer is as much quicker."""
    truth = {"ambient": "12", "capacity": f"{0.44 * leg:.0f}", "junction_lag": "1", "sensor_lag": "1.5"}
    return {
        f"testplans/{PLAN}/parameters.yaml": {
            '{name: leg, value: "4250"': f'{{name: leg, value: "{leg}"',
            '{name: held, value: "60"': f'{{name: held, value: "{leg / 50:g}"',
            '{name: settling, value: "10"': f'{{name: settling, value: "{max(1.0, leg / 250):g}"',
        },
        f"fixtures/benches/{PLAN}/bench.yaml": {
            _TRUE: _TRUE + "".join(f'        {name}: "{value}"\n' for name, value in truth.items()),
        },
    }


def photodiode_workspace(
    root: Path,
    *,
    leg: int | None = 500,
    bench: Mapping[str, str] | None = None,
    parameters: Mapping[str, str] | None = None,
    requirements: Mapping[str, str] | None = None,
) -> Workspace:
    """Copy bench, fixtures and plan.

    Args:
        root: the workspace's folder, which must not exist yet.
        leg: seconds in which a light box warms, and cools; None for the box and the times that are committed.
        bench: texts of the bench file to replace, each of which is there once.
        parameters: the same of the parameters.
        requirements: the same of the requirements, which are locked afterwards.
    """
    skipped = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "fixtures", root / "fixtures", ignore=skipped)
    shutil.copytree(ROOT / "testplans" / PLAN, root / "testplans" / PLAN, ignore=skipped)
    shutil.copy(ROOT / "testplans/requirements.yaml", root / "testplans/requirements.yaml")
    (root / "hil.toml").touch()
    workspace = Workspace(root, root / "testplans" / PLAN)
    if leg is not None:
        for file, changes in _shortened(leg).items():
            workspace.change(file, changes)
        catalogue = workspace.plan / "requirements.yaml"
        text = catalogue.read_text(encoding="utf-8")
        catalogue.write_text(text.replace("duration: 4240 s", f"duration: {leg - 10} s"), encoding="utf-8")
    workspace.change(f"testplans/{PLAN}/requirements.yaml", requirements or {})
    if leg is not None or requirements:
        workspace.lock()
    workspace.change(f"fixtures/benches/{PLAN}/bench.yaml", bench or {})
    workspace.change(f"testplans/{PLAN}/parameters.yaml", parameters or {})
    return workspace
