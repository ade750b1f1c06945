"""A quick look at sealed packages: no damage that it can see is called SEALED, and none is given a verdict."""

from __future__ import annotations

import json
import shutil

import pytest
from evidence_runs import begin, sealed_run, writable_copy, write_report

from hil.documents.canonical import canonical
from hil.evidence import runs
from hil.evidence.folder import JOURNAL, create, hold
from hil.evidence.index import Index
from hil.evidence.journal.reader import read_ends, read_journal
from hil.evidence.package.bag import write_manifests
from hil.evidence.package.look import LOOKED_AT, look
from hil.evidence.package.sealing import recover
from hil.evidence.package.verification import State, verify
from hil.evidence.runs import find_runs, status
from hil.model.errors import EvidenceError

RESULTS = "data/results.json"
RECORDING = "data/recordings/001-rest.h5"


@pytest.fixture(scope="module")
def sealed(tmp_path_factory):
    """The folder of a sealed run, which nobody changes."""
    folder = create(tmp_path_factory.mktemp("sealed"), bench="flight", dut="SN1")
    sealed_run(folder)
    return folder


@pytest.fixture
def package(tmp_path, sealed):
    """Return a sealed package that may be changed."""
    return writable_copy(sealed, tmp_path / "reports")


def rebag(folder):
    """Write manifests that fit what is in the folder now, as a forger would."""
    write_manifests(folder, (folder / "bag-info.txt").read_bytes())


def flip(path):
    """Change one bit in the middle of a file."""
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def without(name):
    """Return what takes a file away."""
    return lambda folder: (folder / name).unlink()


def emptied(name):
    """Return what leaves nothing in a file."""
    return lambda folder: (folder / name).write_bytes(b"")


