"""Clocks that move under runs on a served bench: a suspend, another time of day, a reboot; none is a silent gap."""

from __future__ import annotations

import json
import signal
from pathlib import Path

import pytest
from live_runs import LiveRun, live_workspace, running, seconds_until, served
from moved_clocks import machine
from resumed_runs import without_git
from told_as_json import bodies

from hil.evidence.folder import JOURNAL
from hil.evidence.journal.reader import read_journal
from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify

pytestmark = [pytest.mark.system, pytest.mark.alone, pytest.mark.timeout(400)]

TWO_HOURS = 7200
SPEED = 4.0
SOME = 3 * 7 * 8
"""Bytes of three rows."""
RECORDS = """\
with record.during("test", cycler, rate=0.2) as test:
    for turn in iterations("Turn", 8):
        if cycler.state() != "charge":
            cycler.prepare(1, time=7200.0)
            cycler.start()
        test.until("phase", equals=1.0, within=60.0)
        clock.sleep(15.0)"""


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """The battery bench, served for all of these runs one after the other."""
    with served(tmp_path_factory.mktemp("b") / "e", speed=SPEED) as bench:
        yield bench


@pytest.fixture
def clocks(tmp_path):
    """A machine whose clocks the test moves."""
    return machine(tmp_path)


def recording_workspace(root):
    """Return a workspace whose case records the tester with every output on."""
    workspace = live_workspace(root, RECORDS)
    workspace.change(
        "testplans/on/test_on.py", {"clock, check, step, operator)": "clock, record, iterations, check, step)"}
    )
    return without_git(workspace)


def amid_its_recording(run):
    """Wait until the recording has some rows."""
    path = run.folder / "data/recordings/001-test_on-test.rows"
    seconds_until(lambda: path.exists() and len(path.read_bytes().partition(b"\n")[2]) > SOME, 60.0, "some rows")


def resumed(run, workspace):
    """Acknowledge what the guardian did, resume the run on a workspace's machine, and return its package."""
    name = run.folder.name
    assert workspace.hil("ack", name, "--by", "Ada", "--text", "all is off").code == 0
    ended = workspace.hil("resume", name, "--served", str(run.bench.folder))
    package = Package(run.folder)
    assert verify(package.folder).findings == (), ended.out + ended.err
    return package


def test_a_machine_that_was_suspended_for_two_hours(tmp_path, bench, clocks):
    """The guardian acts when the machine wakes, and says why; the gap in the record is told, in hours."""
    workspace = clocks.of(recording_workspace(tmp_path / "w"))
    with running(bench, workspace) as run:
        amid_its_recording(run)
        guardian = run.guardian
        clocks.is_suspended(TWO_HOURS)
        seconds_until(lambda: not bench.on(), 3.0, "safe")
        run.ended()
        seconds_until(lambda: not Path(f"/proc/{guardian}").exists(), 30.0, "the guardian's end")
        lines = [json.loads(line) for line in (run.folder / "data/guardian.jsonl").read_text().splitlines()]
        assert any("suspended for 7200" in str(line) for line in lines)
        package = resumed(run, workspace)
    # Where the executive saw it before the guardian ended it, it said so itself; else the resumption does.
    events = bodies(package, "suspended", "resumed")
    assert events[-1]["kind"] == "resumed"
    assert sum(event["seconds"] for event in events) == pytest.approx(TWO_HOURS, abs=60)
    page = package.text("data/report/report.html")
    assert "was suspended" in page
    (end,) = [event for event in bodies(package, "recording-end") if event["recording"].startswith("001-")]
    assert end["complete"]
    time = package.recording(end["recording"]).time
    assert max(time[1:] - time[:-1]) == pytest.approx(TWO_HOURS * SPEED, rel=0.02)


@pytest.mark.soak
def test_a_time_of_day_that_jumps(tmp_path, bench, clocks):
    """Both ways it is an event, and nothing of the run depends on it: neither limits nor rows."""
    workspace = clocks.of(recording_workspace(tmp_path / "w"))
    with running(bench, workspace) as run:
        amid_its_recording(run)
        clocks.is_set(3600)
        kinds = ["clock-jump"]
        seconds_until(lambda: told(run, kinds[0]) == [3600], 10.0, "the jump")
        clocks.is_set(-7200)
        ended = run.ended()
    assert ended.code == 0, ended.out
    package = Package(run.folder)
    assert told(run, "clock-jump") == [3600, -7200]
    assert told(run, "suspended") == []
    assert verify(package.folder).findings == ()
    assert "clock jump" in package.text("data/report/report.html")
    (end,) = [event for event in bodies(package, "recording-end") if event["recording"].startswith("001-")]
    time = package.recording(end["recording"]).time
    assert max(time[1:] - time[:-1]) < 10.0


@pytest.mark.soak
def test_a_machine_that_was_restarted(tmp_path, bench, clocks):
    """Boot time begins again with another boot; the reboot is an event, and the time by day tells how long it took."""
    workspace = clocks.of(recording_workspace(tmp_path / "w"))
    with running(bench, workspace) as run:
        amid_its_recording(run)
        guardian = run.guardian
        run.send(signal.SIGKILL)
        run.ended()
        seconds_until(lambda: not Path(f"/proc/{guardian}").exists(), 30.0, "the guardian's end")
        clocks.is_set(TWO_HOURS)
        package = resumed(run, clocks.of(workspace, boot_id="00000000-1111-2222-3333-444444444444"))
    (reboot,) = bodies(package, "reboot")
    assert reboot["seconds"] == pytest.approx(TWO_HOURS, abs=60)
    assert "reboot" in package.text("data/report/report.html")
    (end,) = [event for event in bodies(package, "recording-end") if event["recording"].startswith("001-")]
    time = package.recording(end["recording"]).time
    assert max(time[1:] - time[:-1]) == pytest.approx(TWO_HOURS * SPEED, rel=0.02)


def told(run: LiveRun, kind: str) -> list[int]:
    """Return for how many seconds, rounded, events of a kind tell."""
    return [round(event["seconds"]) for event in bodies(read_journal(run.folder / JOURNAL)) if event["kind"] == kind]
