"""Sealing and verifying: what a package holds, and every way in which it can be wrong."""

from __future__ import annotations

import hashlib
import json
import os
import socket

import bagit
import pytest
from evidence_runs import (
    OF_ALL_RUNS,
    OF_THIS_PLACE,
    WRITTEN_BY_THE_RUN,
    begin,
    check,
    run_fields,
    sealed_run,
    whole_case,
    writable_copy,
    write_report,
)
from told_as_json import bodies, results_as_json
from typed_events import event_of

from hil.documents.canonical import canonical
from hil.evidence.folder import JOURNAL, create, hold
from hil.evidence.inbox import post
from hil.evidence.journal.reader import UnknownFormat
from hil.evidence.journal.writer import Journal
from hil.evidence.package.bag import (
    evidence_digest,
    inventory,
    make_read_only,
    manifest_text,
    read_manifest,
    write_manifests,
)
from hil.evidence.package.contents import Package
from hil.evidence.package.sealing import recover, seal
from hil.evidence.package.verification import State, verify
from hil.model.errors import EvidenceError, Refused


@pytest.fixture
def folder(tmp_path):
    """Return the folder of a run."""
    return create(tmp_path / "reports", bench="flight", dut="SN1")


@pytest.fixture(scope="module")
def sealed(tmp_path_factory):
    """The folder of a sealed run, which nobody changes."""
    folder = create(tmp_path_factory.mktemp("sealed") / "reports", bench="flight", dut="SN1")
    sealed_run(folder)
    return folder


@pytest.fixture
def writable(tmp_path, sealed):
    """Return a writable copy of a sealed package."""
    return writable_copy(sealed, tmp_path)


def in_place_of(path):
    """Remove a file, so that something else can be put in its place."""
    path.unlink()
    return path


def messages(folder):
    """Return what verification finds, as text."""
    verification = verify(folder)
    assert verification.state is State.DAMAGED
    assert not verification.ok
    return "\n".join(str(finding) for finding in verification.findings)


def test_a_sealed_run_verifies(folder):
    """A whole run is sealed, verified, complete, and read-only; nothing of its working state is left."""
    digest = sealed_run(folder)
    verification = verify(folder)
    assert (verification.ok, verification.findings, verification.verdict) == (True, (), "PASS")
    assert verification.evidence_digest == digest == Package(folder).evidence_digest
    assert sorted(path.name for path in folder.iterdir()) == [
        "bag-info.txt", "bagit.txt", "data", "manifest-sha256.txt", "tagmanifest-sha256.txt",
    ]  # fmt: skip
    assert all(not path.stat().st_mode & 0o222 for path in (folder, *folder.rglob("*")))


def test_the_seal_opens_a_package_to_nobody(tmp_path):
    """Who could not read a file before it was sealed cannot read it afterwards."""
    folder = tmp_path / "package"
    folder.mkdir(mode=0o750)
    private, shared = folder / "private", folder / "shared"
    for path, mode in ((private, 0o600), (shared, 0o664), (folder, 0o750)):
        path.touch()
        path.chmod(mode)
    make_read_only(folder)
    assert [path.stat().st_mode & 0o777 for path in (private, shared, folder)] == [0o400, 0o444, 0o550]


def test_a_recording_that_a_resumed_run_began_again_is_sealed(folder):
    """What is read after the end of a run that was killed there is begun a second time, and is one recording."""
    with hold(folder):
        journal = begin(folder)
        for _ in range(2):
            journal.write(
                event_of(
                    "recording",
                    case=None,
                    step=None,
                    recording="after",
                    name="after",
                    rate=1.0,
                    duration=None,
                    channels=[{"name": "x", "unit": "A", "instrument": "psu1", "calibration": "", "uncertainty": None}],
                    source="hardware",
                ),
                1.0,
            )
        journal.close()
    recover(folder, write_reports=write_report)
    assert len(list(bodies(Package(folder), "recording-end"))) == 1
    assert (folder / "data/recordings/after.h5").exists()
    assert not (folder / "data/recordings/after.rows").exists()


