"""A package that was rewritten as a whole: nothing inside shows it, the ledger does."""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path

import pytest
from evidence_runs import DUT, OF_ALL_RUNS, begin, sealed_run, write_report

from hil.evidence.ledger.book import LEDGER, append, head, ledger_file, read
from hil.evidence.ledger.entries import Sealed
from hil.evidence.package.sealing import recover
from hil.evidence.package.verification import State, verify
from hil.evidence.runs import find_runs, status
from hil.model.errors import EvidenceError
from hil.report.write import HTML, make_reports

NAME = "20261121T093100Z-flight-SN1-ab12cd"


@pytest.fixture
def package(tmp_path):
    """Return a sealed package in a folder of reports."""
    sealed_run(tmp_path / "reports" / NAME, source="simulated")
    return tmp_path / "reports" / NAME


def remove(folder):
    """Remove a package, which is read-only."""
    for path in (folder, *folder.rglob("*")):
        if path.is_dir():
            path.chmod(0o755)
    shutil.rmtree(folder)


def rewrite(package, elsewhere, **changes):
    """Put another package in the place of one, whole in itself, as somebody does who rewrites all that speaks of it."""
    sealed_run(elsewhere / package.name, **changes)
    remove(package)
    shutil.copytree(elsewhere / package.name, package)


def test_a_seal_is_entered_with_what_it_names(package):
    """Once; and the package names the head that the ledger had before."""
    (entry,) = read(package.parent).of(Sealed)
    found = verify(package)
    assert (entry.run, entry.evidence, entry.content) == (NAME, found.evidence_digest, found.content_digest)
    assert (entry.verdict, entry.source, entry.bench, entry.dut) == (found.verdict, "simulated", "flight", "SN1")
    assert found.ledger == f"line 2, sealed {entry.utc}"
    assert found.ok
    recover(package, write_reports=write_report)
    assert len(read(package.parent).of(Sealed)) == 1


@pytest.mark.parametrize(
    ("changes", "files"),
    [
        ({"source": "hardware"}, {}),
        ({"operator": "Eve"}, {}),
        ({"dut": DUT | {"serial": "SN2"}}, {"data/dut.json": b"SN1", "data/bench/duts.yaml": b"SN1"}),
        ({}, {"data/sources/testplans/gyro/test_rest.py": b"..."}),
    ],
)
def test_a_package_that_was_rewritten_as_a_whole_is_damaged(package, tmp_path, monkeypatch, changes, files):
    """Simulated turned into hardware, other serial numbers or sources: verification by its own bytes cannot see it."""
    for path, old in files.items():
        monkeypatch.setitem(OF_ALL_RUNS, path, OF_ALL_RUNS[path].replace(old, b"SN2"))
    rewrite(package, tmp_path / "elsewhere", **{"source": "simulated", **changes})
    shutil.copytree(package, tmp_path / "alone" / NAME)
    assert verify(tmp_path / "alone" / NAME).findings == ()
    found = verify(package)
    assert found.state is State.DAMAGED
    (entry,) = read(package.parent).of(Sealed)
    day = entry.utc[:10]
    assert str(found.findings[0]) == (
        f"manifest-sha256.txt: rewritten after its seal on {day}: ledger line 2 has another evidence digest"
    )
    assert (found.evidence_digest, found.verdict) == ("", "")
    (listed,) = find_runs(package.parent)
    assert (listed.state, listed.verdict) == (State.DAMAGED, "")
    assert status(package).state is State.DAMAGED
    with pytest.raises(EvidenceError, match="was sealed .* with another digest"):
        recover(package, write_reports=write_report)


def test_a_run_that_the_ledger_sealed_twice_is_damaged(package):
    """Whichever of the two it is now: one of them was rewritten."""
    (entry,) = read(package.parent).of(Sealed)
    append(package.parent, Sealed(**{name: getattr(entry, name) for name in _FACTS} | {"evidence": "0" * 64}))
    assert "the ledger names this run with another evidence digest as well, in line 3" in verify(package).problem


_FACTS = ("run", "evidence", "content", "verdict", "source", "bench", "dut")


def test_a_package_under_another_name_is_told_or_damaged(package, tmp_path):
    """A copy elsewhere is unknown, and whole; in the place of another package it is not that package."""
    shutil.copytree(package, tmp_path / "copies" / NAME)
    copied = verify(tmp_path / "copies" / NAME)
    assert (copied.ok, copied.ledger) == (True, "")
    second = package.with_name("20261122T093100Z-flight-SN1-ff12cd")
    sealed_run(second)
    remove(second)
    shutil.copytree(package, second)
    assert f"the folder has the name of another package, of ledger line 3: this one is {NAME}" in verify(second).problem


