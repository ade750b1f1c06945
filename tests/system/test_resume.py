"""`hil resume`: a run that was killed at any moment comes to the same, and nothing of it is lost."""

from __future__ import annotations

import json
import random
import subprocess
import time
from pathlib import Path

import pytest
from workspaces import finish, kill, make

from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify

pytestmark = pytest.mark.system

CASES = """
@pytest.mark.requirement("T-030")
@pytest.mark.max_duration(1e9)
def test_long(supply, field, operator, record, check, iterations, artifact):
    for part in iterations("part", 80):
        operator.confirm("Is the jig still in its place?", name="jig")
        with supply_on(supply):
            taken = record("field", field, duration=5.0, rate=40.0)
        artifact(f"mean-{part}.txt", f"{taken['x'].mean():.9g}")


@pytest.mark.requirement("T-010")
def test_last(check):
    check("T-010", "ratio", 1.0)
"""

SUPPLY = """
@contextlib.contextmanager
def supply_on(supply):
    supply.coil.configure(1.9, 0.01)
    supply.coil.enable()
    yield
    supply.coil.disable()
"""

STARTED: list[subprocess.Popen[str]] = []


@pytest.fixture(autouse=True)
def no_process_is_left():
    """End what a failed test leaves."""
    yield
    while STARTED:
        process = STARTED.pop()
        if process.poll() is None:
            kill(process)
            process.communicate()


@pytest.fixture
def workspace(tmp_path):
    """A workspace with one long case and a short one."""
    return make(tmp_path / "workspace", "import contextlib", SUPPLY, CASES)


def begun(workspace) -> Path:
    """Start a run, wait until its case has begun, and return its folder."""
    before = workspace.folders()
    STARTED.append(workspace.start(*workspace.run_arguments, stdout=subprocess.DEVNULL))
    while True:
        time.sleep(0.02)
        for folder in workspace.folders():
            journal = folder / "data/journal.jsonl"
            if folder not in before and journal.exists() and b'"kind":"step"' in journal.read_bytes():
                return folder


def killed(process, after: float) -> bool:
    """Kill a command after some seconds; return whether it had not ended before."""
    try:
        process.wait(after)
    except subprocess.TimeoutExpired:
        kill(process)
    process.communicate()
    return process.returncode < 0


def findings_of(package: Package) -> dict[str, object]:
    """Return every recording's hash and all results, but for the journal's line numbers and what follows from them."""
    rows = {event["recording"]: (event["rows"], event["sha256"]) for event in package.events("recording-end")}
    results = json.loads(json.dumps(package.results()))
    del results["content_digest"]
    for case in results["cases"]:
        for check in case["checks"]:
            del check["seq"]
    return {"recordings": rows, "results": results}


@pytest.mark.timeout(280)
def test_a_run_that_is_killed_again_and_again_comes_to_the_same(workspace):
    """Recordings and results are those of a run that nobody disturbed, and the package verifies and tells of it."""
    whole = workspace.hil(*workspace.run_arguments, timeout=100)
    assert whole.code == 0, whole.err
    (undisturbed,) = workspace.folders()
    moments = random.Random(11)
    disturbed = begun(workspace)
    assert killed(STARTED[-1], moments.uniform(0.0, 2.0))
    for _ in range(6):
        STARTED.append(workspace.start("resume", str(disturbed), stdout=subprocess.DEVNULL))
        if not killed(STARTED[-1], moments.uniform(1.0, 6.0)):
            break
    if not (disturbed / "bagit.txt").exists():
        ended = workspace.hil("resume", str(disturbed), timeout=100)
        assert ended.code == 0, ended.err
        assert ended.last_line == f"reports/{disturbed.name}"
    package = Package(disturbed)
    assert findings_of(package) == findings_of(Package(undisturbed))
    assert verify(disturbed).findings == ()
    resumed = list(package.events("resumed"))
    assert [event["number"] for event in resumed] == list(range(1, len(resumed) + 1))
    assert resumed
    assert "went on" in package.text("data/report/report.html")
    assert workspace.hil("replay", str(disturbed), timeout=100).code == 0


@pytest.fixture
def interrupted(workspace):
    """The folder of a run that was killed amid its case."""
    folder = begun(workspace)
    assert killed(STARTED[-1], 1.2)
    return folder


def test_what_has_changed_is_named(workspace, interrupted):
    """A bench, catalogue or plan that is not that of the run refuses its resume, and the run stays as it was."""
    before = (interrupted / "data/journal.jsonl").read_bytes()
    workspace.change("testplans/small/test_small.py", {"in its place?": "in its own place?"})
    workspace.change("testplans/small/parameters.yaml", {"Coil current": "Current of the coil"})
    ended = workspace.hil("resume", "latest")
    assert ended.code == 4
    assert "requirements or parameters (catalogue/" in ended.err
    assert "plans or fixtures (sources/testplans/small/test_small.py)" in ended.err
    assert (interrupted / "data/journal.jsonl").read_bytes() == before


def test_other_software_needs_a_reason_and_closes_nothing(workspace, interrupted):
    """With a reason it is a deviation, in results and report."""
    told = json.loads((interrupted / "data/software.json").read_bytes())
    told["packages"]["numpy"] = "1.0.0"
    (interrupted / "data/software.json").write_text(json.dumps(told), encoding="utf-8")
    refused = workspace.hil("resume", "latest")
    assert (refused.code, "packages numpy 1.0.0 is" in refused.err) == (4, True)


def test_a_run_that_does_not_come_to_the_same_is_left_as_it_is(workspace, interrupted):
    """A record that its cases do not come to again is told, and can be sealed as it is."""
    journal = interrupted / "data/journal.jsonl"
    before = journal.read_bytes()
    transcript = interrupted / "data/transcript.tsv"
    lines = transcript.read_text(encoding="ascii").splitlines(keepends=True)
    lines[200] = lines[200].replace("\t", "\t1", 1)
    transcript.write_text("".join(lines), encoding="ascii")
    ended = workspace.hil("resume", "latest")
    assert ended.code == 3
    assert "cannot be gone on with" in ended.err
    assert journal.read_bytes() == before
    assert workspace.hil("seal", "latest").code == 0


@pytest.mark.parametrize("what", ["sealed", "going on"])
def test_there_must_be_something_to_go_on_with(workspace, what):
    """A sealed run and one that is going on are refused."""
    begun(workspace)
    if what == "sealed":
        finish(STARTED[-1], 100)
    ended = workspace.hil("resume", "latest")
    assert (ended.code, what in ended.err) == (4, True)
