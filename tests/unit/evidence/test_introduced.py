"""Files that no event introduced: they are set aside before the seal, and found in a package that holds them."""

from __future__ import annotations

import shutil

import pytest
from evidence_runs import begin, sealed_run, whole_case, write_report
from told_as_json import bodies
from typed_events import event_of

from hil.documents.canonical import canonical, parse_strict
from hil.evidence.folder import ATTACHMENTS, GUARDIAN, JOURNAL, RECORDINGS, RESULTS, create, hold
from hil.evidence.journal.reader import read_journal
from hil.evidence.package import introduced
from hil.evidence.package.bag import inventory, write_manifests
from hil.evidence.package.contents import Package
from hil.evidence.package.sealing import recover, seal
from hil.evidence.package.verification import verify
from hil.model.errors import EvidenceError

STRANGERS = [
    f"{ATTACHMENTS}/cert.pdf",
    GUARDIAN,
    f"{RECORDINGS}/009-fake.h5",
    "data/report/cert.pdf",
    "data/sources/testplans/gyro/ref.csv",
    "data/bench/certificates/psu2.txt",
    "data/journal.torn",
    "data/\x1bname",
]


@pytest.fixture
def folder(tmp_path):
    """Return the folder of a run."""
    return create(tmp_path / "reports", bench="flight", dut="SN1")


def put(folder, path):
    """Write a file as a case would that evades `artifact`."""
    (folder / path).parent.mkdir(parents=True, exist_ok=True)
    (folder / path).write_bytes(b"written by the case")


def anomalies(folder):
    """Return the texts of a package's anomalies."""
    return [str(event["text"]) for event in bodies(Package(folder), "anomaly")]


@pytest.mark.parametrize("path", STRANGERS)
def test_what_a_case_writes_itself_is_set_aside(folder, path):
    """A case that writes a certificate, a guardian's journal or a recording into the folder: none of it is sealed."""
    with hold(folder):
        journal = begin(folder, live=None, source="simulated")
        put(folder, path)
        whole_case(folder, journal)
        seal(folder, journal, exit_code=0, write_reports=write_report)
    assert verify(folder).findings == ()
    assert not (folder / path).exists()
    (told,) = anomalies(folder)
    assert "no event introduced this file (19 bytes, SHA-256 " in told
    assert told.isprintable()
    assert (folder.parent / ".aside" / folder.name / path).read_bytes() == b"written by the case"


def test_an_attachment_that_is_put_there_before_the_seal_is_set_aside(folder):
    """After the run was killed, a file is put beside its attachments, and `hil seal` is called; twice the same name."""
    with hold(folder):
        whole_case(folder, begin(folder, live=None, source="simulated"))
    place = folder.parent / ".aside" / folder.name / STRANGERS[0]
    place.parent.mkdir(parents=True)
    place.write_bytes(b"of an earlier seal")
    put(folder, STRANGERS[0])
    recover(folder, write_reports=write_report)
    assert verify(folder).findings == ()
    assert f"set aside in .aside/{folder.name}/{STRANGERS[0]}.2" in anomalies(folder)[0]
    assert place.read_bytes() == b"of an earlier seal"


@pytest.mark.parametrize("kind", ["results", "end"])
def test_after_the_last_word_nothing_is_taken_in(folder, monkeypatch, kind):
    """Where the journal can tell of nothing any more, `hil seal` refuses what came since."""
    with hold(folder):
        journal = begin(folder, live=None, source="simulated")
        whole_case(folder, journal)
        stop = "write_end" if kind == "results" else "finish"
        with monkeypatch.context() as patched, pytest.raises(ZeroDivisionError):
            patched.setattr(f"hil.evidence.package.sealing.{stop}", lambda *_, **__: 1 / 0)
            seal(folder, journal, exit_code=0, write_reports=write_report)
        journal.close()
    put(folder, STRANGERS[0])
    with pytest.raises(EvidenceError, match=r"cert\.pdf: no event of the journal introduced this file") as caught:
        recover(folder, write_reports=write_report)
    assert "move it out" in caught.value.hint
    (folder / STRANGERS[0]).unlink()
    recover(folder, write_reports=write_report)
    assert verify(folder).ok


@pytest.mark.parametrize("path", STRANGERS)
def test_a_stranger_in_a_package_is_found(folder, tmp_path, path):
    """Somebody adds a file, names it in the journal's end, and bags it again: no event introduced it."""
    sealed_run(folder, live=None, source="simulated")
    copy = shutil.copytree(folder, tmp_path / "copy", copy_function=shutil.copyfile)
    for each in (copy, *copy.rglob("*")):
        each.chmod(0o755)
    put(copy, path)
    *lines, end = (copy / JOURNAL).read_bytes().splitlines()
    value = parse_strict(end)
    value["wall"]["files"] = inventory(copy)
    (copy / JOURNAL).write_bytes(b"\n".join([*lines, canonical(value), b""]))
    write_manifests(copy, (copy / "bag-info.txt").read_bytes())
    name = path.replace("\x1b", r"\x1b")
    assert f"{name}: no event of the journal introduced this file" in [str(each) for each in verify(copy).findings]


@pytest.mark.parametrize(
    ("events", "known"),
    [
        ([("attachment", {"file": "cert.pdf", "sha256": "0", "text": "", "by": ""})], STRANGERS[0]),
        ([("host-gate", {"name": "guardian: coil", "ok": True, "detail": ""})], GUARDIAN),
        ([("acknowledged", {"text": "", "by": "Ada", "guardian": "0"})], GUARDIAN),
        ([("recovered", {"text": "", "torn_bytes": 3})], "data/journal.torn"),
    ],
)
def test_an_event_introduces_its_file(folder, events, known):
    """An attachment by its event, the guardian's journal by its gates, a torn tail by what says so."""
    journal = begin(folder, live=None, source="simulated")
    for kind, fields in events:
        journal.write(event_of(kind, **fields), 1.0)
    journal.close()
    reading = read_journal(folder / JOURNAL)
    assert list(introduced.strangers(reading, STRANGERS)) == [path for path in STRANGERS if path != known]
    assert list(introduced.strangers(reading, [RESULTS])) == [RESULTS]
