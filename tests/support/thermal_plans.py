"""The plans `imu_lamp` and `imu_vacuum` on copies of the committed bench `imu`, short or whole, and what they found."""

from __future__ import annotations

import csv
import io
import re
import shutil
from collections.abc import Mapping
from pathlib import Path

from scipy import stats
from told_as_json import bodies, results_as_json
from workspaces import ROOT, Ran, Workspace

from hil.bench.file.reading import load_bench

__all__ = ["LAMP", "VACUUM", "checks", "covers", "fragment_table", "requirements_of", "thermal_workspace", "true_drift"]

LAMP, VACUUM = "imu_lamp", "imu_vacuum"
DUT = "SIM-IMU-1"

_SHORT: Mapping[str, Mapping[str, Mapping[str, str]]] = {
    LAMP: {
        "parameters": {
            '{name: heating, value: "300"': '{name: heating, value: "150"',
            '{name: cooling, value: "300"': '{name: cooling, value: "150"',
            '{name: soak, value: "300"': '{name: soak, value: "60"',
        },
        "requirements": {"duration: 590 s": "duration: 290 s"},
    },
    VACUUM: {
        "parameters": {
            'values: ["43", "-26", "43", "22"]': 'values: ["32", "12", "22"]',
            '{name: ramp, value: "60"': '{name: ramp, value: "15"',
            '{name: soak, value: "2400"': '{name: soak, value: "300"',
            '{name: rate, value: "0.5"': '{name: rate, value: "1"',
        },
        "requirements": {'min: "40"': 'min: "28"', 'max: "-20"': 'max: "16"'},
    },
}


def thermal_workspace(
    root: Path, plan: str, *, whole: bool = False, bench: Mapping[str, str] | None = None
) -> Workspace:
    """Copy bench, fixtures and one plan.

    Args:
        root: the workspace's folder, which must not exist yet.
        plan: `LAMP` or `VACUUM`.
        whole: with the parameters that are committed, not the short ones.
        bench: texts of the bench file to replace, each of which is there once.
    """
    skipped = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "fixtures", root / "fixtures", ignore=skipped)
    shutil.copytree(ROOT / "testplans" / plan, root / "testplans" / plan, ignore=skipped)
    shutil.copy(ROOT / "testplans/requirements.yaml", root / "testplans/requirements.yaml")
    (root / "hil.toml").touch()
    workspace = Workspace(root, root / "testplans" / plan)
    if not whole:
        for file, changes in _SHORT[plan].items():
            workspace.change(f"testplans/{plan}/{file}.yaml", changes)
        workspace.lock()
    workspace.change("fixtures/benches/imu/bench.yaml", bench or {})
    return workspace


def requirements_of(ran: Ran) -> dict[str, str]:
    """Return the verdict of each requirement by the number at the end of its id."""
    (case,) = results_as_json(ran.package)["cases"]
    return {name[-3:]: str(verdict) for name, verdict in case["requirements"].items()}


def checks(ran: Ran, parameter: str) -> list[Mapping[str, object]]:
    """Return the checks of one parameter."""
    return [event for event in bodies(ran.package, "check") if event["parameter"] == parameter]


def covers(check: Mapping[str, object], true: float) -> bool:
    """Return whether the 95 % interval of what was checked holds the true value; a figure that is none does not."""
    if check["uncertainty"] is None:
        return False
    value, uncertainty, dof = (float(check[name]) for name in ("value", "uncertainty", "dof"))
    return abs(value - true) <= float(stats.t.ppf(0.975, dof)) * uncertainty


def true_drift(of: str) -> float:
    """Return the drift [unit/K] that the bench file puts into an axis, such as `gyroscope.bno2.x`."""
    role, instance, axis = of.split(".")
    bench = load_bench(ROOT / "fixtures/benches", "imu", ROOT)
    device = instance if re.search(r"\d$", instance) else f"{instance}1"
    truth = next(peer.truth for peer in bench.simulated.peers if peer.device == device)
    return float(truth[f"bias_{axis}"][1] if role == "gyroscope" else truth["drift"]["xyz".index(axis)])


def fragment_table(ran: Ran) -> list[dict[str, str]]:
    """Return the table of fragments that the vacuum plan wrote down."""
    return [*csv.DictReader(io.StringIO(ran.package.text("data/attachments/test_vacuum-fragments.csv")))]
