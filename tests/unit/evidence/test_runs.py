"""Runs at a glance, and a package read."""

from __future__ import annotations

import os

import pytest
from evidence_runs import begin, record, sealed_run, whole_case
from told_as_json import bodies, results_as_json
from typed_events import event_of

from hil.evidence.folder import create, hold
from hil.evidence.package.contents import Package
from hil.evidence.package.verification import State, in_short
from hil.evidence.runs import find_runs, run_folders, status
from hil.model.errors import EvidenceError


def test_runs_are_found_oldest_first(tmp_path):
    """Folders without a journal are no runs, and no folder at all is no error."""
    assert find_runs(tmp_path / "missing") == []
    (tmp_path / ".ledger").mkdir()
    for name in ("20260102T000000Z-b-d-000000", "20260101T000000Z-b-d-ffffff"):
        begin(tmp_path / name).close()
    assert [run.folder.name[:8] for run in find_runs(tmp_path)] == ["20260101", "20260102"]


def test_a_run_tells_where_it_is(tmp_path):
    """Plan, device, progress, case and step are those of the newest events."""
    with hold(tmp_path), begin(tmp_path) as journal:
        journal.write(event_of("case", case="test_rest", attempt=1), 0.0)
        journal.write(event_of("step", case="test_rest", path=["Outer"], number="1"), 0.0)
        journal.write(event_of("step", case="test_rest", path=["Outer", "Inner"], number="1.1"), 7.0)
        run = status(tmp_path)
        assert (run.state, run.plans, run.bench, run.dut) == (State.RUNNING, ("gyro",), "flight", "SN1")
        assert (run.planned, run.ended, run.case, run.step, run.t) == (1, 0, "test_rest", "1.1 Inner", 7.0)
        journal.write(
            event_of("step-end", case="test_rest", path=["Outer", "Inner"], number="1.1", outcome="done", duration=1),
            8.0,
        )
        assert status(tmp_path).step == "1 Outer"
    assert status(tmp_path).state is State.INTERRUPTED


def test_a_run_tells_what_people_added(tmp_path):
    """Notes, attachments and anomalies are there in order, to acknowledge them."""
    with begin(tmp_path) as journal:
        journal.write(event_of("note", text="door opened", by="Ada"), 1.0)
        journal.write(event_of("attachment", file="1-photo.jpg", sha256="0" * 64, by="Ada", text="jig"), 2.0)
    assert [(event.kind(), event.text) for event in status(tmp_path).added] == [
        ("note", "door opened"),
        ("attachment", "jig"),
    ]


def test_a_stopped_run_tells_who_asked_until_it_goes_on(tmp_path):
    """A run that was left to be resumed looks interrupted; nobody has to read its journal to learn by whom."""
    with begin(tmp_path) as journal:
        assert status(tmp_path).stopped == ""
        journal.write(event_of("stop", reason="Ada: smell", urgent=False, resumable=True), 1.0)
        assert status(tmp_path).stopped == "Ada: smell"
        journal.write(event_of("gate", name="identity of psu1", ok=True, detail=""), 1.0)
        assert status(tmp_path).stopped == ""


def test_a_sealed_run_tells_its_verdict(tmp_path):
    """Nothing goes on in it any more."""
    folder = create(tmp_path, bench="b", dut="d")
    sealed_run(folder)
    run = status(folder)
    assert (run.state, run.verdict, run.case, run.step, run.ended) == (State.SEALED, "PASS", "", "", 1)


