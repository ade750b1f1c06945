"""`hil resume`: a run that was killed at any moment comes to the same, and nothing of it is lost."""

from __future__ import annotations

import random
import subprocess
import time
from pathlib import Path

import pytest
import sweeps
from resumed_runs import findings_of, killed, without_git
from told_as_json import bodies, results_as_json
from workspaces import STARTED, Workspace, finish, make

from hil.evidence.folder import JOURNAL
from hil.evidence.journal.reader import read_journal
from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify

pytestmark = pytest.mark.system

PARTS = sweeps.chosen(30, 80)
CASES = f"""
@pytest.mark.requirement("T-030")
@pytest.mark.max_duration(1e9)
def test_long(supply, field, operator, record, check, iterations, artifact):
    for part in iterations("part", {PARTS}):
        operator.confirm("Is the jig still in its place?", name="jig")
        with supply_on(supply):
            taken = record("field", field, duration=5.0, rate=40.0)
        artifact(f"mean-{{part}}.txt", f"{{taken['x'].mean():.9g}}")


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


def made(root: Path, *cases: str) -> Workspace:
    """Make a workspace for runs that are interrupted."""
    return without_git(make(root, *cases))


@pytest.fixture
def workspace(tmp_path):
    """A workspace with one long case and a short one."""
    return made(tmp_path / "workspace", "import contextlib", SUPPLY, CASES)


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


@pytest.mark.timeout(600)
def test_a_run_that_is_killed_again_and_again_comes_to_the_same(workspace):
    """Recordings and results are those of a run that nobody disturbed, and the package verifies and tells of it."""
    whole = workspace.hil(*workspace.run_arguments, timeout=300)
    assert whole.code == 0, whole.err
    (undisturbed,) = workspace.folders()
    moments = random.Random(11)
    disturbed = begun(workspace)
    assert killed(STARTED[-1], moments.uniform(0.0, 2.0))
    for _ in range(sweeps.chosen(3, 6)):
        STARTED.append(workspace.start("resume", str(disturbed), stdout=subprocess.DEVNULL))
        if not killed(STARTED[-1], moments.uniform(1.0, sweeps.chosen(3.0, 6.0))):
            break
    if not (disturbed / "bagit.txt").exists():
        over = b'"kind":"results"' in (disturbed / "data/journal.jsonl").read_bytes()  # the last kill was at the seal
        ended = workspace.hil("seal" if over else "resume", str(disturbed), timeout=300)
        assert ended.code == 0, ended.err
        assert ended.last_line == f"reports/{disturbed.name}"
    package = Package(disturbed)
    assert findings_of(package) == findings_of(Package(undisturbed))
    assert verify(disturbed).findings == ()
    resumed = list(bodies(package, "resumed"))
    assert [event["number"] for event in resumed] == list(range(1, len(resumed) + 1))
    assert resumed
    assert "the run was interrupted, and resumed here" in package.text("data/report/report.html")
    assert workspace.hil("replay", str(disturbed), timeout=300).code == 0


@pytest.fixture
def interrupted(workspace):
    """The folder of a run that was killed in its case."""
    folder = begun(workspace)
    assert killed(STARTED[-1], 0.6)
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


def test_a_table_that_a_case_opened_is_part_of_the_run(tmp_path):
    """It is frozen at its first opening: a changed one refuses the resume, the same one comes again without a word."""
    opened = CASES.replace("    for part", "    (Path(__file__).parents[2] / 'ref.csv').read_text()\n    for part")
    workspace = made(tmp_path / "workspace", "import contextlib\nfrom pathlib import Path", SUPPLY, opened)
    table = workspace.root / "ref.csv"
    table.write_text("1.0")
    folder = begun(workspace)
    assert killed(STARTED[-1], 0.5)
    table.write_text("2.0")
    ended = workspace.hil("resume", "latest")
    assert (ended.code, "plans or fixtures (sources/ref.csv)" in ended.err) == (4, True), ended.err
    table.write_text("1.0")
    ended = workspace.hil("resume", "latest", timeout=300)
    assert ended.code == 0, ended.err
    assert [event["file"] for event in bodies(Package(folder), "frozen-later")] == ["data/sources/ref.csv"]
    assert verify(folder).findings == ()


def test_other_software_needs_a_reason_and_closes_nothing(workspace, interrupted):
    """With a reason it is a deviation, in results and report."""
    described = workspace.root.parent / "more/drivers_of_others-2.0.dist-info/METADATA"
    described.parent.mkdir(parents=True)
    described.write_text("Metadata-Version: 2.1\nName: drivers-of-others\nVersion: 2.0\n", encoding="utf-8")
    workspace.environment["PYTHONPATH"] = str(described.parents[1])
    refused = workspace.hil("resume", "latest")
    assert (refused.code, "packages drivers-of-others none is 2.0" in refused.err) == (4, True), refused.err
    ended = workspace.hil("resume", "latest", "--other-software", "needed for the next bench", timeout=300)
    assert (ended.code, ended.err) == (0, "")
    package = Package(interrupted)
    told = "resumed with other software (packages drivers-of-others none is 2.0): needed for the next bench"
    assert f"deviation: {told}" in [text["text"] for text in results_as_json(package)["conditions"]]
    assert told in package.text("data/report/report.html")


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
    assert "cannot be resumed" in ended.err
    assert journal.read_bytes() == before
    assert workspace.hil("seal", "latest").code == 0


@pytest.mark.parametrize("what", ["sealed", "in progress"])
def test_there_must_be_something_to_go_on_with(workspace, what):
    """A sealed run and one that is going on are refused."""
    begun(workspace)
    if what == "sealed":
        finish(STARTED[-1], 100)
    ended = workspace.hil("resume", "latest")
    assert (ended.code, what in ended.err) == (4, True)


COUNT = sweeps.chosen(120, 400)
TURNS = f"""
@pytest.mark.requirement("T-050")
@pytest.mark.max_duration(1e9)
@pytest.mark.repeatable("the voltage of a coil may be read as often as one likes")
def test_long(supply, field, operator, record, check, clock, iterations):
    supply.coil.configure(1.9, 0.01)
    supply.coil.enable()
    with record.during("beside", field, rate=4.0) as beside:
        for part in iterations("part", {COUNT}):
            operator.confirm("Is the jig still in its place?", name="jig")
            clock.sleep(20.0)
            assert supply.coil.enabled()
            check("T-050", "voltage", supply.coil.voltage())
    assert beside.recording["x"].size > 4 * 20 * {COUNT}


