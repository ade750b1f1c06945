"""The campaigns of this workspace under audit: simulated, they close nothing; on hardware they would close most."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from workspaces import ROOT

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

RUNS = (
    ("magnetorquer", "adcs", "SIM-ADCS-1"),
    ("jig", "adcs", "SIM-ADCS-1"),
    ("battery_charge", "battery", "SIM-BAT-1"),
    ("eps", "eps", "SIM-EPS-1"),
)
MAGNETORQUER = {"ADCS-001", *(f"ADCS-MTQ-0{number}0" for number in range(1, 7))}
POWER_BOARD = {"EPS-002", *(f"EPS-PWR-0{number}0" for number in range(1, 7))}
NO_STAGE = "the requirement names no stage"
OF_THIS_COPY = ("the product ", "Python executed hil-tests/sitecustomize.py", "PYTHONPATH changes ")
"""How reasons begin that tell of the tested copy of the product: it may have changes, its tests begin with a file."""


def hil(folder, *arguments, codes=(0,)):
    """Run a command in a folder and return its standard output."""
    command = [str(Path(sys.executable).with_name("hil")), *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=800, check=False)
    assert done.returncode in codes, done.stderr
    return done.stdout


def audit_of(root, runs):
    """Return what the audit says after campaigns, in a copy of the workspace under version control."""
    for name in ("testplans", "fixtures"):
        shutil.copytree(ROOT / name, root / name, ignore=shutil.ignore_patterns("__pycache__"))
    (root / "hil.toml").touch()
    (root / ".gitignore").write_text("reports/\n__pycache__/\n")
    git = ["git", "-c", "user.name=Ada", "-c", "user.email=ada@example.org", "-c", "commit.gpgsign=false"]
    for arguments in (["init", "-q"], ["add", "-A"], ["commit", "-q", "-m", "Begin"]):
        subprocess.run([*git, *arguments], cwd=root, check=True)
    for plan, bench, dut in runs:
        made = ("--bench", bench, "--dut", dut, "--source", "simulated", "--operator", "Ada")
        hil(root, "run", plan, *made, codes=(0, 1))
    return json.loads(hil(root, "audit", "--no-cache", "--format", "json"))


@pytest.fixture(scope="module")
def audited(tmp_path_factory):
    """Return what the audit says after the four quick campaigns."""
    return audit_of(tmp_path_factory.mktemp("own"), RUNS)


def left_open(row):
    """Return what would leave a requirement open on hardware; whether this copy has a commit is no part of it."""
    reasons = [each["text"] for each in row["on_hardware"]["reasons"] if each["code"] != "CHILD_OPEN"]
    return [text for text in reasons if not text.startswith(OF_THIS_COPY)]


def test_simulated_campaigns_close_nothing(audited):
    """Whatever their verdicts, and although nothing else is missing."""
    assert audited["summary"]["closed"] == 0
    spoken = [row for row in audited["rows"] if row["evidence"]]
    assert {"magnetorquer", "jig", "battery_charge", "eps"} == {row["planning"]["plan"] for row in spoken}
    assert all("SIM_ONLY" in {each["code"] for each in row["reasons"]} for row in spoken)
    assert audited["problems"] == []


def test_the_same_on_hardware_would_close_what_passed_at_its_stage(audited):
    """There is a flight unit of each part in the register, so that only the run itself can leave anything open."""
    would = {row["id"]: left_open(row) for row in audited["rows"] if row.get("on_hardware")}
    assert {name for name, left in would.items() if not left} >= MAGNETORQUER | POWER_BOARD
    jig = {name: left for name, left in would.items() if name.startswith("JIG-")}
    assert len(jig) == 3
    assert set(map(tuple, jig.values())) == {(NO_STAGE,)}, "the jig is no part of the satellite"
    battery = {name: left for name, left in would.items() if name.startswith("EPS-BAT-")}
    assert len(battery) == 10
    assert sorted(map(tuple, battery.values())) == [(), *[()] * 8, ("its verdict is INCONCLUSIVE",)]


@pytest.mark.soak
@pytest.mark.timeout(900)
def test_the_gyroscope_on_hardware_would_close_what_no_analysis_has_to(tmp_path):
    """Hours of rest and every turn of the table, so that it runs in the soak only."""
    found = audit_of(tmp_path, [("gyroscope", "adcs", "SIM-ADCS-1")])
    would = {row["id"]: left_open(row) for row in found["rows"] if row["id"].startswith("ADCS-GYR-")}
    by_analysis = {"ADCS-GYR-013", "ADCS-GYR-022"}
    assert found["summary"]["closed"] == 0
    assert len(would) == 10
    assert {name for name, left in would.items() if left} == by_analysis
    assert all(
        would[name] == ["its method is analysis, and no document was attached in its cases"] for name in by_analysis
    )