def test_an_independent_reader_accepts_the_bag(folder):
    """The bagit library, which is not ours, validates the package and reads its facts."""
    sealed_run(folder)
    bag = bagit.Bag(str(folder))
    bag.validate()
    assert bag.info["External-Identifier"] == folder.name
    assert bag.info["Bagging-Date"] == "2026-11-21"
    assert bag.info["Content-Digest"] == verify(folder).content_digest
    assert bag.version_info == (1, 0)


def test_odd_names_are_encoded_as_others_read_them(tmp_path):
    """Line ends and per cent signs in names survive the manifest; the others' library reads the line ends, too."""
    names = ["data/a\nb", "data/c\rd", "data/é µ", "data/e%0Af"]
    hashes = {name: hashlib.sha256(name.encode()).hexdigest() for name in names}
    (tmp_path / "m.txt").write_bytes(manifest_text(hashes))
    assert read_manifest(tmp_path, "m.txt") == (hashes, [])
    (tmp_path / "data").mkdir()
    for name in names[:3]:
        (tmp_path / name).write_bytes(name.encode())
    write_manifests(tmp_path, b"Payload-Oxum: 26.3\n")
    (tmp_path / "bagit.txt").write_bytes(b"BagIt-Version: 1.0\nTag-File-Character-Encoding: UTF-8\n")
    bagit.Bag(str(tmp_path)).validate()


def test_the_digest_is_over_the_evidence_and_not_the_report(tmp_path):
    """Another report leaves the evidence digest as it is, and what is sealed is what the report was told."""
    told = []

    def other(package):
        told.append(evidence_digest(package.folder))
        write_report(package)
        (package.folder / "data/report/junit.xml").write_text("<other/>")

    digests = []
    for name, report in (("a/run", write_report), ("b/run", other)):  # each with a ledger of its own
        (tmp_path / name).mkdir(parents=True)
        journal = begin(tmp_path / name)
        whole_case(tmp_path / name, journal)
        digests.append(seal(tmp_path / name, journal, exit_code=0, write_reports=report))
    assert digests[0] == digests[1] == told[0]
    manifest = (tmp_path / "b/run/manifest-sha256.txt").read_bytes().splitlines(keepends=True)
    kept = b"".join(line for line in manifest if b"  data/report/" not in line)
    assert digests[1] == hashlib.sha256(kept).hexdigest()


def test_a_report_that_fails_does_not_keep_the_evidence_open(folder):
    """The package is sealed and whole, and the error is still told."""
    journal = begin(folder)
    whole_case(folder, journal)

    def fail(_):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        seal(folder, journal, exit_code=0, write_reports=fail)
    assert verify(folder).ok


def test_late_messages_are_in_the_package(folder, tmp_path):
    """A note and a photo that came during the last step are evidence, a late stop is noted."""
    (tmp_path / "photo.jpg").write_bytes(b"picture")
    journal = begin(folder)
    whole_case(folder, journal)
    post(folder, "note", by="Ada", text="smells odd")
    post(folder, "attachment", by="Ada", attach=tmp_path / "photo.jpg")
    post(folder, "stop", by="Ada", text="enough")
    seal(folder, journal, exit_code=0, write_reports=write_report)
    package = Package(folder)
    assert [event["text"] for event in bodies(package, "note")] == ["smells odd"]
    assert "stop by Ada: enough" in bodies(package, "anomaly")[0]["text"]
    assert (folder / "data/attachments" / bodies(package, "attachment")[0]["file"]).read_bytes() == b"picture"
    assert verify(folder).ok


