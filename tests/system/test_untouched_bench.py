"""An untouched bench never fails a healthy article, whatever a run repeats."""

from __future__ import annotations

import shutil
import subprocess
import sys

import pytest
import sweeps
from magnetorquer_runs import ROOT

pytestmark = pytest.mark.system


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("repetitions", sweeps.sample([5, 3, 4, 7, 10, 13, 17, 20, 23, 28, 33, 40, 50, 64, 81, 100], 1))
def test_every_number_of_repetitions_passes(tmp_path, repetitions):
    """The readings of the envelope find their places before and between the samples of every recording."""
    for folder in ("fixtures", "testplans"):  # a bench serves one run at a time, and several of these run at once
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "hil.toml").touch()
    command = ["run", "testplans/magnetorquer", "--bench", "adcs", "--source", "simulated", "--dut", "SIM-ADCS-1"]
    command += ["--parameter", f"repetitions={repetitions}", "--output", str(tmp_path / "reports")]
    line = [sys.executable, "-m", "hil.cli", *command]
    ran = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (ran.returncode, "PASS  18 cases: 18 passed." in ran.stdout) == (0, True), ran.stdout[-2000:]
