"""Runs that are interrupted, killed, or run out of space: the bench is safe, and nothing recorded is lost."""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import signal
import subprocess
import time
from datetime import UTC, datetime
from pathlib import Path

import pytest
import sweeps
from told_as_json import bodies, results_as_json
from workspaces import DUT, STARTED, executive, finish, kill, make

from hil.cli.main import main
from hil.evidence.journal.reader import read_journal
from hil.evidence.package.contents import Package
from hil.evidence.package.verification import State, verify

pytestmark = pytest.mark.system

LONG = """
@pytest.mark.requirement("T-030")
@pytest.mark.max_duration(1e9)
def test_long(field, record, step):
    for part in range(100_000):
        with step(f"Part {part}"):
            record("field", field, duration=5.0, rate=40.0)


@pytest.mark.requirement("T-010")
def test_last(check):
    check("T-010", "ratio", 1.0)
"""

COMPUTING = """
@pytest.mark.requirement("T-010")
def test_computing(check, step, field):
    with step("Compute"):
        while True:
            sum(range(1000))


def test_last():
    pass
"""

SWALLOWING = """
@pytest.mark.requirement("T-010")
@pytest.mark.max_duration(1e9)
def test_swallowing(check, clock):
    while True:
        try:
            clock.sleep(0.1)
        except Exception:
            pass
"""


def until(process, text: str) -> None:
    """Read standard output until a line holds `text`; the test's timeout ends a run that never says it."""
    STARTED.append(process)
    for line in process.stdout:
        if text in line:
            return
    raise AssertionError(f"the run ended before it said {text!r}: {process.stderr.read()}")


def started(tmp_path, cases=LONG, text="1 Part", **options):
    """Start a run in a workspace of its own, and return both once it is in its case."""
    workspace = make(tmp_path / "workspace", cases)
    process = workspace.start_run(**options)
    until(process, text)
    return workspace, process


def package_of(workspace) -> Package:
    """Return the one run of a workspace."""
    (folder,) = workspace.folders()
    return Package(folder)


@pytest.mark.parametrize("detached", [False, True], ids=["attended", "detached"])
def test_somebody_is_notified_of_a_run_that_died(tmp_path, detached):
    """The process that waited tells which run it was, how it ended, and what to do next."""
    workspace = make(tmp_path / "workspace", LONG)
    (workspace.root / "hil.toml").write_text('notify = ["/bin/cp", "/dev/stdin", "told.json"]\n', encoding="utf-8")
    if detached:
        assert workspace.hil(*workspace.run_arguments, "--detach").code == 0
        (folder,) = [path for path in workspace.folders() if path.is_dir()]
        (process,) = [int(path.name) for path in Path("/proc").glob("[0-9]*") if _holds(path, folder)]
        os.kill(process, signal.SIGKILL)
    else:
        process = workspace.start_run()
        until(process, "1 Part")
        folder = package_of(workspace).folder
        os.kill(executive(process), signal.SIGKILL)
        assert finish(process).code == 3
    told = workspace.root / "told.json"
    while not told.exists() or not told.read_bytes().endswith(b"\n"):
        time.sleep(0.05)
    found = json.loads(told.read_bytes())
    assert (found["event"], found["run"]) == ("died", folder.name)
    assert found["text"].startswith("the process of the run was ended by SIGKILL before the run was sealed; ")
    assert f"hil status {folder.name}" in found["text"]
    assert f"hil resume {folder}" in found["text"]


def _holds(process: Path, folder: Path) -> bool:
    """Return whether a process has the journal of a run open."""
    with contextlib.suppress(OSError):
        return any(each.readlink() == folder / "data/journal.jsonl" for each in (process / "fd").iterdir())
    return False


@pytest.mark.parametrize("name", sweeps.sample(["SIGINT", "SIGTERM", "SIGHUP"], 2))
def test_a_signal_ends_the_run_safe_and_sealed(tmp_path, name):
    """The case is ABORTED, the rest NOT_RUN, every output proven safe, the package sealed, the exit code 2."""
    workspace, process = started(tmp_path)
    process.send_signal(signal.Signals[name])
    ended = finish(process)
    package = package_of(workspace)
    results = results_as_json(package)
    assert ended.code == 2, ended.err
    assert ended.err == ""
    assert ended.last_line == f"reports/{package.name}"
    assert [case["verdict"] for case in results["cases"]] == ["ABORTED", "NOT_RUN"]
    assert (results["verdict"], results["interrupted"], results["safe"]) == ("ABORTED", True, True)
    assert [(stop["reason"], stop["urgent"]) for stop in bodies(package, "stop")] == [(name, False)]
    found = verify(package.folder)
    assert (found.state, found.findings, found.ok) == (State.SEALED, (), False)


