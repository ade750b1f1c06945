"""Runs on a bench that a run before left by force."""

from __future__ import annotations

import pytest
from workspaces import make

from hil.bench.lease import latch_bench
from hil.evidence.folder import GUARDIAN
from hil.executive.ending.acknowledging import acknowledge
from hil.executive.resuming.earlier import Earlier
from hil.guardian.latch import Latch
from hil.model.errors import Refused
from hil.plugin.running import resume

pytestmark = pytest.mark.system  # each test is a whole run

CASE = """
@pytest.mark.requirement("T-010")
def test_ratio(check, field):
    field.start()
    check("T-010", "ratio", 1.0)
"""


@pytest.fixture
def workspace(tmp_path, monkeypatch):
    """Return a workspace with a plan, on a machine without latches."""
    monkeypatch.setattr("hil.guardian.latch.PLACES", (tmp_path / "latches",))
    return make(tmp_path / "workspace", CASE)


def test_no_run_begins_on_a_latched_bench(workspace):
    """It leaves no folder, and the refusal names the run before; once that is acknowledged, it runs."""
    before = workspace.reports / "20261121T093100Z-adcs-x-cd60b0"
    latch = Latch(bench="adcs", run=str(before), why="the executive died", since="2026-11-21", outputs=())
    latch_bench([f"simulated bench {workspace.root / 'fixtures/benches/adcs'}"], latch)
    with pytest.raises(Refused, match="bench 'adcs' is latched since 2026-11-21.*cd60b0: the executive died"):
        workspace.run()
    assert workspace.folders() == []
    acknowledge(before, workspace.reports, by="Ada", text="all off")
    assert workspace.run().code == 0


def test_a_run_that_the_guardian_ended_is_not_resumed_before_somebody_looked(workspace):
    """Nothing of it is read again, and nothing changes."""
    ran = workspace.run()
    folder = ran.package.folder
    folder.chmod(0o755)
    (folder / "data").chmod(0o755)
    (folder / "bagit.txt").unlink()
    journal = folder / "data/journal.jsonl"
    journal.chmod(0o644)
    journal.write_bytes(b"".join(journal.read_bytes().splitlines(keepends=True)[:20]))
    (folder / GUARDIAN).write_text('{"event":"acting"}\n')

    def asked(_: Earlier):
        raise AssertionError("nobody asks what it was made of")

    with pytest.raises(Refused, match="the guardian ended this run, and that has not been acknowledged"):
        resume(folder, asked, None)
