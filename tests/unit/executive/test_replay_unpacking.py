"""A package becomes a workspace again, in its own folder and nowhere else."""

from __future__ import annotations

import json
import shutil

import pytest
from told_as_json import results_as_json
from workspaces import ROOT

from hil.evidence.package.contents import Package
from hil.executive.resuming.replaying import unpack
from hil.model.errors import EvidenceError


@pytest.fixture
def copied(tmp_path):
    """Return a package that can be written to."""
    copy = tmp_path / "reports/copy"
    shutil.copytree(ROOT / "reports/reference", copy)
    for path in (copy, *copy.rglob("*")):
        path.chmod(0o755)
    return copy


@pytest.fixture
def root(tmp_path):
    """Return the folder of the workspace of a replay."""
    folder = tmp_path / "replay/workspace"
    folder.mkdir(parents=True)
    return folder


def refusal(copied, root):
    """Return why a package is not unpacked, and that nothing was written."""
    with pytest.raises(EvidenceError) as error:
        unpack(Package(copied), root)
    assert not any(root.iterdir())
    return str(error.value)


def test_a_package_is_laid_out_as_its_workspace_was(copied, root):
    """Folders of odd names stay what they are, and are no further settings."""
    place = copied / "data/place.json"
    odd = 'fix"\nnotify = ["x"]'
    place.write_text(json.dumps({"workspace": {"testplans": "testplans", "fixtures": odd}}))
    (copied / "data/registers/certificates").mkdir(parents=True)
    (copied / "data/registers/instruments.yaml").write_text("schema: hil/instruments/1\n")
    (copied / "data/registers/certificates/a.pdf").write_bytes(b"certificate")
    unpack(Package(copied), root)
    assert (root / odd / "duts.yaml").is_file()
    assert (root / odd / "instruments.yaml").is_file()
    assert (root / odd / "certificates/a.pdf").read_bytes() == b"certificate"
    assert (root / "testplans/jig/requirements.yaml").is_file()
    assert len((root / "hil.toml").read_text().splitlines()) == 2


@pytest.mark.parametrize("outside", ["../../elsewhere", "/elsewhere", "testplans/../.."])
@pytest.mark.parametrize("name", ["testplans", "fixtures"])
def test_no_package_writes_outside_of_the_workspace_of_its_replay(copied, root, name, outside):
    """Whoever made the package chose the names in it."""
    layout = {"testplans": "testplans", "fixtures": "fixtures", name: outside}
    (copied / "data/place.json").write_text(json.dumps({"workspace": layout}))
    assert "is outside of the workspace of its replay" in refusal(copied, root)


def test_no_bench_lies_outside_of_the_workspace_of_its_replay(copied, root):
    """The name of the bench is the journal's."""
    journal = copied / "data/journal.jsonl"
    journal.write_text(journal.read_text().replace('"bench":"adcs"', '"bench":"../../../../elsewhere"', 1))
    assert "'../../../../elsewhere' is outside" in refusal(copied, root)


@pytest.mark.parametrize("place", ["[]", "{}", '{"workspace": []}', '{"workspace": {"testplans": 1, "fixtures": "f"}}'])
def test_a_package_without_a_layout_is_refused(copied, root, place):
    """Whatever stands in the place of the layout."""
    (copied / "data/place.json").write_text(place)
    assert "place.json does not give the workspace's layout" in refusal(copied, root)


def test_a_package_without_a_run_is_refused(copied, root):
    """An empty journal is a sentence, and no error of the program."""
    (copied / "data/journal.jsonl").write_text("")
    assert "its journal does not say what was run" in refusal(copied, root)


def test_results_without_cases_are_none(copied):
    """What is no result is told wherever results are asked for."""
    (copied / "data/results.json").write_text('{"verdict": 1}')
    with pytest.raises(EvidenceError, match="not a results file"):
        results_as_json(Package(copied))
