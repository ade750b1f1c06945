"""Runs that last: followed from another terminal, detached from their own, held, and telling somebody."""

from __future__ import annotations

import json

import pytest
from workspaces import STARTED, finish, kill, make

pytestmark = pytest.mark.system

LONG = """
@pytest.mark.requirement("T-030")
@pytest.mark.max_duration(1e9)
def test_long(field, record, iterations):
    for part in iterations("part", 100_000):
        record("field", field, duration=5.0, rate=40.0)
"""


def until(process, *texts: str) -> str:
    """Read standard output until a line holds all `texts`, and return the line."""
    STARTED.append(process)
    for line in process.stdout:
        if all(text in line for text in texts):
            return line
    raise AssertionError(f"it ended before it said {texts}: {process.stderr.read()}")


@pytest.fixture
def running(tmp_path):
    """Return a workspace and its run, in its third turn."""
    workspace = make(tmp_path / "workspace", LONG)
    process = workspace.start_run()
    until(process, "part 3 of 100000")
    return workspace, process


def test_a_run_is_followed_to_its_end(running):
    """Its events are lines, from where it was joined, and the last ones are its verdict; nothing of it is touched."""
    workspace, run = running
    follower = workspace.start("status", "latest", "--follow")
    assert "of this case" not in until(follower, "about ")
    until(follower, "part ")
    assert workspace.hil("stop", "latest", "--reason", "enough", "--by", "Ada").code == 0
    ended = finish(follower)
    assert finish(run).code == 2
    assert (ended.code, ended.err) == (0, "")
    assert "stopped by Ada: enough" in ended.out
    assert "ABORTED  " in ended.out
    assert workspace.hil("verify", "latest").out.startswith(workspace.folders()[0].name)


def test_a_run_is_told_to_machines(running):
    """A document a second: what is left, the loop, and the newest values with the envelope's limits."""
    workspace, run = running
    follower = workspace.start("status", "latest", "--follow", "--json")
    told = json.loads(until(follower, '"envelope":true', '"turn":'))
    kill(run)
    assert json.loads(finish(follower).out.splitlines()[-1])["state"] == "INTERRUPTED"
    (turn,) = told["turns"]
    assert (told["state"], told["case"].rpartition("::")[2]) == ("RUNNING", "test_long")
    assert (turn["name"], turn["turns"], turn["turn"] >= 3) == ("part", 100_000, True)
    assert 0 < told["left"]["run"] < told["left"]["at_most"] <= 1e9
    assert all(reading["max"] is not None for reading in told["readings"] if reading["envelope"])


def test_whoever_follows_a_killed_run_learns_of_it(running):
    """It says since when nothing goes on, and what to do."""
    workspace, run = running
    follower = workspace.start("status", "latest", "--follow")
    until(follower, "part ")
    kill(run)
    ended = finish(follower)
    name = workspace.folders()[0].name
    assert ended.code == 0
    assert f"{name} has not been running since 20" in ended.out
    assert ended.last_line.endswith(f"hil seal {name} seals it as it is")


def packages(workspace):
    """Return the folders of the runs; logs lie beside them."""
    return [folder for folder in workspace.folders() if folder.is_dir()]


def test_a_detached_run_goes_on_alone(tmp_path):
    """It returns with the folder of a run that goes on, and can be stopped; the log tells its end."""
    workspace = make(tmp_path / "workspace", LONG)
    ended = workspace.hil(*workspace.run_arguments, "--detach")
    (folder,) = packages(workspace)
    log = folder.with_name(f"{folder.name}.log")
    try:
        assert (ended.code, ended.err) == (0, "")
        assert ended.out.splitlines() == [f"log  reports/{log.name}", f"reports/{folder.name}"]
        assert json.loads(workspace.hil("status", "latest", "--json").out)["state"] == "RUNNING"
    finally:
        assert workspace.hil("stop", "latest", "--by", "Ada").code == 0
    followed = workspace.hil("status", "latest", "--follow")
    assert "ABORTED  " in followed.out
    assert "plan small on bench adcs" in log.read_text()
    assert sorted(path.name for path in workspace.reports.glob("[!.]*")) == sorted([folder.name, log.name])


def test_a_detached_run_that_cannot_begin_says_so(tmp_path):
    """Wrong usage has its sentence and its exit code, and nothing is left behind."""
    workspace = make(tmp_path / "workspace", LONG)
    wrong = [*workspace.run_arguments, "--detach"]
    wrong[wrong.index("--dut") + 1] = "NOBODY"
    ended = workspace.hil(*wrong)
    assert (ended.code, ended.out) == (4, "")
    assert "NOBODY" in ended.err
    assert not workspace.reports.exists()
    asking = workspace.hil(*workspace.run_arguments, "--detach", "--ask")
    assert (asking.code, "--answers FILE" in asking.err) == (4, True)


HOLD = 'hold:\n- {output: supply.coil, state: "off", within: 2 s}\n'


def test_a_run_is_held_released_and_stopped_from_another_terminal(tmp_path):
    """Whoever asks learns what became of it: held, held already, released, not held; a stop ends a hold."""
    workspace = make(tmp_path / "workspace", LONG)
    workspace.change_bench({"\nrest:\n": f"\n{HOLD}\nrest:\n"})
    run = workspace.start_run()
    until(run, "part 3 of 100000")
    held = workspace.hil("hold", "latest", "--reason", "door", "--by", "Ada")
    assert (held.code, held.out) == (0, "supply.coil off, read back\n"), held.err
    assert "held        door" in workspace.hil("status", "latest").out
    again = workspace.hil("hold", "latest")
    assert (again.code, again.err) == (1, "refused: the bench is held already\n")
    assert workspace.hil("hold", "latest", "--release").code == 0
    free = workspace.hil("hold", "latest", "--release")
    assert (free.code, free.err) == (1, "refused: the bench is not held\n")
    assert workspace.hil("hold", "latest").code == 0
    assert workspace.hil("stop", "latest", "--by", "Ada").code == 0
    assert finish(run).code == 2
    assert workspace.hil("verify", "latest").err == ""
    sealed = workspace.hil("hold", "latest")
    assert (sealed.code, "is sealed" in sealed.err) == (4, True)


def test_a_run_that_ends_tells_somebody(tmp_path):
    """The command of the workspace hears of the end, whatever became of its own output, and the run is sealed."""
    workspace = make(tmp_path / "workspace", LONG)
    (workspace.root / "hil.toml").write_text('notify = ["/bin/cp", "/dev/stdin", "told.json"]\n')
    run = workspace.start_run()
    until(run, "part 3 of 100000")
    assert workspace.hil("stop", "latest", "--by", "Ada").code == 0
    ended = finish(run)
    told = json.loads((workspace.root / "told.json").read_text())
    assert (ended.code, ended.err) == (2, "")
    assert (told["event"], told["run"], told["text"]) == ("end", packages(workspace)[0].name, "the run was stopped")
    assert workspace.hil("verify", "latest").err == ""
