"""What it costs to list many runs again that did not change, against the first look at them."""

from __future__ import annotations

import pytest
import sweeps
from many_runs import make_runs

from hil.evidence.index import Index
from hil.evidence.runs import find_runs

_RUNS = sweeps.chosen(250, 1000)


@pytest.mark.timeout(600)
def test_a_list_of_many_runs(tmp_path, pair):
    """By the index and by looking at each; both tell the same."""
    reports = tmp_path / "reports"
    make_runs(reports, _RUNS)
    known = [find_runs(reports, Index(tmp_path / "index", "1")) for _ in range(2)]
    assert [[(run.folder, run.state, run.verdict) for run in runs] for runs in known] == [
        [(run.folder, run.state, run.verdict) for run in find_runs(reports)]
    ] * 2
    pair(
        f"one run in a list of {_RUNS}, by the index / looked at",
        lambda: find_runs(reports, Index(tmp_path / "index", "1")),
        lambda: find_runs(reports),
        units=_RUNS,
        rounds=3,
    )
