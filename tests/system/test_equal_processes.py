"""The same run in two processes gives the same evidence."""

from __future__ import annotations

from pathlib import Path

import pytest
from magnetorquer_runs import rows, start_elsewhere, workspace
from told_as_json import bodies

from hil.evidence.package.contents import Package

pytestmark = [pytest.mark.system, pytest.mark.timeout(600)]


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """Two runs of the same plan and seed, at the same time, each in a workspace of its own."""
    roots = [workspace(tmp_path_factory.mktemp(name) / "workspace") for name in ("first", "second")]
    running = [(root, start_elsewhere(root)) for root in roots]
    ended = [(root, process.communicate()[0], process.returncode) for root, process in running]
    assert [code for _, _, code in ended] == [0, 0], ended[0][1]
    return [Package(root / Path(output.splitlines()[-1])) for root, output, _ in ended]


def test_the_content_digest_repeats(packages):
    """Journal bodies are the same, one by one; only wall time, host and paths differ."""
    first, second = packages
    for here, there in zip(bodies(first), bodies(second), strict=True):
        assert here == there
    assert first.content_digest == second.content_digest
    assert first.evidence_digest != second.evidence_digest


def test_the_recordings_repeat(packages):
    """All rows of all recordings are the same, the envelope's included."""
    first, second = packages
    for of_cases in (True, False):
        assert rows(first, of_cases=of_cases) == rows(second, of_cases=of_cases)
    assert len(rows(first, of_cases=True)) == 216


def test_results_and_transcript_repeat(packages):
    """The derived results and every byte on every wire are the same files."""
    first, second = packages
    for name in ("data/results.json", "data/transcript.tsv"):
        assert (first.folder / name).read_bytes() == (second.folder / name).read_bytes()
