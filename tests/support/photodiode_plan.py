"""The plan `photodiode` on copies of the committed bench, short or whole."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

from workspaces import ROOT, Workspace

__all__ = ["ON_BENCH", "photodiode_workspace"]

PLAN = "photodiode"
ON_BENCH = {"bench": PLAN, "dut": "SIM-OUT-1"}
_SHORT = {
    f"testplans/{PLAN}/parameters.yaml": {
        '{name: leg, value: "4250"': '{name: leg, value: "500"',
        '{name: held, value: "60"': '{name: held, value: "20"',
        '{name: settling, value: "10"': '{name: settling, value: "4"',
    },
    f"fixtures/benches/{PLAN}/bench.yaml": {
        '        reference: "3.2968"\n': '        reference: "3.2968"\n'
        + "".join(
            f"        {line}\n"
            for line in ('ambient: "11"', 'capacity: "220"', 'junction_lag: "1"', 'sensor_lag: "1.5"')
        ),
    },
}


def photodiode_workspace(
    root: Path,
    *,
    whole: bool = False,
    bench: Mapping[str, str] | None = None,
    parameters: Mapping[str, str] | None = None,
) -> Workspace:
    """Copy bench, fixtures and plan.

    Args:
        root: the workspace's folder, which must not exist yet.
        whole: with the box and the times that are committed; else with a light box that warms in 500 s.
        bench: texts of the bench file to replace, each of which is there once.
        parameters: the same of the parameters.
    """
    skipped = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "fixtures", root / "fixtures", ignore=skipped)
    shutil.copytree(ROOT / "testplans" / PLAN, root / "testplans" / PLAN, ignore=skipped)
    shutil.copy(ROOT / "testplans/requirements.yaml", root / "testplans/requirements.yaml")
    (root / "hil.toml").touch()
    workspace = Workspace(root, root / "testplans" / PLAN)
    if not whole:
        for file, changes in _SHORT.items():
            workspace.change(file, changes)
        catalogue = workspace.plan / "requirements.yaml"
        text = catalogue.read_text(encoding="utf-8")
        catalogue.write_text(text.replace("duration: 4240 s", "duration: 490 s"), encoding="utf-8")
        workspace.lock()
    workspace.change(f"fixtures/benches/{PLAN}/bench.yaml", bench or {})
    workspace.change(f"testplans/{PLAN}/parameters.yaml", parameters or {})
    return workspace
