"""Runs whose machine has no memory left at the end: a sentence, and nothing is lost."""

from __future__ import annotations

import io
from functools import partial

import pytest
import sweeps
from told_as_json import results_as_json
from workspaces import make

from hil.cli.main import main
from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
from hil.executive.resuming.preconditions import resumed_request
from hil.plugin.running import resume, run

pytestmark = pytest.mark.system  # each test is a whole run

CASE = """
    @pytest.mark.requirement("T-030")
    @pytest.mark.max_duration(60)
    def test_field(field, record):
        \"\"\"The field is recorded for a second.\"\"\"
        record("field", field, duration=1.0, rate=40.0)
    """


def without_memory(*_, **__):
    """Stand in for whatever needs memory."""
    raise MemoryError


def ended(workspace):
    """Return the exit code of a run, and its folder."""
    code = run(workspace.request(), io.StringIO())
    (folder,) = workspace.folders()
    return code, folder


@pytest.mark.parametrize("place", sweeps.sample(["convert", "results_of", "inventory"], 2))
def test_a_seal_without_memory_is_made_later(tmp_path, monkeypatch, capfd, place):
    """The run exits with 3 and says what to do; that leads to the verdict that it would have had."""
    workspace = make(tmp_path / "workspace", CASE)
    with monkeypatch.context() as short:
        short.setattr(f"hil.evidence.package.sealing.{place}", without_memory)
        code, folder = ended(workspace)
    said = capfd.readouterr().err
    assert code == 3
    assert "cannot be sealed: out of memory" in said
    assert "Traceback" not in said
    if "hil resume" in said:
        assert resume(folder, partial(resumed_request, start=workspace.root), io.StringIO()) == 0
    else:
        monkeypatch.chdir(workspace.root)
        with pytest.raises(SystemExit) as left:
            main(["seal", folder.name])
        assert left.value.code == 0
    assert verify(folder).findings == ()
    assert results_as_json(Package(folder))["verdict"] == "RECORDED"


def test_a_report_without_memory_is_written_later(tmp_path, monkeypatch, capfd):
    """The package is sealed all the same, and it is told how the report comes about."""
    workspace = make(tmp_path / "workspace", CASE)
    with monkeypatch.context() as short:
        short.setattr("hil.plugin.closing.write_reports", without_memory)
        code, folder = ended(workspace)
    said = capfd.readouterr().err
    assert code == 3
    assert "it is sealed, but not every report could be written: out of memory" in said
    assert "Traceback" not in said
    assert verify(folder).findings == ()


def test_a_package_that_cannot_be_looked_at_is_no_pass(tmp_path, monkeypatch, capfd):
    """Exit code 0 says that it was looked at once more."""
    workspace = make(tmp_path / "workspace", CASE)
    monkeypatch.setattr("hil.plugin.closing._findings", without_memory)
    code, folder = ended(workspace)
    assert code == 3
    assert "was not verified" in capfd.readouterr().err
    assert verify(folder).findings == ()


def test_a_command_without_memory_says_so(tmp_path, monkeypatch, capfd):
    """Any command: a sentence in the place of a traceback."""
    workspace = make(tmp_path / "workspace", CASE)
    monkeypatch.chdir(workspace.root)
    monkeypatch.setattr("hil.evidence.runs.find_runs", without_memory)
    with pytest.raises(SystemExit) as left:
        main(["runs"])
    assert left.value.code == 3
    assert capfd.readouterr().err.startswith("hil: out of memory\n")
