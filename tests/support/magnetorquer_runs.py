"""Runs of the magnetorquer plan on a bench of one's own, in this process and in others."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from adcs_bench import copy_fixtures
from told_as_json import bodies, results_as_json

from hil.evidence.package.contents import Package
from hil.executive.setup.configuration import Request, configure
from hil.model.identity import Source
from hil.plugin.launch import launch
from hil.plugin.opening import open_new

__all__ = [
    "BOARDS",
    "CASES",
    "ROOT",
    "Ran",
    "others",
    "rows",
    "run_here",
    "start_elsewhere",
    "with_faults",
    "workspace",
]

ROOT = Path(__file__).parents[2]
CASES = ("test_polarity", "test_linearity", "test_direction_by_compass")
BOARDS = ("x_plus", "x_minus", "y_plus", "y_minus", "z_plus", "z_minus")
_SKIPPED = "not asked here"
_CONNECTS = {"psu1": '      connects: {"2"', "relay1": '      connects: {"1"', "mag1": "      connects: {field"}


@dataclass(frozen=True)
class Ran:
    """A run that ended: its exit code and what it left."""

    code: int
    package: Package

    def verdicts(self) -> dict[str, str]:
        """Return the verdict of every case that was not skipped, by the case's own name."""
        return {
            case["case"].rpartition("::")[2]: str(case["verdict"])
            for case in results_as_json(self.package)["cases"]
            if case["reasons"] != [_SKIPPED]
        }

    def reasons(self) -> str:
        """Return the reasons of all cases that were not skipped."""
        cases = results_as_json(self.package)["cases"]
        return "\n".join(reason for case in cases for reason in case["reasons"] if reason != _SKIPPED)


def workspace(folder: Path, changes: Mapping[str, str] | None = None) -> Path:
    """Copy the plan, its fixtures and its bench; `changes` replaces texts of the bench file, each of which is there."""
    copy_fixtures(folder)
    shutil.copytree(ROOT / "testplans", folder / "testplans", ignore=shutil.ignore_patterns("__pycache__"))
    for plan in (folder / "testplans").iterdir():
        if plan.is_dir() and plan.name != "magnetorquer":
            shutil.rmtree(plan)
    (folder / "hil.toml").write_text("", encoding="ascii")
    bench = folder / "fixtures/benches/adcs/bench.yaml"
    text = bench.read_text(encoding="utf-8")
    for old, new in (changes or {}).items():
        if text.count(old) != 1:
            raise ValueError(f"the bench file has {text.count(old)} times {old!r}")
        text = text.replace(old, new)
    bench.write_text(text, encoding="utf-8")
    return folder


def with_faults(device: str, *faults: str) -> dict[str, str]:
    """Return the change that gives a simulated instrument these faults."""
    place = _CONNECTS[device]
    return {place: f"      faults: [{', '.join(faults)}]\n{place}"}


def others(board: str) -> dict[str, str]:
    """Return the skips that leave the cases of one board."""
    return {f"{case}[{other}]": _SKIPPED for case in CASES for other in BOARDS if other != board}


def run_here(root: Path, *, plan: str = "magnetorquer", skips: Mapping[str, str] | None = None) -> Ran:
    """Run a plan below this process' own pytest; nothing is sealed and no report is written."""
    configuration = configure(
        Request(
            start=root,
            plans=(f"testplans/{plan}",),
            bench="adcs",
            dut="SIM-ADCS-1",
            source=Source.SIMULATED,
            skips=skips or {},
        )
    )
    launched = launch(configuration, open_new)
    if launched.session is None:
        raise ValueError("no session was opened")
    code = launched.session.exit_code(launched.code)
    launched.session.abandon()
    return Ran(code, Package(launched.session.folder))


def start_elsewhere(root: Path, *options: str) -> subprocess.Popen[str]:
    """Start `hil run` in a process of its own; the last line of its output names the package."""
    command = ["run", "testplans/magnetorquer", "--bench", "adcs", "--source", "simulated", "--dut", "SIM-ADCS-1"]
    return subprocess.Popen(
        [sys.executable, "-m", "hil.cli", *command, *options],
        cwd=root,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def rows(package: Package, *, of_cases: bool) -> dict[str, str]:
    """Return the hash of every recording's rows: of the cases' recordings, or of the envelope's."""
    chosen = {event["recording"] for event in bodies(package, "recording") if (event["case"] is not None) == of_cases}
    ends = bodies(package, "recording-end")
    return {event["recording"]: event["sha256"] for event in ends if event["recording"] in chosen}
