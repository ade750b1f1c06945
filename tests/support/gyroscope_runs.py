"""Whole runs of the gyroscope plan, shortened, on copies of the committed bench `adcs` with faults in its twin."""

from __future__ import annotations

import shutil
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from told_as_json import bodies, results_as_json
from workspaces import ROOT, Workspace

from hil.evidence.package.contents import Package
from hil.executive.setup.configuration import configure
from hil.plugin.launch import launch
from hil.plugin.opening import open_new
from hil.simulation.world import World

__all__ = [
    "CALIBRATION",
    "NOISE",
    "Ended",
    "committed_workspace",
    "faulty",
    "gyroscope_workspace",
    "run_one",
    "truth",
]

CALIBRATION, NOISE = "test_calibration", "test_noise_at_rest"

_BENCH = "fixtures/benches/adcs/bench.yaml"
_PARAMETERS = {
    "rest_duration": 'value: "14400"',
    "static_duration": 'value: "60"',
    "turning_duration": 'value: "20"',
    "soak": 'value: "600"',
    "longest_soak": 'value: "5400"',
    "temperatures": 'values: ["-16", "10", "25", "40"]',
    "scale_temperatures": 'values: ["-16", "40"]',
    "other_temperatures": 'values: ["-16", "25", "40"]',
    "verification_rates": 'values: ["13.6", "-20", "27.2", "-27.2"]',
}
_SHORT = {
    "rest_duration": 'value: "300"',
    "static_duration": 'value: "20"',
    "turning_duration": 'value: "10"',
    "soak": 'value: "120"',
    "temperatures": 'values: ["25", "40"]',
    "scale_temperatures": 'values: ["25", "40"]',
    "other_temperatures": 'values: ["25", "40"]',
    "verification_rates": 'values: ["13.6"]',
}
_PLACES = {
    "relay1": '      connects: {"1": coil',
    "obc1": "      truth: {clock_drift:",
    "gyro1": "      connects: {rate: table.rate, ",
    "tec1": "      connects: {sensor:",
    "table1": "      connects: {rate: table.rate_command",
}


@dataclass(frozen=True)
class Ended:
    """One case of a run that ended in this process: nothing is sealed, and the world is as the run left it."""

    code: int
    package: Package
    world: World
    case: str

    @property
    def verdict(self) -> str:
        """The verdict of the case."""
        return str(self._result()["verdict"])

    @property
    def requirements(self) -> dict[str, str]:
        """The verdict of each of its requirements, by the number at the end of the id."""
        return {name[-3:]: str(verdict) for name, verdict in self._result()["requirements"].items()}

    @property
    def reasons(self) -> str:
        """Its reasons, a line each."""
        return "\n".join(self._result()["reasons"])

    def left_safe(self, except_for: Collection[str] = ()) -> bool:
        """Return whether what is really there is safe: `table` still; `tec`, `lamp` and `coil` without power."""
        chamber, coil, table = (self.world.plants[name] for name in ("chamber", "coil", "table"))
        safe = {
            "table": abs(table.observe("table_rate")) < 0.05,
            "tec": chamber.inputs["tec"] == 0.0,
            "lamp": not chamber.inputs["lamp"],
            "coil": coil.inputs["supply_voltage"] == 0.0,
        }
        return all(state for name, state in safe.items() if name not in except_for)

    def checks(self, requirement: str, parameter: str) -> list[Mapping[str, object]]:
        """Return the checks of one parameter."""
        return [
            event
            for event in bodies(self.package, "check")
            if event["requirement"].endswith(requirement) and event["parameter"] == parameter
        ]

    def _result(self) -> Mapping[str, object]:
        return next(each for each in results_as_json(self.package)["cases"] if each["case"].endswith(f"::{self.case}"))


def committed_workspace(root: Path) -> Workspace:
    """Copy bench, fixtures and plan as they are committed into `root`, which must not exist yet."""
    others = [plan.name for plan in (ROOT / "testplans").iterdir() if plan.is_dir() and plan.name != "gyroscope"]
    skipped = shutil.ignore_patterns("__pycache__", *others)
    shutil.copytree(ROOT / "fixtures", root / "fixtures", ignore=skipped)
    shutil.copytree(ROOT / "testplans", root / "testplans", ignore=skipped)
    (root / "hil.toml").touch()
    return Workspace(root, root / "testplans/gyroscope")


def gyroscope_workspace(
    root: Path, *, parameters: Mapping[str, str] | None = None, changes: Mapping[str, str] | None = None
) -> Workspace:
    """Copy the bench with its fixtures, and the plan with fewer temperatures and shorter recordings.

    Args:
        root: the workspace's folder, which must not exist yet.
        parameters: other values than the short ones, `value: "5"` or `values: ["1", "2"]`, by name.
        changes: texts of the bench file, each of which is there once.
    """
    workspace = committed_workspace(root)
    wanted = {**_SHORT, **(parameters or {})}
    places = {name: f"- {{name: {name}, {_PARAMETERS[name]}" for name in wanted}
    workspace.change(
        "testplans/gyroscope/parameters.yaml",
        {place: place.replace(_PARAMETERS[name], wanted[name]) for name, place in places.items()},
    )
    seconds = wanted["rest_duration"].split('"')[1]
    workspace.change("testplans/gyroscope/requirements.yaml", {"duration: 4 h": f"duration: {seconds} s"})
    workspace.lock()
    workspace.change_bench(changes or {})
    return workspace


def faulty(device: str, *faults: str) -> dict[str, str]:
    """Return the change of the bench file that gives a simulated instrument these faults."""
    return {_PLACES[device]: f"      faults: [{', '.join(faults)}]\n{_PLACES[device]}"}


def truth(device: str, text: str) -> dict[str, str]:
    """Return the change of the bench file that gives a simulated instrument without a truth one."""
    return {_PLACES[device]: f"      truth: {text}\n{_PLACES[device]}"}


def run_one(workspace: Workspace, case: str) -> Ended:
    """Run one case of the plan in this process; the other one is skipped, and nothing is sealed."""
    other = NOISE if case == CALIBRATION else CALIBRATION
    request = workspace.request(skips={other: "not asked here"})
    launched = launch(configure(request), open_new)
    assert launched.session is not None
    code = launched.session.exit_code(launched.code)
    launched.session.abandon()
    world = launched.session.bench.world
    assert world is not None
    return Ended(code, Package(launched.session.folder), world, case)
