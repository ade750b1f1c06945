"""A run on a served bench that is killed after its last case: it is sealed without anything being driven again."""

from __future__ import annotations

import signal
from contextlib import chdir

import numpy as np
import pytest
from live_runs import live_workspace, running, seconds_until, served
from resumed_runs import without_git
from told_as_json import bodies, results_as_json

from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
from hil.plugin.rehearsing import replay

pytestmark = [pytest.mark.system, pytest.mark.alone, pytest.mark.timeout(300)]

SPEED = 4.0
WATCH = {
    'max: "0.02", for: 60 s': 'max: "0.02", for: 40 s',
    'tolerance: "4", within: 180 s': 'tolerance: "40", within: 40 s',
}

FOR_A_WHILE = "clock.sleep(10.0)"

AT_THE_SEAL = f"""\
{FOR_A_WHILE}
import sys
def at_the_seal(event, arguments):
    if event == "open" and "results.json" in str(arguments[0]):
        os.kill(os.getpid(), signal.SIGKILL)
if not Path("again").exists():
    Path("again").touch()
    sys.addaudithook(at_the_seal)"""
"""Ends the process once every row file was turned into HDF5."""


@pytest.fixture
def bench(tmp_path_factory):
    """The battery bench, served."""
    with served(tmp_path_factory.mktemp("b") / "e", speed=SPEED) as bench:
        yield bench


def resumed(run):
    """Go on with a run, acknowledged where it left a latch, and return how that ended."""
    run.workspace.hil("ack", run.folder.name, "--by", "Ada", "--text", "all is off")
    return run.workspace.hil("resume", run.folder.name, "--served", str(run.bench.folder))


def require_sealed_without_arming(run, ended):
    """Require a package with its own verdict, whose bench was proven safe and watched again, and not driven."""
    assert ended.code == 0, ended.out + ended.err
    package = Package(run.folder)
    assert verify(run.folder).findings == ()
    assert results_as_json(package)["verdict"] == "PASS"
    resumed = bodies(package, "resumed")[-1]
    kinds = [line.event.kind() for line in package.lines() if line.event.seq > resumed["seq"]]
    assert not {"armed", "gate", "host-gate", "rest", "drive"} & set(kinds)
    watched = [event["ok"] for event in bodies(package, "safe") if event["state"] == "watched"]
    assert watched == [True, True]
    with chdir(run.workspace.root):  # the case leaves its marks there
        assert replay(package).differences == ()
    return package


def killed_in_the_watch(run):
    """Kill it during the watch after its end, and return the rows that were read by then."""
    file = run.folder / "data/recordings/after-cycler-current.rows"

    def rows():  # the heading alone, which is written first, is no row
        return file.read_bytes().partition(b"\n")[2] if file.exists() else b""

    seconds_until(rows, 60.0, "a row of the watch")
    run.send(signal.SIGKILL)
    assert run.ended().code == 3
    return rows()


def rows_of(package):
    """Return the rows of the watch as bytes."""
    found = package.recording("after-cycler-current")
    return np.column_stack([found.time, *found.arrays.values()]).tobytes()


@pytest.mark.soak
def test_killed_in_the_watch_after_its_end(tmp_path, bench):
    """What was read until then is in the package, in its place; the watch is made again after it."""
    with running(bench, without_git(live_workspace(tmp_path / "w", FOR_A_WHILE, WATCH))) as run:
        kept = killed_in_the_watch(run)
        package = require_sealed_without_arming(run, resumed(run))
    assert len(kept) > 0
    assert rows_of(package).startswith(kept)
    (entry,) = [event["entry"] for event in bodies(package, "resumed")]
    assert entry["over"]
    assert {"recording": "after-cycler-current", "first": 0, "end": len(kept) // 16} in entry["rows"]


def test_killed_at_the_seal(tmp_path, bench):
    """Its recordings are HDF5 already, and lose no row by going on."""
    with running(bench, without_git(live_workspace(tmp_path / "w", AT_THE_SEAL, WATCH))) as run:
        assert run.ended().code == 3
        (run.workspace.root / "again").unlink()  # it is killed at its second seal, too
        assert len(list((run.folder / "data/recordings").glob("*.rows"))) == 0
        kept = [rows_of(Package(run.folder))]
        assert resumed(run).code == 3
        kept.append(rows_of(Package(run.folder)))
        package = require_sealed_without_arming(run, resumed(run))
    assert 0 < len(kept[0]) < len(kept[1])
    assert rows_of(package).startswith(kept[1])
    assert kept[1].startswith(kept[0])
    assert [event["entry"]["over"] for event in bodies(package, "resumed")] == [True, True]