def test_a_signal_ends_a_case_that_only_computes(tmp_path):
    """A case that never comes to a scheduling point is ended where it is, and the bench is safe."""
    workspace, process = started(tmp_path, COMPUTING, "Compute")
    process.send_signal(signal.SIGINT)
    ended = finish(process)
    package = package_of(workspace)
    assert ended.code == 2, ended.err
    assert [case["verdict"] for case in results_as_json(package)["cases"]] == ["ABORTED", "NOT_RUN"]
    assert [stop["urgent"] for stop in bodies(package, "stop")] == [False]
    assert verify(package.folder).findings == ()
    assert results_as_json(package)["safe"] is True


@pytest.mark.timeout(360)
def test_two_signals_at_any_moment_cut_nothing_in_two(tmp_path):
    """Whatever the executive is at when both signals come, the journal's chain and the package are whole."""
    pauses = random.Random(7)
    for number in range(sweeps.chosen(1, 6)):
        workspace, process = started(tmp_path / str(number))
        time.sleep(pauses.uniform(0.0, 0.3))
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGTERM)
        ended = finish(process)
        package = package_of(workspace)
        assert (ended.code, ended.err) == (2, "")
        found = verify(package.folder)
        assert (found.state, found.findings) == (State.SEALED, ())
        assert results_as_json(package)["safe"] is True


def test_a_case_that_swallows_exceptions_is_stopped(tmp_path):
    """`except Exception` does not catch a stop."""
    workspace, process = started(tmp_path, SWALLOWING, "test_swallowing")
    process.send_signal(signal.SIGTERM)
    assert finish(process).code == 2
    assert results_as_json(package_of(workspace))["verdict"] == "ABORTED"


def moment(line) -> float:
    """Return the wall time of a journal line in seconds."""
    return datetime.fromisoformat(line.wall["utc"]).replace(tzinfo=UTC).timestamp()


@pytest.mark.timeout(600)
def test_a_killed_run_loses_nothing_that_was_told(tmp_path):
    """Killed at any of many moments, a run is found incomplete, whole up to the kill, and sealed as it is."""
    moments = random.Random(20260101)
    workspace = make(tmp_path / "workspace", LONG)
    for number in range(sweeps.chosen(3, 30)):
        process = workspace.start_run("--output", str(tmp_path / f"reports-{number}"))
        until(process, "armed" if number % 3 else "plan small")
        time.sleep(moments.uniform(0.0, 1.0))
        kill(process)
        killed = time.time()
        finish(process)
        check_killed(next((tmp_path / f"reports-{number}").glob("[!.]*")), killed)


def check_killed(folder: Path, killed: float) -> None:
    """Look at what a killed run left, seal it, and look again."""
    found = verify(folder)
    assert (found.state, found.ok) == (State.INTERRUPTED, False)
    assert found.findings[0].message.endswith("the package is incomplete")
    lines = read_journal(folder / "data/journal.jsonl")
    assert lines.findings == ()
    assert killed - moment(lines.lines[-1]) < 1.0
    events = list(lines.events)
    with pytest.raises(SystemExit) as left:
        main(["verify", str(folder)])
    assert left.value.code == 1
    with pytest.raises(SystemExit) as left:
        main(["seal", str(folder)])
    assert left.value.code == 0
    sealed = verify(folder)
    assert (sealed.state, sealed.findings, sealed.ok, sealed.complete) == (State.SEALED, (), False, False)
    package = Package(folder)
    assert list(read_journal(folder / "data/journal.jsonl").events)[: len(events)] == events
    assert results_as_json(package)["verdict"] in {"ABORTED", "ERROR"}