@pytest.mark.parametrize(
    ("damage", "found"),
    [
        (lambda f: (f / "data/stray.txt").write_text("x"), "does not name it"),
        (lambda f: (f / "stray.txt").write_text("x"), "no manifest names this file"),
        (lambda f: (f / "data/results.json").unlink(), "it is missing"),
        (lambda f: (f / "data/report/report.html").write_text("better"), "changed after the seal"),
        (lambda f: (f / "tagmanifest-sha256.txt").unlink(), "tagmanifest-sha256.txt: this file is missing"),
        (lambda f: (f / "manifest-sha256.txt").unlink(), "manifest-sha256.txt: this file is missing"),
        (lambda f: (f / "data/link").symlink_to("/etc/passwd"), "expected a regular file"),
        (lambda f: (f / "data/linked").symlink_to("/etc"), "expected a regular file"),
        (lambda f: os.mkfifo(f / "data/pipe"), "found a named pipe"),
        (lambda f: (f / "data/loop").symlink_to("loop"), "found a link"),
        (
            lambda f: in_place_of(f / "data/journal.jsonl").symlink_to("/dev/zero"),
            "journal.jsonl: expected a regular file",
        ),
        (lambda f: os.mkfifo(in_place_of(f / "data/results.json")), "results.json: expected a regular file"),
        (lambda f: in_place_of(f / "bagit.txt").symlink_to("/dev/zero"), "bagit.txt: expected a regular file"),
        (lambda f: in_place_of(f / "bagit.txt").mkdir(), "bagit.txt: empty folder"),
        (lambda f: (f / "data/a\n\x1b[2J").symlink_to("/"), r"data/a\n\x1b[2J: expected a regular file"),
        (lambda f: (f / "data/nothing/at all").mkdir(parents=True), "nothing/at all: empty folder"),
        (lambda f: (f / "data/of\udcffbytes").write_text("x"), r"of\udcffbytes: manifest-sha256.txt does not name it"),
        (lambda f: (f / "data/RESULTS.json").write_text("{}"), "by case only"),
        (lambda f: (f / "data/journal.jsonl").unlink(), "the journal cannot be read"),
        (lambda f: (f / "data/journal.jsonl").write_bytes(b""), "expected the event run first"),
        (
            lambda f: (f / "data/recordings/001-rest.h5").write_bytes(b"x"),
            "001-rest.h5: it is not the file that the journal names",
        ),
        (lambda f: (f / "data/recordings/001-rest.h5").unlink(), "the recording is missing"),
        (lambda f: (f / "bagit.txt").write_text("BagIt-Version: 0.97\n"), "expected the BagIt declaration"),
    ],
)
def test_damage_is_found_and_named(writable, damage, found):
    """What was added, taken away or changed is a finding that names the file."""
    damage(writable)
    assert found in messages(writable)


@pytest.mark.parametrize(
    ("change", "found"),
    [
        (lambda lines: lines[:-1], "does not name it"),
        (lambda lines: [*lines, lines[0]], "named twice"),
        (lambda lines: [*lines[:-1], "0" * 64 + lines[-1][64:]], "changed after the seal"),
        (lambda lines: [*lines, "0" * 64 + "  ../../etc/passwd\n"], "leads out of the package"),
        (lambda lines: [*lines, "0" * 64 + "  /etc/passwd\n"], "leads out of the package"),
        (lambda lines: [*lines, "0" * 64 + "  data/nobody\n"], "it is missing"),
        (lambda lines: [*lines, "hello\n"], "a SHA-256, two spaces and a path"),
        (lambda lines: [*lines[:-1], lines[-1].rstrip()], "cut off"),
        (lambda lines: lines[::-1], "order or spacing is not as a seal writes them"),
        (lambda lines: [lines[0].upper(), *lines[1:]], "a SHA-256, two spaces and a path"),
    ],
)
def test_a_manifest_is_read_strictly(writable, change, found):
    """Every liberty in a manifest's text is a finding, also one that other tools allow."""
    path = writable / "manifest-sha256.txt"
    path.write_text("".join(change(path.read_text().splitlines(keepends=True))))
    assert found in messages(writable)


def rebag(folder):
    """Write manifests that fit what is in the folder now, as a forger would."""
    write_manifests(folder, (folder / "bag-info.txt").read_bytes())


def test_a_better_result_in_a_fresh_bag_is_found(writable):
    """Results that journal and catalogue do not give are found, though every manifest fits."""
    path = writable / "data/results.json"
    results = json.loads(path.read_bytes())
    results["requirements"][0]["text"] = "Anything goes."
    path.write_bytes(canonical(results))
    rebag(writable)
    found = messages(writable)
    assert (
        "data/results.json:1:1: field 'requirements[0].text' is \"Anything goes.\","
        ' and the journal gives "The rest shall be recorded."'
    ) in found


def test_another_catalogue_in_a_fresh_bag_is_found(writable):
    """A wider limit in the frozen catalogue contradicts the run's first event and every check."""
    path = writable / "data/catalogue/catalogue.json"
    path.write_bytes(path.read_bytes().replace(b'"max":"0.5"', b'"max":"5"'))
    rebag(writable)
    found = messages(writable)
    assert "not the catalogue that the run started with" in found
    assert "field 'limit.max' is 0.5, and the catalogue has 5" in found