def halved(name):
    """Return what cuts a file in its middle."""
    return lambda folder: (folder / name).write_bytes(
        (folder / name).read_bytes()[: (folder / name).stat().st_size // 2]
    )


def flipped(name):
    """Return what changes one bit of a file."""
    return lambda folder: flip(folder / name)


def forged(folder):
    """Write a better verdict into the results, and manifests that fit."""
    found = json.loads((folder / RESULTS).read_bytes())
    (folder / RESULTS).write_bytes(canonical({**found, "verdict": "RECORDED"}))
    rebag(folder)


def ended_twice(folder):
    """Give the journal its last line twice, and manifests that fit."""
    data = (folder / JOURNAL).read_bytes()
    (folder / JOURNAL).write_bytes(data + data.splitlines(keepends=True)[-1])
    rebag(folder)


SEEN = {
    "no journal": (without(JOURNAL), "journal.jsonl"),
    "empty journal": (emptied(JOURNAL), "journal.jsonl"),
    "cut journal": (halved(JOURNAL), "journal.jsonl"),
    "changed journal": (flipped(JOURNAL), "journal.jsonl"),
    "journal that ends twice": (ended_twice, "results and end last, each once"),
    "no manifest": (without("manifest-sha256.txt"), "manifest-sha256.txt: this file is missing"),
    "changed manifest": (flipped("manifest-sha256.txt"), "manifest-sha256.txt"),
    "no tag manifest": (without("tagmanifest-sha256.txt"), "tagmanifest-sha256.txt: this file is missing"),
    "changed description": (flipped("bag-info.txt"), "bag-info.txt"),
    "no results": (without(RESULTS), "results.json"),
    "changed results": (flipped(RESULTS), "results.json"),
    "forged results": (forged, "results.json: it is not the file that the journal"),
    "empty seal": (emptied("bagit.txt"), "bagit.txt"),
    "changed catalogue": (flipped("data/catalogue/catalogue.json"), "catalogue.json"),
    "no recording": (without(RECORDING), "001-rest.h5"),
    "cut recording": (halved(RECORDING), "field 'Payload-Oxum' is not the size and number of the files"),
    "stray file": (lambda folder: (folder / "data/stray").write_text("x"), "data/stray"),
    "link": (lambda folder: (folder / "data/link").symlink_to("/etc/hostname"), "data/link"),
}


@pytest.mark.parametrize("name", SEEN)
def test_damage_that_a_quick_look_sees_has_no_verdict(package, name):
    """List, status and verification agree: it is DAMAGED, a finding says by what, and nothing else is told."""
    damage, found = SEEN[name]
    find_runs(package.parent, Index(package.parent / ".index", "1"))
    damage(package)
    for run in (*find_runs(package.parent, Index(package.parent / ".index", "1")), status(package)):
        assert (run.state, run.verdict, run.planned, run.checked) == (State.DAMAGED, "", 0, "")
        assert run.problem
    assert any(found in str(finding) for finding in look(package).findings)
    assert verify(package).state is State.DAMAGED
    assert str(package) not in "".join(map(str, (*look(package).findings, *verify(package).findings)))


def test_a_quick_look_says_what_it_believes(package):
    """A changed byte in a recording is found by status, which verifies; a list does not claim to have read it."""
    flip(package / RECORDING)
    (listed,) = find_runs(package.parent)
    assert (listed.state, listed.verdict, listed.checked) == (State.SEALED, "PASS", LOOKED_AT)
    assert "recording" not in LOOKED_AT
    run = status(package)
    assert (run.state, run.verdict) == (State.DAMAGED, "")
    assert "001-rest.h5" in run.problem


def test_the_status_of_a_large_package_says_what_was_not_read(package, monkeypatch):
    """What takes long is left to verification, by name."""
    assert status(package).checked == "everything, as hil verify does"
    monkeypatch.setattr(runs, "_VERIFIED_BYTES", 10)
    assert status(package).checked.startswith(f"{LOOKED_AT}; not the recordings (0.0 GB)")
    flip(package / RECORDING)
    assert status(package).state is State.SEALED


def test_a_list_tells_of_a_package_what_its_journal_tells(package):
    """The short way by the results says the same as the long one by every event."""
    (listed,) = find_runs(package.parent)
    long = status(package)
    for field in ("plans", "bench", "dut", "source", "purpose", "planned", "ended", "t", "verdict", "deviates"):
        assert getattr(listed, field) == getattr(long, field)


def test_a_format_of_the_future_is_unknown_and_has_no_verdict(tmp_path):
    """It is neither whole nor damaged in a list either."""
    folder = create(tmp_path, bench="b", dut="d")
    sealed_run(folder, format=2)
    for run in (*find_runs(tmp_path), status(folder)):
        assert (run.state, run.verdict) == (State.UNKNOWN, "")
        assert "format 2" in run.problem


def test_a_package_whose_seal_was_not_copied_is_not_sealed_again(package):
    """A copy that is not complete looks like a run before its seal: what is missing is told, and nothing is sealed."""
    (package / "bagit.txt").unlink()
    (listed,) = find_runs(package.parent)
    assert (listed.state, listed.verdict) == (State.INTERRUPTED, "")
    assert "its seal is missing" in listed.problem
    assert "its seal is missing" in str(verify(package).findings[0])
    copy = shutil.copytree(package, package.parent / "copy")
    flip(copy / RECORDING)
    assert verify(copy).state is State.DAMAGED
    (copy / RECORDING).unlink()
    assert verify(copy).state is State.DAMAGED
    assert {run.folder.name: run.state for run in find_runs(package.parent)}["copy"] is State.DAMAGED
    with pytest.raises(EvidenceError, match=r"001-rest\.h5: the journal names it, and it is missing"):
        recover(copy, write_reports=write_report)
    recover(package, write_reports=write_report)
    assert verify(package).ok


def test_a_run_that_is_about_to_begin_is_running(tmp_path):
    """Its folder is there and held before the first event."""
    folder = create(tmp_path, bench="b", dut="d")
    with hold(folder):
        assert [run.state for run in find_runs(tmp_path)] == [State.RUNNING]


@pytest.mark.parametrize("lines", [0, 1, 2, 3, 4, 9])
def test_the_ends_of_a_journal_are_those_of_the_whole(tmp_path, lines):
    """Two lines from each end, none twice, in one piece or in several; half a line at the end is none."""
    begin(tmp_path).close()
    path = tmp_path / JOURNAL
    data = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join((data * 3)[:lines]))
    whole = path.read_bytes()
    events = read_journal(path).events
    found = read_ends(path)
    due = (*events[:2], *events[2:][-2:])
    assert (found.events, found.torn) == (due, b"")
    path.write_bytes(whole + b"half")
    assert (read_ends(path).events, bool(read_ends(path).torn)) == (due, True)


def test_the_ends_of_a_journal_with_long_lines_are_whole(package, monkeypatch):
    """The last line names every file, and may be longer than a piece that is read at a time."""
    monkeypatch.setattr("hil.evidence.journal.reader._PIECE", 7)
    whole = read_journal(package / JOURNAL)
    ends = read_ends(package / JOURNAL)
    assert [line.raw for line in ends.lines] == [line.raw for line in (*whole.lines[:2], *whole.lines[-2:])]
    assert [line.number for line in ends.lines] == [1, 2, len(whole.lines) - 1, len(whole.lines)]
