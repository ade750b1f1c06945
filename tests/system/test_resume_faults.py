"""`hil resume` of runs that were stopped or damaged on the way: nothing is lost, and what cannot go on is left."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
import sweeps
from resumed_runs import without_git
from told_as_json import bodies
from workspaces import STARTED, finish, kill, make

from hil.evidence.folder import is_held
from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify

pytestmark = pytest.mark.system

TURNS = """
@pytest.mark.requirement("T-050")
@pytest.mark.max_duration(1e9)
@pytest.mark.repeatable("reading the bench does not change it")
def test_long(supply, field, operator, record, check, clock, iterations):
    supply.coil.configure(1.9, 0.01)
    supply.coil.enable()
    with record.during("beside", field, rate=4.0):
        for part in iterations("part", 60):
            operator.confirm("Is the jig still in its place?", name="jig")
            clock.sleep(60.0)
            check("T-050", "voltage", supply.coil.voltage())
"""


@pytest.fixture(scope="module")
def workspace(tmp_path_factory):
    """A workspace with one case of many turns."""
    return without_git(make(tmp_path_factory.mktemp("resume") / "workspace", TURNS))


def begun(workspace, turn: int) -> Path:
    """Start a run, wait until it is in this turn, and return its folder."""
    before = workspace.folders()
    STARTED.append(workspace.start(*workspace.run_arguments, stdout=subprocess.DEVNULL))
    while True:
        time.sleep(0.02)
        for folder in workspace.folders():
            journal = folder / "data/journal.jsonl"
            if folder not in before and journal.exists() and f'"turn":{turn}}}'.encode() in journal.read_bytes():
                return folder


@pytest.fixture(scope="module")
def killed(workspace, tmp_path_factory):
    """A copy of the folder of a run that was killed in its last turns."""
    while True:  # a fast machine ends a run before its first checkpoint, which comes after a second
        folder = begun(workspace, 50)
        while not (folder / "checkpoint.json").exists() and STARTED[-1].poll() is None:
            time.sleep(0.02)
        if STARTED[-1].poll() is None:
            break
        finish(STARTED.pop())
    kill(STARTED[-1])
    STARTED.pop().communicate()
    copy = tmp_path_factory.mktemp("killed") / folder.name
    folder.rename(copy)
    return copy


@pytest.fixture
def interrupted(workspace, killed):
    """The folder of the run that was killed, as it was left."""
    folder = workspace.reports / killed.name
    if (folder / "bagit.txt").exists():  # sealed by the test before
        for path in [folder, *folder.rglob("*")]:
            path.chmod(0o755)
    shutil.rmtree(folder, ignore_errors=True)
    shutil.rmtree(workspace.reports / ".ledger", ignore_errors=True)  # it has the seal of the same run
    return shutil.copytree(killed, folder)


def whole(workspace, folder: Path) -> Package:
    """Resume a run to its end, and return its package, which verifies and replays."""
    ended = workspace.hil("resume", folder.name)
    assert (ended.code, ended.err) == (0, "")
    assert (verify(folder).findings, verify(folder).ok) == ((), True)
    replayed = workspace.hil("replay", str(folder))
    assert (replayed.code, replayed.err) == (0, "")
    return Package(folder)


@pytest.mark.timeout(360)
@pytest.mark.parametrize("how", sweeps.sample(["SIGINT", "SIGTERM", "hil stop"], 2))
def test_a_resume_that_is_stopped_on_its_record_leaves_the_run_as_it_was(workspace, interrupted, how):
    """It can be resumed again, and does not stop a second time for what was asked of the process before."""
    before = (interrupted / "data/journal.jsonl").read_bytes()
    STARTED.append(workspace.start("resume", interrupted.name))
    while not is_held(interrupted):
        time.sleep(0.01)
    time.sleep(0.1)  # it makes its bench
    if how == "hil stop":
        asked = workspace.hil("stop", interrupted.name, "--by", "Ada").code
        assert asked in {0, 4}  # refused where the resume has come to its end meanwhile, which is skipped below
    else:
        os.killpg(STARTED[-1].pid, signal.Signals[how])
    ended = finish(STARTED[-1], 60)
    if ended.code == 0:
        pytest.skip("the resume had ended before it was stopped")
    # On a busy machine a signal may come before the resume has started; then it says nothing of the run.
    early = how != "hil stop" and ended.code == 130
    if ended.code == 2 and b'"kind":"resumed"' in (interrupted / "data/journal.jsonl").read_bytes().removeprefix(
        before
    ):
        pytest.skip("the run was going on again before it was stopped")
    assert early or (ended.code, "was stopped before it resumed" in ended.err) == (2, True)
    assert (interrupted / "data/journal.jsonl").read_bytes() == before
    told = [event["text"] for event in bodies(whole(workspace, interrupted), "anomaly")]
    assert told == (["inbox, unheard by Ada: stop, before the run was resumed"] if how == "hil stop" else [])


@pytest.mark.parametrize(
    ("file", "now", "told"),
    [
        ("data/transcript.tsv", None, "data/transcript.tsv: it is missing"),
        ("data/transcript.tsv", b"hil transcript 10\n", "data/transcript.tsv:1:1: the line is damaged: "),
        ("data/software.json", b"{}", "data/software.json: it is not what was frozen before the first step"),
    ],
)
def test_a_damaged_run_is_sealed_with_its_damage_told(workspace, interrupted, file, now, told):
    """What is left is kept safe; whoever seals it is told at once what cannot be verified or replayed any more."""
    if now is None:
        (interrupted / file).unlink()
    else:
        (interrupted / file).write_bytes(now)
    ended = workspace.hil("seal", interrupted.name)
    assert (ended.code, told in ended.err, "it is sealed as it is, with this damage" in ended.err) == (1, True, True)
    assert "evidence digest" not in ended.out
    assert ended.last_line == f"reports/{interrupted.name}"
    assert (interrupted / "bagit.txt").exists()


def test_a_damaged_file_that_keeps_a_run_from_its_seal_is_moved_out_of_it(workspace, interrupted, tmp_path):
    """Results cannot be derived from it; without it they can, and what is left is sealed."""
    file = interrupted / "data/dut.json"
    file.write_text("null")
    refused = workspace.hil("seal", interrupted.name)
    assert (refused.code, "cannot seal: data/dut.json: it must be an object" in refused.err) == (4, True)
    assert "move it out of the run's folder, and seal again" in refused.err
    file.rename(tmp_path / file.name)
    ended = workspace.hil("seal", interrupted.name)
    assert (ended.code, "data/dut.json: what was frozen is missing" in ended.err) == (1, True)
    assert (interrupted / "bagit.txt").exists()


@pytest.mark.timeout(360)
def test_a_run_that_was_stopped_twice_to_be_resumed_goes_on(workspace):
    """The second word neither seals the run, nor stops the resumed one, and it is written down."""
    folder = begun(workspace, 10)
    # Both at once: the run must not have heard the first before the second is given.
    words = [workspace.start("stop", folder.name, "--to-resume") for _ in range(2)]
    assert [finish(word, 60).code for word in words] == [0, 0]
    finish(STARTED[-1], 60)
    assert not (folder / "bagit.txt").exists()
    whole(workspace, folder)


@pytest.mark.timeout(360)
def test_a_run_that_was_killed_on_its_way_to_the_safe_state_is_entered_after_it(workspace):
    """Its last checkpoint is from before the turn that is entered; recorded time goes forward all the same."""
    folder = begun(workspace, 3)
    while not (folder / "checkpoint.json").exists():
        time.sleep(0.01)
    early = (folder / "checkpoint.json").read_bytes()
    assert workspace.hil("stop", folder.name, "--to-resume").code == 0
    finish(STARTED[-1], 60)
    (folder / "checkpoint.json").write_bytes(early)
    package = whole(workspace, folder)
    for event in bodies(package, "recording"):
        assert np.all(np.diff(package.recording(event["recording"]).time) > 0)


HOLD = """
hold:
- {output: supply.coil, state: "off", within: 2 s,
   proof: {output: supply.coil, quantity: current, unit: A, min: "-0.001", max: "0.001"}}
