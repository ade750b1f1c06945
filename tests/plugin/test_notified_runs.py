"""Runs of a workspace that notifies somebody."""

from __future__ import annotations

import pytest
from told_as_json import bodies, results_as_json
from workspaces import make

from hil.evidence.folder import JOURNAL
from hil.evidence.journal.reader import read_journal
from hil.executive.setup.workspace import find_workspace
from hil.model.errors import ConfigurationError

pytestmark = pytest.mark.system  # each test is a whole run

CASE = """
@pytest.mark.requirement("T-010")
def test_ratio(check, field):
    field.start()
    check("T-010", "ratio", 1.0)
"""


def test_equal_runs_that_notify_have_equal_digests(tmp_path):
    """How long a command took does not matter; that it failed is in journal and report, and changes no verdict."""
    workspace = make(tmp_path / "workspace", CASE)
    quiet = workspace.run()
    (workspace.root / "hil.toml").write_text('notify = ["/bin/cp", "/dev/stdin", "told.json"]\n')
    first, second = workspace.run(), workspace.run()
    (notified,) = bodies(first.package, "notified")
    assert '"event":"end"' in (workspace.root / "told.json").read_text()
    assert notified["event"] == "end"
    digests = {read_journal(ran.package.folder / JOURNAL).content_digest for ran in (first, second)}
    assert len(digests) == 1
    assert bodies(quiet.package, "notified") == ()
    (workspace.root / "hil.toml").write_text('notify = ["/nowhere/tell"]\n')
    failed = workspace.run()
    assert (failed.code, failed.verdicts()) == (0, {"test_ratio": "PASS"})
    assert bodies(failed.package, "notify-failed")[0]["reason"] == "No such file or directory"
    assert "notification failed" in failed.page()


def test_the_verdict_that_is_told_is_that_of_the_package(tmp_path):
    """A run that fails wakes its people with that word."""
    workspace = make(tmp_path / "workspace", CASE.replace("1.0)", "9.0)"))
    (workspace.root / "hil.toml").write_text('notify = ["/bin/cp", "/dev/stdin", "told.json"]\n')
    ran = workspace.run()
    assert (ran.code, results_as_json(ran.package)["verdict"]) == (1, "FAIL")
    assert '"text":"FAIL: not every case passed: of 1 case 1 FAIL"' in (workspace.root / "told.json").read_text()


@pytest.mark.parametrize("value", ['"tell"', "[1]", '[""]', '["a\\u0000"]'])
def test_a_command_is_a_list_of_texts(tmp_path, value):
    """Anything else is refused before a run."""
    (tmp_path / "hil.toml").write_text(f"notify = {value}\n")
    with pytest.raises(ConfigurationError, match="'notify' must be a list of texts"):
        find_workspace(tmp_path)