def test_hil_seals_and_verifies_a_killed_run(tmp_path):
    """The same by the commands a person types: verify says 1, seal says where, status says SEALED."""
    workspace, process = started(tmp_path)
    kill(process)
    finish(process)
    name = package_of(workspace).name
    before = workspace.hil("verify", name)
    assert (before.code, before.out.splitlines()[0]) == (1, f"{name}: INTERRUPTED, the run is incomplete")
    assert "INTERRUPTED" in workspace.hil("runs").out
    refused = workspace.hil("stop", name)
    assert refused.code == 4
    assert "is not running" in refused.err
    sealed = workspace.hil("seal", name)
    assert (sealed.code, sealed.last_line) == (0, f"reports/{name}")
    after = workspace.hil("verify", name)
    assert (after.code, after.err) == (1, "")
    assert after.out.splitlines()[0] == f"{name}: SEALED, the run is incomplete"
    assert "verdict     ABORTED" in workspace.hil("status", name).out


def test_another_run_on_the_same_bench_is_refused(tmp_path):
    """Who holds the bench is told; once the holder is dead, nobody is in the way."""
    workspace, process = started(tmp_path)
    second = finish(workspace.start_run())
    assert second.code == 4
    assert f"is held by a run of small (process {executive(process)} of user " in second.err
    assert len(workspace.folders()) == 1
    kill(process)
    finish(process)
    third = workspace.start_run()
    until(third, "1 Part")
    third.send_signal(signal.SIGINT)
    assert finish(third).code == 2


def test_what_other_terminals_say_becomes_evidence(tmp_path):
    """A note, a file and a stop from other processes arrive in the journal, with their authors."""
    workspace, process = started(tmp_path)
    (workspace.root / "photo.jpg").write_bytes(b"not really a photo")
    name = package_of(workspace).name
    assert "RUNNING" in workspace.hil("status", name).out
    assert workspace.hil("note", name, "door opened", "--by", "Ada").code == 0
    assert workspace.hil("attach", name, "photo.jpg", "--by", "Ada", "--text", "jig").code == 0
    assert workspace.hil("stop", name, "--by", "Ada", "--reason", "smell").code == 0
    ended = finish(process)
    package = package_of(workspace)
    assert ended.code == 2
    assert [(note["text"], note["by"]) for note in bodies(package, "note")] == [("door opened", "Ada")]
    (attachment,) = bodies(package, "attachment")
    assert (package.folder / "data/attachments" / attachment["file"]).read_bytes() == b"not really a photo"
    assert "note: door opened (Ada)" in ended.out
    assert f"attachment: {attachment['file']}: jig (Ada)" in ended.out
    told = workspace.hil("status", name).out
    assert "door opened (Ada)" in told
    assert "photo.jpg: jig (Ada)" in told
    assert [stop["reason"].endswith("Ada: smell") for stop in bodies(package, "stop")] == [True]
    assert verify(package.folder).findings == ()
    assert workspace.hil("note", name, "too late").code == 4
    assert workspace.hil("replay", name).out.splitlines() == [
        "no recorded case ran to its end, so none could be compared",
        "not compared: 2 cases (1 cut short, 1 never run)",
    ]


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 64 MB of its own."""
    place = tmp_path / "disk"
    place.mkdir()
    if os.geteuid() != 0:
        pytest.skip("mounting a small file system needs root")
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64m", "tmpfs", place], check=False)
    if mounted.returncode:
        pytest.skip("no file system can be mounted here")
    yield place
    subprocess.run(["umount", "--lazy", place], check=True)


TURNS = """
@pytest.mark.requirement("T-050")
@pytest.mark.max_duration(1e9)
@pytest.mark.repeatable("reading the bench does not change it")
def test_long(supply, field, record, check, clock, iterations):
    supply.coil.configure(1.9, 0.01)
    supply.coil.enable()
    with record.during("beside", field, rate=4.0):
        for part in iterations("part", 100):
            clock.sleep(20.0)
            assert supply.coil.enabled()
            check("T-050", "voltage", supply.coil.voltage())


@pytest.mark.requirement("T-010")
def test_last(check):
    check("T-010", "ratio", 1.0)
