"""The report on paper: a campaign of 18 cases and a degradation fit the pages that a review board reads."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hil.report.printing import BROWSERS

ROOT = Path(__file__).parents[2]

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(not any(map(shutil.which, BROWSERS)), reason="needs a browser that prints"),
]


def hil(root, *arguments):
    """Run the command line; the last line of its output is what it made. A run that is not good is printed, too."""
    command = [sys.executable, "-m", "hil.cli", *arguments]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode in {0, 1}, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout.splitlines()[-1]


@pytest.mark.parametrize(
    ("run", "most"),
    [
        (("magnetorquer", "--bench", "adcs", "--dut", "SIM-ADCS-1"), 12),
        (("battery_degradation", "--bench", "battery", "--dut", "SIM-BAT-1", "--parameter", "cycles=8"), 10),
        (("battery_charge", "--bench", "battery", "--dut", "SIM-BAT-1"), 12),
    ],
)
def test_a_report_fits_its_pages(tmp_path, run, most):
    """Equal steps and cases are folded, so that more cycles are no more pages; nothing is printed beside the page."""
    for name in ("fixtures", "testplans"):  # a bench serves one run at a time, and several of these run at once
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "hil.toml").touch()
    folder = hil(tmp_path, "run", *run, "--source", "simulated")
    pdf = tmp_path / "report.pdf"
    hil(tmp_path, "report", folder, "--pdf", str(pdf))
    pages = re.findall(rb"/Type\s*/Page\b", pdf.read_bytes())
    assert 3 <= len(pages) <= most
