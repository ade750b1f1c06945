"""Whole runs whose cases keep files."""

from __future__ import annotations

import hashlib

import pytest
from told_as_json import bodies
from workspaces import agreed, make

from hil.plugin.rehearsing import replay

pytestmark = pytest.mark.system  # each test is a whole run

CASE = '''
@pytest.mark.requirement("T-010")
def test_one(check, artifact):
    """The ratio is kept in a file, too."""
    artifact("ratio.json", '{"ratio": 1.0}')
    check("T-010", "ratio", 1.0)
'''
CHANGING = '''
import os

@pytest.mark.requirement("T-010")
def test_one(check, artifact, supply):
    """What is kept is not the same another time."""
    artifact("word.txt", os.environ["HIL_TEST_WORD"])
    supply.coil.configure(1.0, 0.02)
    check("T-010", "ratio", 1.0)

@pytest.mark.requirement("T-010")
def test_two(check, supply):
    """It drives, too."""
    supply.coil.configure(1.0, 0.02)
    check("T-010", "ratio", 1.0)
'''


def test_a_file_of_a_case_is_sealed_with_its_evidence(tmp_path):
    """It lies in the package under its hash, and the report names it."""
    ran = make(tmp_path / "workspace", CASE).run()
    agreed(ran, {"test_one": "PASS"}, "PASS", 0)
    event = next(iter(bodies(ran.package, "attachment")))
    data = (ran.package.folder / "data/attachments" / event["file"]).read_bytes()
    assert data == b'{"ratio": 1.0}'
    assert hashlib.sha256(data).hexdigest() == event["sha256"]
    assert event["file"] in ran.page()


def test_a_file_that_comes_out_otherwise_is_told_once(tmp_path, monkeypatch):
    """The replay names the file and both hashes; what follows because the record was left is counted only."""
    monkeypatch.setenv("HIL_TEST_WORD", "one")
    package = make(tmp_path / "workspace", CHANGING).run().package
    assert replay(package).differences == ()
    monkeypatch.setenv("HIL_TEST_WORD", "other")
    found = replay(package)
    (cause,) = found.differences
    assert "test_one: Diverged: " in cause
    assert cause.count("artifact.word.txt (no. 1) with {'bytes': ") == 2
    assert found.following > 2