"""


@pytest.mark.timeout(480)
def test_a_run_that_was_killed_while_it_was_held_is_held_again(tmp_path):
    """It is released as any other, killed again after that, resumed again, and replayed."""
    workspace = without_git(make(tmp_path / "workspace", TURNS))
    workspace.change_bench({"\nrest:\n": f"{HOLD}\nrest:\n"})
    folder = begun(workspace, 5)
    assert workspace.hil("hold", folder.name, "--reason", "door").code == 0
    time.sleep(1.5)  # a checkpoint is made meanwhile
    kill(STARTED[-1])
    STARTED[-1].communicate()
    STARTED.append(workspace.start("resume", folder.name, stdout=subprocess.DEVNULL))
    while b"it was held when the run was interrupted" not in (folder / "data/journal.jsonl").read_bytes():
        time.sleep(0.05)
    assert workspace.hil("hold", folder.name, "--release").code == 0
    time.sleep(0.8)  # the release is on the disk, too; before that the run would be held still
    kill(STARTED[-1])
    STARTED[-1].communicate()
    whole(workspace, folder)


def change_number(told: dict[str, object]) -> None:
    """Let a checkpoint say another instant."""
    told["at_ns"] = int(str(told["at_ns"])) + 1


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda told: told.clear(), "'format'"),
        (lambda told: told.update(format=99), "format 99"),
        (lambda told: told.update(run="another"), "of another run"),
        (change_number, "not what was written"),
    ],
)
def test_a_checkpoint_that_is_not_of_the_run_is_refused(workspace, interrupted, change, word):
    """The message tells that the run can be made again without it, and nothing is changed."""
    path = interrupted / "checkpoint.json"
    told = json.loads(path.read_bytes())
    change(told)
    path.write_text(json.dumps(told), encoding="ascii")
    ended = workspace.hil("resume", interrupted.name)
    assert (ended.code, word in ended.err, "remove it" in ended.err) == (4, True, True)


@pytest.mark.timeout(360)
@pytest.mark.parametrize("name", ["dut.json", "place.json", "software.json"])
def test_a_run_whose_frozen_files_are_damaged_is_refused_before_it_is_driven(workspace, interrupted, name):
    """It went on to its end, and the package was damaged or could not be sealed."""
    before = (interrupted / "data/journal.jsonl").read_bytes()
    (interrupted / "data" / name).write_text("null")
    resumed = workspace.hil("resume", interrupted.name)
    assert resumed.code == 4
    assert f"cannot resume: data/{name}: it is not what was frozen before the first step" in resumed.err
    assert (interrupted / "data/journal.jsonl").read_bytes() == before


def test_a_run_without_checkpoint_and_half_of_its_record_comes_to_the_same(workspace, interrupted):
    """A simulated bench makes again what a disk lost: transcript, rows, half a header, the reserve."""
    (interrupted / "reserve.bin").unlink()
    transcript = interrupted / "data/transcript.tsv"
    operations = json.loads((interrupted / "checkpoint.json").read_text())["operations"]
    lines = transcript.read_bytes().splitlines(keepends=True)
    os.truncate(transcript, sum(len(line) for line in lines[: operations // 2]) + 9)
    for rows, size in zip(sorted(interrupted.glob("data/recordings/*.rows")), (40, 4001, 0), strict=True):
        os.truncate(rows, size)
    refused = workspace.hil("resume", interrupted.name)
    assert (refused.code, "the transcript holds" in refused.err) == (4, True)
    (interrupted / "checkpoint.json").unlink()
    whole(workspace, interrupted)


@pytest.mark.parametrize(
    ("part", "code", "word"),
    [
        ("transcript.tsv", 4, "cannot be resumed: data/transcript.tsv:"),
        ("recordings/001-test_long-beside.rows", 3, "cannot be resumed"),
    ],
)
def test_a_record_that_is_damaged_at_its_end_is_left_as_it_is(workspace, interrupted, part, code, word):
    """Also where the journal has nothing more to compare, no verdict is made of it; a damaged line is named."""
    path, journal = interrupted / "data" / part, interrupted / "data/journal.jsonl"
    before = journal.read_bytes()
    data = bytearray(path.read_bytes())
    data[-60] ^= 0x81
    path.write_bytes(data)
    ended = workspace.hil("resume", interrupted.name)
    assert (ended.code, word in ended.err) == (code, True), ended.err
    assert journal.read_bytes().count(b"case-end") == before.count(b"case-end")
    assert not (interrupted / "bagit.txt").exists()