def test_other_rows_in_a_fresh_bag_are_found(writable):
    """A recording that was changed afterwards is not the file that the journal names, and is not even opened."""
    change_a_row(writable)
    rebag(writable)
    assert "001-rest.h5: it is not the file that the journal names" in messages(writable)


def test_other_rows_that_the_journal_names_are_found(writable):
    """Who also rewrites the journal's end has the hashes of the rows against him."""
    change_a_row(writable)
    path = writable / "data/journal.jsonl"
    *lines, end = path.read_bytes().splitlines()
    value = json.loads(end)
    value["wall"]["files"] = inventory(writable)
    path.write_bytes(b"\n".join([*lines, canonical(value), b""]))
    rebag(writable)
    assert "its first 100 rows are not those" in messages(writable)


def change_a_row(folder):
    """Change one number of the recording."""
    import h5py  # noqa: PLC0415 - only here one is opened for writing

    with h5py.File(folder / "data/recordings/001-rest.h5", "r+") as file:
        file["channels/x"][50] = 0.0


PAYLOAD = sorted({*OF_ALL_RUNS, *OF_THIS_PLACE, *WRITTEN_BY_THE_RUN})


@pytest.mark.parametrize("name", PAYLOAD)
def test_every_file_is_named_in_the_journal(writable, name):
    """Whatever file is changed, taken away or added in a fresh bag, the journal tells which."""
    path = writable / name
    before = path.read_bytes()
    path.write_bytes(before + b" ")
    rebag(writable)
    assert f"{name}: it is not" in messages(writable)
    path.unlink()
    rebag(writable)
    assert f"{name}: " in messages(writable)
    path.write_bytes(before)
    (writable / f"{name}.too").write_bytes(b"")
    rebag(writable)
    assert f"{name}.too: the journal does not name it" in messages(writable)


def test_what_changed_between_the_first_step_and_the_seal_is_found(folder):
    """A frozen file must still be what it was when the run began."""
    journal = begin(folder)
    whole_case(folder, journal)
    (folder / "data/bench/bench.yaml").write_text("other: limits\n")
    seal(folder, journal, exit_code=0, write_reports=write_report)
    assert "bench.yaml: it is not what was frozen before the first step" in messages(folder)


def test_the_end_of_the_journal_is_as_it_was_written(writable):
    """No line follows the last one and holds its hash, so its own bytes must be canonical."""
    path = writable / "data/journal.jsonl"
    *lines, end = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([*lines, end.replace(b'"wall":{', b'"wall":{ ')]))
    rebag(writable)
    assert "not canonical JSON" in messages(writable)


def test_a_socket_in_a_package_is_found(monkeypatch, writable):
    """It is named, and nobody talks to it."""
    monkeypatch.chdir(writable / "data")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("s")
    assert "data/s: expected a regular file, found a socket" in messages(writable)


def test_folders_within_folders_without_end_are_found(writable):
    """No more of them than Python may call functions are followed."""
    deepest = writable / "data"
    for _ in range(1500):
        deepest /= "d"
        deepest.mkdir()
    try:
        assert verify(writable).state is State.DAMAGED
    finally:
        os.removedirs(deepest)  # pytest's own way takes a function for each


def test_nothing_is_read_through_a_link(tmp_path, writable):
    """A folder that is a link to the true one is a finding, and nothing else is looked at."""
    (writable / "data").rename(tmp_path / "elsewhere")
    (writable / "data").symlink_to(tmp_path / "elsewhere")
    assert messages(writable) == "data: expected a regular file, found a link"


def test_each_finding_is_told_once_and_by_a_path_in_the_package(writable):
    """What stops several looks is one finding, and no path of this machine is in it."""
    (writable / "data/catalogue/catalogue.json").write_bytes(b"nonsense")
    found = messages(writable).splitlines()
    assert len(found) == len(set(found))
    assert str(writable) not in "".join(found)
    assert any(line.startswith("data/catalogue/catalogue.json:1:1: not JSON") for line in found)


def test_an_empty_journal_is_told_in_sentences(writable):
    """Nothing follows from no events; no finding is an error of the program."""
    (writable / JOURNAL).write_bytes(b"")
    found = messages(writable)
    assert "expected the event run first, and results and end last, each once" in found
    assert "bag-info.txt: cannot be checked: the journal has no events" in found
    assert "Error" not in found


