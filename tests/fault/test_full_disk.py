"""A disk that is full for the journal, and not for what it tells of: the run is resumed all the same."""

from __future__ import annotations

import errno
import io
import os
from functools import partial

import pytest
import sweeps
from told_as_json import bodies, results_as_json
from workspaces import make

from hil.evidence.journal.writer import Journal
from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
from hil.executive.journaling.row_store import RowStore
from hil.executive.resuming.preconditions import resumed_request
from hil.plugin.running import resume

pytestmark = pytest.mark.system

TURNS = """
@pytest.mark.requirement("T-050")
@pytest.mark.max_duration(1e9)
@pytest.mark.repeatable("reading the bench does not change it")
def test_turns(supply, field, record, check, clock, iterations):
    supply.coil.configure(1.9, 0.01)
    supply.coil.enable()
    with record.during("beside", field, rate=4.0):
        for part in iterations("part", 8):
            clock.sleep(20.0)
            record("field", field, duration=2.0, rate=40.0)
            check("T-050", "voltage", supply.coil.voltage())


@pytest.mark.requirement("T-010")
def test_last(check):
    check("T-010", "ratio", 1.0)
"""


class Full:
    """A disk that has no space for some events of the journal, counted from one of them on."""

    def __init__(self, first, lost):
        self.left = first
        self.lost = lost

    def __call__(self, descriptor, data):
        """Write a line of the journal, or find no space."""
        self.left -= 1
        if -self.lost <= self.left < 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        return os.write(descriptor, data)


def resumed_to_the_end(workspace, folder):
    """Resume a run that a full disk stopped; nothing of it is missing, and its record replays."""
    assert not (folder / "bagit.txt").exists()
    out = io.StringIO()
    assert resume(folder, partial(resumed_request, start=workspace.root), out) == 0, out.getvalue()
    assert verify(folder).findings == ()
    package = Package(folder)
    assert [case["verdict"] for case in results_as_json(package)["cases"]] == ["PASS", "PASS"]
    assert sorted({event["turn"] for event in bodies(package, "step") if "turn" in event}) == list(range(1, 9))
    assert workspace.hil("replay", str(folder)).code == 0


GAPS = [(first, lost) for first in (60, 61, 62, 63, 64, 65, 66, 67) for lost in (1, 3, 10_000)]


@pytest.mark.parametrize(("first", "lost"), sweeps.sample(GAPS, 4))
def test_a_run_whose_journal_has_a_gap_is_resumed(tmp_path, monkeypatch, first, lost):
    """Wherever it begins, and whether it ends: the run is entered before it, and repeats nothing of what was whole."""
    workspace = make(tmp_path / "workspace", TURNS)
    with monkeypatch.context() as patched:
        patched.setitem(Journal.__init__.__kwdefaults__, "write", Full(first, lost))
        patched.setattr("hil.evidence.journal.writer.free_reserve", lambda _: False)
        ran = workspace.run()
    assert ran.code == 2
    resumed_to_the_end(workspace, ran.package.folder)


@pytest.mark.parametrize("fits", sweeps.sample([3, 5, 8, 11, 14], 2))
def test_rows_that_find_no_space_end_no_case_as_an_error(tmp_path, monkeypatch, fits):
    """The case hears of it as of any stop, so that it is resumed; the bench is safe, and no traceback is shown."""
    workspace = make(tmp_path / "workspace", TURNS)
    written = []

    def write(_, descriptor, data):
        written.append(len(data))
        if len(written) > fits:
            raise OSError(errno.ENOSPC, "No space left on device")
        return os.write(descriptor, data)

    with monkeypatch.context() as patched:
        patched.setattr(RowStore, "_write", write)
        ran = workspace.run()
    assert (ran.code, "INTERNALERROR" in ran.out) == (2, False)
    assert [(stop["reason"], stop["resumable"]) for stop in bodies(ran.package, "stop")] == [("disk full", True)]
    assert [end["verdict"] for end in bodies(ran.package, "case-end")] == ["ABORTED"]
    assert [end["ok"] for end in bodies(ran.package, "safe-end")] == [True]
    resumed_to_the_end(workspace, ran.package.folder)