"""


def test_a_full_disk_ends_the_run_safe_and_with_words(tmp_path, small_disk):
    """The bench is safe, the run stays open, and the person and whoever is notified learn which disk it is."""
    workspace = make(tmp_path / "workspace", TURNS)
    (workspace.root / "hil.toml").write_text('notify = ["/bin/cp", "/dev/stdin", "told.json"]\n', encoding="utf-8")
    process = workspace.start_run("--verbose", "--output", str(small_disk / "reports"))
    until(process, "part 5 of 100")
    fill(small_disk / "filler")
    ended = finish(process)
    (folder,) = (small_disk / "reports").glob("[!.]*")
    package = Package(folder)
    assert "Traceback" not in ended.err + ended.out
    assert (ended.code, ended.last_line) == (2, str(folder))
    assert [(stop["reason"], stop["resumable"]) for stop in bodies(package, "stop")] == [("disk full", True)]
    assert [end["ok"] for end in bodies(package, "safe-end")] == [True]
    assert verify(folder).state is State.INTERRUPTED
    told = re.search(rf"stopped by a full disk, and not sealed: {small_disk} has ([0-9 ]+) bytes free\n", ended.out)
    assert told
    assert int(told[1].replace(" ", "")) < 10_000_000
    assert f"free some space there, then resume it with hil resume {folder}, or seal it as it is" in ended.out
    assert f"stopped by a full disk, and not sealed: {small_disk} has" in (workspace.root / "told.json").read_text()

    refused = workspace.hil("resume", str(folder))
    assert refused.code == 4
    assert "MB are free" in refused.err
    assert "free some space, and resume the run" in refused.err
    (small_disk / "filler").unlink()
    ended = workspace.hil("resume", str(folder), timeout=300)
    assert (ended.code, ended.err) == (0, "")
    assert (verify(folder).findings, verify(folder).ok) == ((), True)
    package = Package(folder)
    assert [case["verdict"] for case in results_as_json(package)["cases"]] == ["PASS", "PASS"]
    turns = [event["turn"] for event in bodies(package, "step") if "turn" in event]
    assert turns == list(range(1, 101))
    assert workspace.hil("replay", str(folder), timeout=300).code == 0


@pytest.mark.parametrize("again", [False, True], ids=["once", "again"])
def test_a_run_that_a_full_disk_stopped_is_sealed_as_it_is(tmp_path, small_disk, again):
    """Also where the reserve is eaten up, too; what was recorded is whole, and its verdict is ABORTED."""
    workspace = make(tmp_path / "workspace", LONG)
    process = workspace.start_run("--output", str(small_disk / "reports"))
    until(process, "1 Part")
    fill(small_disk / "filler")
    while again and process.poll() is None:
        fill(small_disk / "filler", "ab")
    ended = finish(process)
    assert (ended.code, "Traceback" in ended.err) == (2, False), ended.err
    (folder,) = (small_disk / "reports").glob("[!.]*")
    (small_disk / "filler").unlink()
    assert workspace.hil("seal", str(folder)).code == 0
    assert (verify(folder).findings, results_as_json(Package(folder))["verdict"]) == ((), "ABORTED")


def fill(path: Path, mode: str = "wb") -> None:
    """Write until nothing more fits."""
    with path.open(mode, buffering=0) as stream, contextlib.suppress(OSError):
        for size in (1 << 20, 1 << 12, 1):
            with contextlib.suppress(OSError):
                while stream.write(bytes(size)):
                    pass


def test_a_place_without_space_is_refused(tmp_path, small_disk):
    """A run whose evidence has no space does not begin."""
    workspace = make(tmp_path / "workspace", LONG)
    (small_disk / "filler").write_bytes(bytes(20_000_000))
    ended = finish(workspace.start_run("--output", str(small_disk / "reports")))
    assert ended.code == 4
    assert "MB are free" in ended.err
    assert not (small_disk / "reports").exists()


def test_the_last_line_of_a_finished_run_is_its_package(tmp_path):
    """Scripts find the package without looking for it, also where the case itself prints."""
    cases = """
    @pytest.mark.requirement("T-010")
    def test_one(check):
        print("something of the case's own")
        check("T-010", "ratio", 1.0)
    """
    workspace = make(tmp_path / "workspace", cases)
    ended = finish(workspace.start_run())
    assert (ended.code, ended.err) == (0, "")
    assert ended.last_line == f"reports/{package_of(workspace).name}"
    assert workspace.hil("verify", ended.last_line).code == 0
    assert workspace.hil("replay", ended.last_line).code == 0
    assert DUT in ended.last_line
