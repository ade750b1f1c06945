"""What it costs to audit a workspace for the first time, and again without a change; audit_speed.py has a large one."""

from __future__ import annotations

from itertools import count

import pytest
from large_catalogue import make_workspace

from hil.audit.cache import Cache
from hil.audit.engine import audit
from hil.audit.reading import Folders, read_world

REQUIREMENTS = 500


@pytest.fixture(scope="module")
def audited(tmp_path_factory):
    """Return a function that audits 500 requirements with 1,500 results, given the folder of a cache."""
    root = tmp_path_factory.mktemp("workspace") / "large"
    make_workspace(root, REQUIREMENTS)
    folders = Folders(
        root=root, testplans=root / "testplans", fixtures=root / "fixtures", reports=root / "reports", name="large"
    )
    return lambda place: audit(read_world(folders, Cache(place, "1"), version="1"))


def test_the_first_audit(cost, audited, tmp_path):
    """Every package is verified; only the plans' files, which all of them hold, are read once for all rounds."""
    places = (tmp_path / str(number) for number in count())
    document = cost("audit for the first time, a requirement", lambda: audited(next(places)), units=REQUIREMENTS)
    assert document.summary.requirements == REQUIREMENTS


def test_the_same_audit_again(cost, audited, tmp_path):
    """Files that did not change are not read again, and the document is the same."""
    first = audited(tmp_path)
    assert cost("audit again without a change, a requirement", lambda: audited(tmp_path), units=REQUIREMENTS) == first