def test_a_package_that_the_ledger_does_not_have_is_told(package, tmp_path):
    """Packages are copied to others; but one that names a head of this ledger was entered once."""
    sealed_run(tmp_path / "other" / "20261122T093100Z-flight-SN1-ff12cd")
    stranger = package.with_name("20261122T093100Z-flight-SN1-ff12cd")
    shutil.copytree(tmp_path / "other" / stranger.name, stranger)
    found = verify(stranger)
    assert (found.ok, found.ledger) == (True, "not in the ledger of this folder: a copy, or sealed elsewhere")
    last = package.with_name("20261123T093100Z-flight-SN1-ee12cd")
    sealed_run(last)
    lines = ledger_file(package.parent).read_bytes().splitlines(keepends=True)
    ledger_file(package.parent).write_bytes(b"".join(lines[:-1]))
    assert "its journal names the head of line 2: the ledger was cut off after that" in verify(last).ledger


def test_a_ledger_that_was_begun_again_does_not_confirm_a_package(package):
    """The package names a head that this ledger never had."""
    second = package.with_name("20261122T093100Z-flight-SN1-ff12cd")
    sealed_run(second)
    (_, entry) = read(package.parent).of(Sealed)
    shutil.rmtree(package.parent / LEDGER)
    append(package.parent, Sealed(**{name: getattr(entry, name) for name in _FACTS}))
    assert "which the ledger never had" in verify(second).problem


def test_a_damaged_ledger_is_no_witness(package):
    """Where the entry of the package was, nothing can be said; where it stands, it counts."""
    good = ledger_file(package.parent).read_bytes()
    ledger_file(package.parent).write_bytes(good.replace(b'"verdict":"', b'"verdict":"X'))
    found = verify(package)
    assert (found.state, found.ok) == (State.SEALED, False)
    assert found.ledger.startswith("DAMAGED, and has no entry of this package: .ledger/ledger.jsonl:2:1: ")
    ledger_file(package.parent).write_bytes(b"x\n" + good)
    assert verify(package).ledger.startswith("line ")


def test_a_seal_that_was_interrupted_after_its_entry_is_finished_as_it_was_entered(tmp_path, monkeypatch):
    """The process was killed between the entry and the seal."""
    folder = tmp_path / "reports" / NAME
    with begin(folder):
        pass

    def killed(_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("hil.evidence.package.sealing.put_seal", killed)
        with pytest.raises(KeyboardInterrupt):
            recover(folder, write_reports=write_report)
    (entry,) = read(folder.parent).of(Sealed)
    assert recover(folder, write_reports=write_report) == entry.evidence
    assert read(folder.parent).of(Sealed) == (entry,)
    assert verify(folder).ledger == f"line 2, sealed {entry.utc}"


def test_a_report_names_the_head_before_its_seal(tmp_path):
    """So that every report that was handed out is a witness of the ledger."""
    before = tmp_path / "reports" / NAME
    sealed_run(before)
    head_before = head(before.parent)
    second = before.with_name("20261122T093100Z-flight-SN1-ff12cd")
    sealed_run(second)
    assert f'<dd class="mono">{head_before}</dd>' in make_reports(second)[HTML].decode()
    assert "Head of the ledger" not in make_reports(before)[HTML].decode()


def test_a_seal_does_not_wait_for_the_ledger(tmp_path):
    """It is told that the entry is missing, and sealing again enters it."""
    reports = tmp_path / "reports"
    reports.mkdir()
    (reports / LEDGER).write_text("a file in its place")
    folder = reports / NAME
    with begin(folder):
        pass
    with pytest.raises(EvidenceError, match="it is sealed, but not entered in the ledger: .* cannot be written"):
        recover(folder, write_reports=write_report)
    (reports / LEDGER).unlink()
    assert verify(folder).state is State.SEALED
    assert recover(folder, write_reports=write_report) == verify(folder).evidence_digest
    assert verify(folder).ledger.startswith("line 2, ")


@pytest.mark.parametrize("entered", [True, False], ids=["entered", "missing"])
def test_a_run_that_is_sealed_already_needs_no_right_to_write(tmp_path, monkeypatch, entered):
    """Only where the line of its seal is missing, that is said, and why it cannot be written."""
    folder = tmp_path / NAME
    with begin(folder):
        pass
    digest = recover(folder, write_reports=write_report)
    if not entered:
        shutil.rmtree(tmp_path / LEDGER)

    def refuse(*_, **__):
        raise OSError(errno.EROFS, "Read-only file system")

    def opened(path, flags, *mode, **where):
        return refuse() if flags & os.O_RDWR else whole(path, flags, *mode, **where)

    whole = os.open
    monkeypatch.setattr(Path, "chmod", refuse)
    monkeypatch.setattr(os, "open", opened)
    if entered:
        assert recover(folder, write_reports=write_report) == digest
        return
    with pytest.raises(EvidenceError) as told:
        recover(folder, write_reports=write_report)
    assert told.value.message.startswith(
        f"{NAME}: it is sealed already, and only the line of its seal is missing from the ledger: {tmp_path}"
    )
    assert told.value.message.endswith("the ledger cannot be written: Read-only file system")
    assert told.value.hint == f"make it writable; hil seal {NAME} enters it"
