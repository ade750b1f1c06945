"""The replay of a run that was killed, and of packages whose files were damaged."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from workspaces import make

from hil.documents.canonical import canonical
from hil.evidence.folder import JOURNAL, RESULTS, TRANSCRIPT
from hil.evidence.package.contents import Package
from hil.model.errors import ConfigurationError
from hil.plugin.rehearsing import replay

pytestmark = pytest.mark.system  # each test is a whole run

REFERENCE = Path(__file__).parents[2] / "reports" / "reference"


@pytest.fixture
def copy(tmp_path):
    """Return a copy of the reference package that can be changed."""
    made = shutil.copytree(REFERENCE, tmp_path / "copy", copy_function=shutil.copyfile)
    for path in (made, *made.rglob("*")):
        path.chmod(0o755)
    return made


def test_a_killed_run_replays_without_a_difference(copy):
    """The cases that had ended are compared; where the record ends in the next one, nothing went otherwise."""
    for name in ("bagit.txt", RESULTS):
        (copy / name).unlink()
    lines = (copy / JOURNAL).read_bytes().splitlines(keepends=True)
    second = [place for place, line in enumerate(lines) if b'"kind":"case"' in line][1] + 8
    (copy / JOURNAL).write_bytes(b"".join(lines[:second]))
    end_ns = json.loads(lines[second - 1])["body"]["t"] * 1e9
    header, *operations = (copy / TRANSCRIPT).read_text().splitlines(keepends=True)
    before = [each for each in operations if int(each.split("\t")[4]) <= end_ns]
    assert len(before) < len(operations)
    (copy / TRANSCRIPT).write_text(header + "".join(before))
    found = replay(Package(copy))
    assert (found.cases, found.broken_off, found.never_ran) == (1, 1, 0)
    assert (found.differences, found.following) == ((), 0)


def test_a_damaged_bench_file_is_named_as_it_is_in_the_package(copy):
    """Nobody looks for it in the workspace around."""
    path = copy / "data/bench/bench.yaml"
    path.write_text(path.read_text().replace("\nenvelope:", "\nenvelpoe:"))
    with pytest.raises(ConfigurationError) as refused:
        replay(Package(copy))
    assert "data/bench/bench.yaml:118:1: unknown key 'envelpoe', did you mean 'envelope'?" in str(refused.value)
    assert {finding.path for finding in refused.value.findings} == {"data/bench/bench.yaml"}


def test_damaged_requirements_and_devices_are_named_as_they_are_in_the_package(copy):
    """Each from its place."""
    plan = next(path for path in (copy / "data/catalogue").iterdir() if path.is_dir())
    for path in (plan / "requirements.yaml", copy / "data/bench/duts.yaml"):
        path.write_text(path.read_text() + "\nmroe: 1\n")
    with pytest.raises(ConfigurationError) as refused:
        replay(Package(copy))
    named = {finding.path for finding in refused.value.findings}
    assert named == {f"data/catalogue/{plan.name}/requirements.yaml", "data/bench/duts.yaml"}


def test_every_damaged_line_of_a_transcript_is_named(copy):
    """Nothing is replayed from it, so that no difference follows from the damage."""
    lines = (copy / TRANSCRIPT).read_text().splitlines(keepends=True)
    lines[39] = "XX" + lines[39]
    lines[99] = lines[99].replace("\t", " ", 2)
    lines[149] = lines[149].replace("\t", "\tä", 1)
    (copy / TRANSCRIPT).write_text("".join(lines))
    with pytest.raises(ConfigurationError) as refused:
        replay(Package(copy))
    first, second, third = map(str, refused.value.findings)
    assert first.startswith("data/transcript.tsv:40:1: the line is damaged: field 'sequence' must be a whole number")
    assert second.startswith("data/transcript.tsv:100:1: the line is damaged: expected 8 fields (")
    assert third.startswith("data/transcript.tsv:150:1: the line is damaged: field 'device' must be ASCII, found ")


READ = """
@pytest.mark.requirement("T-050")
def test_one(check, supply):
    check("T-050", "voltage", supply.coil.voltage())
"""


def test_a_value_that_was_rewritten_is_not_what_the_bytes_give(tmp_path):
    """Attack: a check's value is another one, and whatever follows from it as well; the recorded bytes are not."""
    package = make(tmp_path / "workspace", READ).run().package
    path = package.folder / RESULTS
    path.chmod(0o644)
    results = json.loads(path.read_bytes())
    (check,) = results["cases"][0]["checks"]
    path.write_bytes(canonical({**results, "cases": [{**results["cases"][0], "checks": [{**check, "value": 4.5}]}]}))
    (told,) = replay(Package(package.folder)).differences
    assert "test_one: value of T-050 voltage was 4.5 in the record, " in told
    assert told.endswith(" replayed")
