"""The plan `imu_closure`: a simulated axis gives its table back, and a simulator of the other convention does not."""

from __future__ import annotations

import csv
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from workspaces import ROOT

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

RUN = ("run", "imu_closure", "--bench", "imu", "--dut", "SIM-IMU-1", "--source", "simulated")
SHORT = ("--parameter", "duration=600", "--parameter", "rate=10")
"""Ten minutes: enough to see white noise that is too low by a third, and nothing else."""


def hil(folder, *arguments):
    """Run a command in a folder; return its exit code and its standard output."""
    command = [str(Path(sys.executable).with_name("hil")), *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=250, check=False)
    return done.returncode, done.stdout + done.stderr


@pytest.fixture(scope="module")
def workspace(tmp_path_factory):
    """Return a copy of the workspace with this plan alone."""
    root = tmp_path_factory.mktemp("closure")
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "fixtures", root / "fixtures", ignore=ignored)
    shutil.copytree(ROOT / "testplans" / "imu_closure", root / "testplans" / "imu_closure", ignore=ignored)
    shutil.copy(ROOT / "testplans/requirements.yaml", root / "testplans/requirements.yaml")
    (root / "hil.toml").touch()
    return root


@pytest.fixture(scope="module")
def ran(workspace):
    """Return exit code, output and package of the whole plan."""
    code, out = hil(workspace, *RUN)
    return code, out, workspace / out.splitlines()[-1]


def checks(out, parameter):
    """Return what a run says of a parameter: axis (or nothing), value and verdict."""
    pattern = rf"^ +IMU-SIM-\d+ {parameter}(?: of (\S+))? = (.*?)  .*?(PASS|FAIL|INCONCLUSIVE|RECORDED)"
    return re.findall(pattern, out, re.MULTILINE)


def test_every_axis_gives_its_table_back(ran):
    """White noise within 1 %, flicker within its interval where four hours show it, and else said not to be shown."""
    code, out, _ = ran
    assert code == 0, out
    white = checks(out, "white_noise_closure")
    assert (len(white), {verdict for _, _, verdict in white}) == (21, {"PASS"})
    assert all(abs(float(value.split()[0])) < 0.01 for _, value, _ in white)
    for noise in ("flicker", "random_walk"):
        shown = {axis: word for axis, word, _ in checks(out, f"{noise}_shown")}
        assert len(shown) == 21
        assert set(shown.values()) == {"measured", "not observable"}
        (counted,) = checks(out, f"{noise}_count")
        assert int(counted[1]) == sum(word == "measured" for word in shown.values())
        assert checks(out, f"{noise}_outside")[0][1:] == ("0", "PASS")
        bounded = {axis for axis, value, _ in checks(out, f"{noise}_closure") if "±" not in value}
        assert bounded == {axis for axis, word in shown.items() if word == "not observable"}


def test_recorded_and_simulated_stand_in_a_table(ran):
    """One row for each of three levels of 21 axes; a level that is not shown has a bound, and no number."""
    (file,) = (ran[2] / "data" / "attachments").rglob("*closure.csv")
    with file.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 63
    for row in rows:
        assert bool(row["simulated"]) == bool(row["deviation"]) == (row["status"] == "measured")
        assert bool(row["bound"]) == (row["status"] == "not observable")


def test_the_package_verifies_and_is_replayed(workspace, ran):
    """The same verdicts, values and files."""
    assert hil(workspace, "verify", str(ran[2]))[0] == 0
    code, out = hil(workspace, "replay", str(ran[2]))
    assert (code, "no difference" in out) == (0, True), out


def test_the_other_convention_fails(workspace):
    """A simulator that takes the level for that of positive frequencies is too quiet by 29 % on every axis."""
    code, out = hil(workspace, *RUN, *SHORT, "--parameter", "sides=1")
    white = checks(out, "white_noise_closure")
    assert (code, len(white), {verdict for _, _, verdict in white}) == (1, 21, {"FAIL"}), out
    assert all(abs(float(value.split()[0]) + 0.293) < 0.07 for _, value, _ in white)


@pytest.mark.soak
def test_other_seeds_give_it_back_as_well(workspace):
    """Three other draws: white noise each time; of seventy levels that are shown at most one is outside of 99.9 %."""
    outside = 0
    for seed in ("20000", "20100", "20200"):
        _, out = hil(workspace, *RUN, "--parameter", f"seed={seed}")
        white = checks(out, "white_noise_closure")
        assert (len(white), {verdict for _, _, verdict in white}) == (21, {"PASS"}), out
        outside += sum(int(checks(out, f"{noise}_outside")[0][1]) for noise in ("flicker", "random_walk"))
    assert outside <= 1
