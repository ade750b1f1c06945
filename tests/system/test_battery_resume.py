"""The plan battery_charge, killed again and again: it comes to what it would have come to."""

from __future__ import annotations

import random
import subprocess
import time

import pytest
import sweeps
from battery_runs import battery_workspace
from resumed_runs import findings_of, killed, without_git
from told_as_json import bodies

from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify

pytestmark = pytest.mark.system

KILLS = sweeps.chosen(4, 20)
LAST = 0.9  # of what the run writes; after it come the analysis and the seal


def size_of(folder):
    """Return how much a run has written down: journal, rows and transcript."""
    files = [folder / "data/transcript.tsv", folder / "data/journal.jsonl", *folder.glob("data/recordings/*.rows")]
    return sum(path.stat().st_size for path in files if path.exists())


@pytest.mark.timeout(1800)
def test_kills_change_nothing(tmp_path):
    """Killed at many random moments and resumed each time: recordings and results as if nobody had touched it.

    The moments are sizes of what an undisturbed run writes, so that they lie in the same places on any machine.
    """
    workspace = without_git(battery_workspace(tmp_path / "workspace", "battery_charge"))
    command = ("run", workspace.plan.name, "--bench", "battery", "--dut", "SIM-BAT-1", "--source", "simulated")
    whole = workspace.hil(*command, timeout=500)
    assert whole.err == ""
    (undisturbed,) = workspace.folders()
    random.seed(4)
    moments = sorted(random.uniform(0.0, LAST) * size_of(undisturbed) for _ in range(KILLS))
    process, kills = workspace.start(*command, stdout=subprocess.DEVNULL), 0
    while len(workspace.folders()) < 2:
        time.sleep(0.02)
    (disturbed,) = [folder for folder in workspace.folders() if folder != undisturbed]
    for moment in moments:
        while process.poll() is None and size_of(disturbed) < moment:
            time.sleep(0.001)
        kills += killed(process, 0.0)
        assert not (disturbed / "bagit.txt").exists(), f"it had ended before kill {kills + 1}"
        process = workspace.start("resume", str(disturbed), stdout=subprocess.DEVNULL)
    assert process.wait(500) == whole.code
    process.communicate()
    package = Package(disturbed)
    assert kills == KILLS
    assert findings_of(package) == findings_of(Package(undisturbed))
    assert (verify(disturbed).findings, verify(disturbed).ok) == ((), verify(undisturbed).ok)
    numbers = [event["number"] for event in bodies(package, "resumed")]  # who was killed at once had nothing to tell
    assert numbers == list(range(1, len(numbers) + 1))
    assert len(numbers) >= KILLS // 4  # how many more is a question of the machine's speed
