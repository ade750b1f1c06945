"""Packages as the audit reads them: what was changed or cut is not believed."""

from __future__ import annotations

import pytest
from evidence_runs import SOFTWARE, begin, sealed_run, whole_case, write_report
from typed_events import event_of

from hil.audit.cache import Cache
from hil.audit.packages import read_packages
from hil.audit.reading import Folders, read_world
from hil.documents.canonical import canonical
from hil.evidence.folder import JOURNAL, RESULTS, TRANSCRIPT
from hil.evidence.journal.writer import Journal
from hil.evidence.ledger.book import append, head, ledger_file
from hil.evidence.ledger.entries import Head
from hil.evidence.package.sealing import seal

RUN = "20261121T093100Z-flight-SN1-ab12cd"


def test_results_that_are_not_those_of_the_manifest_are_not_believed(tmp_path):
    """A FAIL is cut out of the results, and the manifest left as it is: the package no longer stands for its seal."""
    folder = tmp_path / RUN
    sealed_run(folder)
    (whole,) = read_packages(tmp_path, Cache(None, ""))
    assert whole.named == whole.digest
    results = folder / RESULTS
    results.chmod(0o644)
    results.parent.chmod(0o755)
    results.write_bytes(results.read_bytes().replace(b"GYR-030", b"GYR-999"))
    (changed,) = read_packages(tmp_path, Cache(None, ""))
    assert (changed.sealed, changed.named) == (False, "")


def test_damage_elsewhere_leaves_the_results_as_they_were_sealed(tmp_path):
    """A damaged raw file: the results are still those that the manifest lists."""
    folder = tmp_path / RUN
    sealed_run(folder)
    (whole,) = read_packages(tmp_path, Cache(None, ""))
    transcript = folder / TRANSCRIPT
    transcript.chmod(0o644)
    transcript.write_bytes(transcript.read_bytes() + b"x")
    (changed,) = read_packages(tmp_path, Cache(None, ""))
    assert (changed.sealed, changed.named) == (False, whole.digest)


def test_a_ledger_that_was_cut_back_is_found_by_its_published_head(tmp_path):
    """The package of a FAIL is deleted, and the ledger cut back to before its seal; so is a ledger that was deleted."""
    (tmp_path / "testplans").mkdir()
    append(tmp_path, Head(run=RUN, events=3, sha256="0" * 64, state="RUNNING", source="hardware"))
    append(tmp_path, Head(run=RUN, events=4, sha256="0" * 64, state="RUNNING", source="hardware"))
    published, path = head(tmp_path), ledger_file(tmp_path)
    folders = Folders(
        root=tmp_path, testplans=tmp_path / "testplans", fixtures=tmp_path / "fixtures", reports=tmp_path, name="w"
    )
    assert read_world(folders, Cache(None, ""), version="1", published_head=published).problems == ()
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:2]))
    assert read_world(folders, Cache(None, ""), version="1").problems == ()
    for _ in range(2):
        (said,) = read_world(folders, Cache(None, ""), version="1", published_head=published).problems
        assert "no line has the published head" in said
        path.unlink(missing_ok=True)


def test_what_stands_for_hardware_is_read_with_its_instrument_and_its_reason(tmp_path):
    """A port of this computer counts as hardware by the bench file's word; the audit knows which, and why."""
    (tmp_path / RUN).mkdir()
    journal = begin(tmp_path / RUN)
    port = "socket://localhost:1 stands for hardware: a bridge"
    journal.write(
        event_of("host-gate", name="source of psu2", ok=True, detail="", instrument="psu2", exception=port), 0.0
    )
    whole_case(tmp_path / RUN, journal)
    seal(tmp_path / RUN, journal, exit_code=0, write_reports=write_report)
    (package,) = read_packages(tmp_path, Cache(None, ""))
    assert package.exceptions == (("psu2", port),)


def test_parts_of_other_packages_are_read(tmp_path):
    """What offers a driver, and what was only executed, such as by a late import."""
    folder = tmp_path / RUN
    folder.mkdir()
    journal = begin(folder)
    other = {"name": "hil-ina226", "version": "1.2", "offers": ["driver ina226"], "from": "index", "recorded": True}
    told = {**SOFTWARE, "format": 3, "others": [other], "start": [], "strays": []}
    (folder / "data/software.json").write_bytes(canonical(told))
    whole_case(folder, journal)
    journal.write(event_of("executed", packages=["hil-ina226 1.2", "helper 2.0", "late 3.1"], last=True), 5.0)
    seal(folder, journal, exit_code=0, write_reports=write_report)
    (package,) = read_packages(tmp_path, Cache(None, ""))
    assert package.others == (
        "driver ina226 of package hil-ina226 1.2 is as it was installed from an index",
        "helper 2.0 was executed, as installed",
        "late 3.1 was executed, as installed",
    )


@pytest.mark.parametrize("cut", [False, True])
def test_a_journal_that_the_ledger_saw_longer_is_not_believed(tmp_path, cut):
    """A FAIL was journaled, the run killed, and the journal cut to before it, with its chain whole."""
    reports = tmp_path / "reports"
    (reports / RUN / "data").mkdir(parents=True)
    (tmp_path / "testplans").mkdir()
    path = reports / RUN / JOURNAL
    with Journal(path) as journal:
        journal.write(event_of(kind="run", format=1, source="hardware"), 0.0)
        journal.write(event_of(kind="planned", cases=[]), 0.0)
        journal.write(event_of(kind="note", text="measured", by="Ada"), 0.0)
        append(reports, Head(run=RUN, events=3, sha256=journal.head, state="RUNNING", source="hardware"))
    if cut:
        path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:2]))
    folders = Folders(
        root=tmp_path, testplans=tmp_path / "testplans", fixtures=tmp_path / "fixtures", reports=reports, name="w"
    )
    (found,) = read_world(folders, Cache(None, ""), version="1").packages
    assert found.known is not cut
    if cut:
        assert "the journal has 2 events, and the ledger saw event 3" in found.problem