def test_a_damaged_package_has_no_digest(writable):
    """Neither digest nor verdict of it could be taken for the sealed ones."""
    (writable / "data/dut.json").write_bytes(b"{}")
    found = verify(writable)
    assert (found.state, found.evidence_digest, found.content_digest, found.verdict) == (State.DAMAGED, "", "", "")


def test_a_chain_that_was_cut_in_a_fresh_bag_is_found(writable):
    """An event that was taken out breaks chain, sequence and results."""
    path = writable / "data/journal.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(line for line in lines if b'"kind":"gate"' not in line))
    rebag(writable)
    assert "the chain is broken" in messages(writable)


@pytest.mark.parametrize(
    ("lie", "found"),
    [
        ({"measured": 0.6, "verdict": "PASS"}, "its value gives FAIL"),
        ({"measured": 0.49, "verdict": "PASS"}, "its value gives INCONCLUSIVE"),
        ({"measured": None, "verdict": "PASS"}, "its value gives INCONCLUSIVE"),
        ({"measured": 0.1, "verdict": "FAIL"}, "its value gives PASS"),
        ({"measured": 0.1, "decision": "simple"}, "field 'decision' is simple"),
        ({"measured": 0.1, "limit": {"min": "-9", "max": "9", "equals": None}}, "field 'limit.min' is -9"),
        ({"measured": 0.1, "unit": "m"}, "field 'unit' is 'm', and the limit is in deg/s"),
        ({"measured": 0.1, "requirement": "GYR-999"}, "no such requirement"),
        ({"measured": 0.1, "margin": 0.7}, "field 'margin' is 0.7"),
    ],
)
def test_every_verdict_is_judged_again(folder, lie, found):
    """A check whose verdict does not follow from its value, uncertainty and frozen limit is found in a valid bag."""
    journal = begin(folder)
    check(journal, **lie)
    seal(folder, journal, exit_code=0, write_reports=write_report)
    bagit.Bag(str(folder)).validate()
    assert found in messages(folder)


@pytest.mark.parametrize(
    "word",
    [
        {"measured": None, "verdict": "FAIL", "reason": "the device under test fell silent"},
        {"measured": 0.1, "verdict": "INCONCLUSIVE", "reason": "the analysis says: not observable"},
    ],
)
def test_a_verdict_may_be_worse_than_its_value(folder, word):
    """Silence of the device and the analysis' own word make a verdict worse, and that is no damage."""
    journal = begin(folder)
    check(journal, **word)
    seal(folder, journal, exit_code=1, write_reports=write_report)
    assert verify(folder).findings == ()


def test_a_run_that_goes_on_is_not_verified(folder):
    """Unsealed is RUNNING while its process holds it and INTERRUPTED afterwards, and never ok."""
    begin(folder).close()
    with hold(folder):
        assert verify(folder).state is State.RUNNING
    verification = verify(folder)
    assert (verification.state, verification.ok) == (State.INTERRUPTED, False)
    assert "incomplete" in str(verification.findings[0])


def test_an_interrupted_run_is_sealed_as_it_is(folder):
    """Its rows are kept as an incomplete recording, its verdict is ABORTED, and it is called incomplete."""
    journal = begin(folder)
    journal.write(event_of("case", case="test_rest", attempt=1), 0.0)
    channels = [{"name": "x", "unit": "deg/s", "instrument": "psu1", "calibration": "", "uncertainty": None}]
    journal.write(
        event_of(
            "recording",
            case="test_rest",
            step="1",
            recording="001",
            name="rest",
            channels=channels,
            rate=1.0,
            duration=9.0,
            source="hardware",
        ),
        1.0,
    )
    from hil.evidence.recordings.rows import Rows  # noqa: PLC0415 - this test alone leaves rows open

    rows = Rows(folder / "data/recordings/001.rows", recording="001", channels=[("x", "deg/s")], on_block=print)
    rows.append((1.0, 2.0))
    rows.append((2.0, 3.0))
    rows.finish()
    journal.close()
    with (folder / "data/recordings/001.rows").open("ab") as stream:
        stream.write(b"half")
    with hold(folder), pytest.raises(Refused, match="another process"):
        recover(folder, write_reports=write_report)
    digest = recover(folder, write_reports=write_report)
    verification = verify(folder)
    assert (verification.state, verification.findings, verification.verdict) == (State.SEALED, (), "ABORTED")
    assert not verification.complete
    assert not verification.ok
    recorded = Package(folder).recording("001")
    assert (recorded["x"].tolist(), recorded.complete) == ([2.0, 3.0], False)
    assert recover(folder, write_reports=write_report) == digest