@pytest.mark.requirement("T-010")
def test_last(check):
    check("T-010", "ratio", 1.0)
"""


def stopped(workspace, process, until: str) -> None:
    """Let a run come to a turn, and stop it to be resumed."""
    for line in process.stdout:
        if until in line:
            break
    assert workspace.hil("stop", "latest", "--to-resume", "--by", "Ada", "--reason", "weekend").code == 0
    ended = finish(process, 60)
    assert (ended.code, ended.err) == (2, "")
    assert "hil resume" in ended.out


@pytest.mark.timeout(600)
def test_a_run_that_was_stopped_goes_on_at_its_last_turn(tmp_path):
    """It is entered again, twice: the bench armed and driven again, the turns made again void before, nothing lost."""
    workspace = made(tmp_path / "workspace", TURNS)
    stopped(workspace, workspace.start_run("--verbose"), f"part 20 of {COUNT}")
    (folder,) = workspace.folders()
    assert not (folder / "bagit.txt").exists()
    stopped(workspace, workspace.start("resume", "latest", "--verbose"), f"part {COUNT // 2} of {COUNT}")
    ended = workspace.hil("resume", "latest", timeout=300)
    assert (ended.code, ended.err) == (0, "")
    package = Package(folder)
    assert (verify(folder).findings, verify(folder).ok) == ((), True)
    assert [case["verdict"] for case in results_as_json(package)["cases"]] == ["PASS", "PASS"]
    turns = [event["turn"] for event in bodies(package, "step") if "turn" in event]
    assert turns == list(range(1, COUNT + 1))
    lines = bodies(read_journal(folder / JOURNAL))
    assert sum(line["kind"] == "armed" for line in lines) == 3
    assert [line["entry"]["rows"] != [] for line in lines if line["kind"] == "resumed"] == [True, True]
    beside = next(each for each in bodies(package, "recording") if each["name"] == "beside")
    assert len(package.recording(beside["recording"])) > 4 * 20 * COUNT
    assert "stopped by Ada: weekend, and resumed where" in package.text("data/report/report.html")
    again = workspace.hil("replay", str(folder), timeout=300)
    assert (again.code, again.err) == (0, "")


def test_a_run_that_was_stopped_for_good_is_not_resumed(workspace):
    """A stop without --to-resume seals, and a sealed run is refused."""
    begun(workspace)
    assert workspace.hil("stop", "latest").code == 0
    finish(STARTED[-1], 60)
    assert "is sealed" in workspace.hil("resume", "latest").err


RESTED_S = sweeps.chosen(300, 1500)
RESTING = f"""
@pytest.mark.requirement("T-030")
@pytest.mark.max_duration(1e9)
def test_rest(field, record, artifact):
    rest = record("field", field, duration={RESTED_S}.0, rate=40.0, continues=True)
    artifact("valid.txt", f"{{len(rest)}} {{int(rest.valid.sum())}} {{rest.time[-1] - rest.time[0]:.0f}}")
