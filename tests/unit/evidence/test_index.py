"""The index of runs: what did not change is not read again, and what changed is never shown as it was."""

from __future__ import annotations

import os
import shutil

import msgspec
import pytest
from evidence_runs import begin, sealed_run

from hil.evidence import runs
from hil.evidence.folder import JOURNAL, create, hold
from hil.evidence.index import Index
from hil.evidence.ledger.book import append, ledger_file
from hil.evidence.ledger.entries import Sealed
from hil.evidence.package.verification import State
from hil.evidence.runs import find_runs


@pytest.fixture
def reports(tmp_path):
    """Return a folder of reports with a sealed package and an interrupted run."""
    sealed_run(create(tmp_path / "reports", bench="flight", dut="SN1"))
    begin(tmp_path / "reports/interrupted").close()
    return tmp_path / "reports"


@pytest.fixture
def listed(tmp_path, reports, monkeypatch):
    """Return a function that lists the runs, and tells of which the content was read."""

    def ask(version="1"):
        read = []
        with monkeypatch.context() as patched:
            was = runs._whatever_it_is
            patched.setattr(
                runs, "_whatever_it_is", lambda folder, ledger: read.append(folder.name) or was(folder, ledger)
            )
            found = find_runs(reports, Index(tmp_path / "cache" / "index", version))
        return {run.folder.name: run for run in found}, read

    return ask


def package_of(reports):
    """Return the folder of the sealed package."""
    return next(
        path for path in reports.iterdir() if path.name.endswith(tuple("0123456789abcdef")) and "SN1" in path.name
    )


def test_what_did_not_change_is_not_read_again(listed):
    """It is told as it was, but for what changes with the clock; another version of the product reads it again."""
    first, read = listed()
    again, none = listed()
    assert (len(read), none) == (2, [])
    for name, run in first.items():
        for field in ("state", "checked", "plans", "bench", "dut", "source", "purpose", "planned", "ended", "verdict"):
            assert getattr(again[name], field) == getattr(run, field)
        assert again[name].deviates == run.deviates
    assert list(first) == list(again)
    assert len(listed(version="2")[1]) == 2


def test_a_byte_that_was_changed_and_set_back_in_time_is_read(listed, reports):
    """Of all of a file's properties only the time of its inode tells."""
    listed()
    file = package_of(reports) / JOURNAL
    was = file.stat()
    file.chmod(0o644)
    data = file.read_bytes()
    file.write_bytes(data.replace(b"PASS", b"FAIL", 1))
    os.utime(file, ns=(was.st_atime_ns, was.st_mtime_ns))
    found, read = listed()
    assert read == [package_of(reports).name]
    assert (found[read[0]].state, found[read[0]].verdict) == (State.DAMAGED, "")
    assert listed()[1] == read, "what is damaged is never kept"


def test_the_ledger_has_its_say_each_time(listed, reports):
    """Nothing in the package changed, and the ledger now has another digest of it: it is not shown as SEALED."""
    name = package_of(reports).name
    assert listed()[0][name].state is State.SEALED
    other = {"content": "0" * 64, "verdict": "PASS", "source": "hardware", "bench": "flight", "dut": "SN1"}
    append(reports, Sealed(run=name, evidence="1" * 64, **other))
    found, _ = listed()
    assert found[name].state is State.DAMAGED
    assert "ledger" in found[name].problem


def test_a_ledger_that_lost_its_head_is_noticed(listed, reports):
    """The head that the journal of a package names must stand in the ledger before its seal, also the second time."""
    second = create(reports, bench="flight", dut="SN2")
    sealed_run(second)
    assert listed()[0][second.name].state is State.SEALED
    file = ledger_file(reports)
    lines = file.read_bytes().splitlines(keepends=True)
    forged = lines[1].replace(b'"bench":"flight"', b'"bench":"fright"')
    file.write_bytes(b"".join((lines[0], forged, *lines[2:])))
    looked_at = {run.folder.name: run for run in find_runs(reports)}
    assert {name: run.state for name, run in listed()[0].items()} == {
        name: run.state for name, run in looked_at.items()
    }


def test_an_interrupted_run_that_goes_on_is_running(listed, reports):
    """Nothing was written yet, and its folder is held."""
    assert listed()[0]["interrupted"].state is State.INTERRUPTED
    with hold(reports / "interrupted"):
        assert listed()[0]["interrupted"].state is State.RUNNING
    assert listed()[0]["interrupted"].state is State.INTERRUPTED


def test_an_index_that_is_no_index_is_made_again(listed, tmp_path, reports):
    """It can be thrown away, cut or overwritten; runs that are gone leave it."""
    listed()
    file = tmp_path / "cache/index"
    for content in (b"", b"x", file.read_bytes()[:50], msgspec.msgpack.encode({"interrupted": 1})):
        file.write_bytes(content)
        assert len(listed()[1]) == 2
    shutil.rmtree(reports / "interrupted")
    listed()
    assert list(msgspec.msgpack.decode(file.read_bytes())) == [package_of(reports).name]
