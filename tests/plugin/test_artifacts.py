"""Whole runs whose cases keep files."""

from __future__ import annotations

import hashlib

from workspaces import agreed, make

CASE = '''
@pytest.mark.requirement("T-010")
def test_one(check, artifact):
    """The ratio is kept in a file, too."""
    artifact("ratio.json", '{"ratio": 1.0}')
    check("T-010", "ratio", 1.0)
'''


def test_a_file_of_a_case_is_sealed_with_its_evidence(tmp_path):
    """It lies in the package under its hash, and the report names it."""
    ran = make(tmp_path / "workspace", CASE).run()
    agreed(ran, {"test_one": "PASS"}, "PASS", 0)
    event = next(iter(ran.package.events("attachment")))
    data = (ran.package.folder / "data/attachments" / event["file"]).read_bytes()
    assert data == b'{"ratio": 1.0}'
    assert hashlib.sha256(data).hexdigest() == event["sha256"]
    assert event["file"] in ran.page()