"""


@pytest.mark.timeout(600)
def test_a_recording_that_continues_is_not_made_again(tmp_path):
    """What was recorded before the stop stands, the rest comes after a gap, and the requirement tells of the gap."""
    workspace = made(tmp_path / "workspace", RESTING)
    folder = None
    process = workspace.start_run()
    STARTED.append(process)
    while folder is None or sum(path.stat().st_size for path in folder.glob("data/recordings/001*.rows")) < 40_000:
        time.sleep(0.02)
        folder = next(iter(workspace.folders()), None)
    assert workspace.hil("stop", "latest", "--to-resume").code == 0
    assert finish(process, 60).code == 2
    ended = workspace.hil("resume", "latest", timeout=300)
    package = Package(folder)
    (case,) = results_as_json(package)["cases"]
    (recording,) = [each for each in bodies(package, "recording") if each["case"]]
    assert (ended.code, ended.err, case["verdict"]) == (1, "", "INCONCLUSIVE")
    assert "the run was stopped during the recording" in case["reasons"][0]
    assert len(package.recording(recording["recording"])) == 40 * RESTED_S
    kept = next(folder.glob("data/attachments/*valid.txt")).read_text(encoding="ascii").split()
    assert kept[:2] == [str(40 * RESTED_S)] * 2
    assert int(kept[2]) > RESTED_S
    assert verify(folder).findings == ()
    assert workspace.hil("replay", str(folder), timeout=300).code == 0


FAILING = """
import os
from pathlib import Path


@pytest.mark.requirement("T-010")
@pytest.mark.max_duration(1e9)
@pytest.mark.repeatable("a turn changes nothing")
def test_turns(clock, check, iterations, supply):
    for turn in iterations("turn", 3):
        again = Path(os.environ["SEEN"]).exists()
        check("T-010", "ratio", 9.0 if turn == 2 and not again else 1.0)
        while turn == 2 and not again:
            Path(os.environ["SEEN"]).touch()
            clock.sleep(1.0)
"""


def paused_and_resumed(workspace, seen):
    """Stop a run once its plan has left its sign, resume it, and return its folder and package, which verifies."""
    workspace.environment["SEEN"] = str(seen)
    folder = begun(workspace)
    while not seen.exists():
        time.sleep(0.02)
    assert workspace.hil("stop", folder.name, "--to-resume", "--by", "Ada").code == 0
    STARTED[-1].wait(60)
    resumed = workspace.hil("resume", folder.name)
    assert resumed.code == 1, resumed.err
    assert verify(folder).findings == ()
    return folder, Package(folder)


def test_a_check_that_failed_is_not_undone_by_a_pause(tmp_path):
    """Its turn is made again, as the plan allows, and passes then; the requirement has failed all the same."""
    workspace = made(tmp_path / "workspace", FAILING)
    folder, package = paused_and_resumed(workspace, tmp_path / "seen")
    (case,) = package.outcome().cases
    assert case.requirements == {"T-010": "FAIL"}
    assert [each.verdict for each in case.checks] == ["PASS"] * 3
    (entry,) = [event["entry"] for event in bodies(package, "resumed")]
    assert [failed["requirement"] for failed in entry["failed"]] == ["T-010"]
    assert "before the run was interrupted" in package.text("data/report/report.html")
    assert workspace.hil("replay", folder.name).code == 0


def test_what_was_read_before_an_interruption_counts(tmp_path):
    """A case that read, was interrupted, and reads again and passes, closes nothing: its first attempt is shown."""
    plan = FAILING.replace('@pytest.mark.repeatable("a turn changes nothing")\n', "").replace("9.0 if", "1.0 if")
    workspace = made(tmp_path / "workspace", plan.replace("while", "supply.coil.voltage()\n        while"))
    folder, package = paused_and_resumed(workspace, tmp_path / "seen")
    (case,) = package.outcome().cases
    assert (case.verdict, case.requirements) == ("ABORTED", {"T-010": "ABORTED"})
    first, last = case.attempts
    assert (first.verdict, len(first.read), last.verdict) == (None, 2, "ABORTED")
    assert "supply.coil.voltage" in first.read[1]
    assert "the plan does not declare the case repeatable" in case.reasons[0]
    assert "2 attempts: not ended (stopped by Ada" in package.text("data/report/report.html")
    assert workspace.hil("replay", folder.name).code == 0