def test_a_damaged_journal_is_not_sealed(folder):
    """Recovery cuts a torn tail and mends nothing else."""
    begin(folder).close()
    path = folder / JOURNAL
    path.write_bytes(path.read_bytes().replace(b"flight", b"fright"))
    with pytest.raises(EvidenceError, match="cannot seal: the journal is damaged"):
        recover(folder, write_reports=write_report)


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: path.symlink_to("/dev/zero"), None])
def test_a_journal_that_is_no_file_is_not_sealed(folder, make):
    """Nothing is waited for, nothing raised but words, and the folder stays as it is."""
    if make:
        make(folder / JOURNAL)
    with pytest.raises(EvidenceError, match="cannot be read"):
        recover(folder, write_reports=write_report)
    assert verify(folder).state is State.DAMAGED


def test_a_run_of_another_format_is_not_sealed(folder):
    """This version does not know what belongs into it."""
    begin(folder, format=2).close()
    with pytest.raises(UnknownFormat):
        recover(folder, write_reports=write_report)


def test_a_folder_without_a_single_event_can_go(folder):
    """Nothing recorded is nothing to seal."""
    Journal(folder / JOURNAL).close()
    with pytest.raises(Refused, match="deleted"):
        recover(folder, write_reports=write_report)


def test_rows_that_changed_behind_the_runs_back_are_kept_and_told(folder):
    """The rest of the evidence is sealed, the row file with it, and verification names the recording."""
    journal = begin(folder)
    whole_case(folder, journal)
    path = folder / "data/recordings/001-rest.rows"
    path.write_bytes(path.read_bytes()[:-1] + b"\x7f")
    seal(folder, journal, exit_code=0, write_reports=write_report)
    assert "not those that the journal names" in bodies(Package(folder), "anomaly")[0]["text"]
    assert path.exists()
    assert "the recording is missing" in messages(folder)


def test_what_was_frozen_is_what_the_run_was_begun_with(folder):
    """A calibration record that the run's first event does not name is found."""
    sealed_run(folder, calibration="0" * 64)
    assert "not the calibration that the run started with" in messages(folder)


def test_a_format_of_the_future_is_not_judged(folder):
    """It is neither whole nor damaged, and one sentence says what to do; nothing derives anything from it."""
    sealed_run(folder, format=2, version="9.1.0")
    found = verify(folder)
    way_out = "use the version that wrote it (9.1.0), or a newer one"
    assert (found.state, found.ok, found.evidence_digest) == (State.UNKNOWN, False, "")
    assert [finding.message for finding in found.findings] == [
        f"the package has format 2, and this version of hil reads format 1; {way_out}"
    ]
    with pytest.raises(UnknownFormat, match="format 2"):
        results_as_json(Package(folder))


def test_a_format_of_the_future_hides_no_damage(folder):
    """What the manifests say holds for every format."""
    sealed_run(folder, format=2)
    (folder / "data").chmod(0o755)
    (folder / "data/stray").write_text("x")
    assert "data/stray: manifest-sha256.txt does not name it" in messages(folder)


def test_what_is_no_run_says_so(tmp_path):
    """Any other folder is refused by name."""
    with pytest.raises(EvidenceError, match="not a run's folder"):
        verify(tmp_path)


def test_another_name_is_still_the_same_package(writable):
    """A copy under another name verifies, with the same digest."""
    assert verify(writable).ok


def test_a_simulated_run_verifies_and_closes_nothing(folder):
    """The weakest source is in the results, and the package is whole."""
    sealed_run(folder, source="simulated")
    assert verify(folder).ok
    assert not any(item["eligible"] for item in results_as_json(Package(folder))["requirements"])
    assert bodies(Package(folder), "run")[0]["seed"] == run_fields()["seed"]