def test_a_folder_that_cannot_be_understood_is_damaged(tmp_path):
    """One bad folder does not hide the others."""
    begin(tmp_path / "a").close()
    for name, line in (
        ("b", b'{"body":{"kind":"case","seq":0,"t":0},"prev":"%b","wall":{}}\n' % (b"0" * 64)),
        ("c", b"\xff\n"),
        ("d", b"[" * 100_000 + b"\n"),
    ):
        (tmp_path / name / "data").mkdir(parents=True)
        (tmp_path / name / "data/journal.jsonl").write_bytes(line)
    for name in ("e", "20261120T100000Z-x-y-012345"):
        (tmp_path / name / "data/journal.jsonl").mkdir(parents=True)
    (tmp_path / "f/data").mkdir(parents=True)
    os.mkfifo(tmp_path / "f/data/journal.jsonl")
    found = {run.folder.name: run for run in find_runs(tmp_path)}
    assert found.pop("a").state is State.INTERRUPTED
    assert {run.state for run in found.values()} == {State.DAMAGED}
    assert len(found) == 6
    assert all(run.problem for run in found.values())


def test_the_newest_run_is_the_last_by_its_first_event(tmp_path):
    """A run that was renamed stands where its time is; one without an event goes by its name."""
    for name, moment in (("z-renamed", "2026-11-20T09:00:00.000000Z"), ("20261121T100000Z-b-d-aaaaaa", None)):
        (tmp_path / name / "data").mkdir(parents=True)
        if moment:
            line = b'{"body":{"kind":"run","seq":0,"t":0},"prev":"%b","wall":{"utc":"%b"}}\n'
            (tmp_path / name / "data/journal.jsonl").write_bytes(line % (b"0" * 64, moment.encode()))
    begin(tmp_path / "a").close()
    assert [folder.name for folder in run_folders(tmp_path)] == ["z-renamed", "a", "20261121T100000Z-b-d-aaaaaa"]
    assert run_folders(tmp_path / "nowhere") == []


def test_folders_of_other_things_are_no_runs(tmp_path):
    """The ledger, and what somebody put beside the runs, are not listed."""
    for name in (".ledger/data", "photos"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "data").write_text("x")
    assert find_runs(tmp_path) == []


def test_a_package_reads_a_run_that_goes_on(tmp_path):
    """Events, recordings and results so far are there before the seal."""
    with begin(tmp_path) as journal:
        record(tmp_path, journal, 5)
        package = Package(tmp_path)
        assert not package.sealed
        assert [event["kind"] for event in bodies(package, "gate", "armed")] == ["gate", "gate", "armed"]
        assert len(package.recording("001-rest")) == 5
        assert results_as_json(package)["verdict"] == "ERROR"
        assert package.calibration()["psu1"].due == "2026-12-31"
        assert package.transcript_path == tmp_path / "data/transcript.tsv"


def test_a_package_gives_nothing_from_outside(tmp_path):
    """Paths that lead out, recordings that are not there, and texts that are none are errors in words."""
    begin(tmp_path / "run").close()
    (tmp_path / "secret").write_text("x")
    package = Package(tmp_path / "run")
    (tmp_path / "run/data/binary").write_bytes(b"\xff")
    for path in ("../secret", "/etc/passwd"):
        with pytest.raises(EvidenceError, match="outside"):
            package.text(path)
    with pytest.raises(EvidenceError, match="binary"):
        package.text("data/binary")
    with pytest.raises(EvidenceError, match="it has none"):
        package.recording("009")
    assert package.json("data/catalogue/catalogue.json")["format"] == 1


def test_a_running_package_is_read_as_it_was_when_asked(tmp_path):
    """One package object is one look at the journal."""
    with begin(tmp_path) as journal:
        package = Package(tmp_path)
        before = len(bodies(package))
        whole_case(tmp_path, journal)
        assert len(bodies(package)) == before < len(bodies(Package(tmp_path)))


@pytest.mark.parametrize(
    ("count", "said"), [(0, ""), (1, "one"), (2, "one (and 1 more problem)"), (3, "one (and 2 more problems)")]
)
def test_findings_in_short_are_the_first_and_a_count(count, said):
    """The count is not taken for a part of the first one's sentence."""
    assert in_short(["one", "two", "three"][:count]) == said
