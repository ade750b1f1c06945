"""Facts that stand twice: a package in which only one of the two was rewritten is damaged, whatever fits."""

from __future__ import annotations

import pytest
from evidence_runs import (
    BENCH_FILE,
    DUT,
    DUTS_FILE,
    REQUIREMENTS,
    REQUIREMENTS_FILE,
    begin,
    sealed_run,
    whole_case,
    write_report,
)
from evidence_runs import CALIBRATION as RECORDS
from msgspec.structs import replace
from typed_events import event_of

from hil.documents.canonical import canonical, parse_strict
from hil.evidence.folder import CALIBRATION, CATALOGUE, JOURNAL, PARAMETERS, create
from hil.evidence.journal.writer import Journal
from hil.evidence.package.sealing import seal
from hil.evidence.package.verification import verify
from hil.evidence.results.facts import entries_of, freeze_calibration, freeze_catalogue

BENCH, DUTS, DUT_FILE = "data/bench/bench.yaml", "data/bench/duts.yaml", "data/dut.json"
OF_PLAN = "data/catalogue/gyro"
LOCKED = {item.id: {"rev": item.rev, "fingerprint": item.fingerprint, "wording": item.wording} for item in REQUIREMENTS}
PARAMETERS_FILE = b'schema: hil/parameters/1\nparameters:\n- {name: current, value: "0.01", unit: A}\n'
ROW = {"name": "current", "value": "0.01 A", "unit": "A", "text": "", "deviation": ""}


@pytest.fixture
def folder(tmp_path):
    """Return the folder of a run."""
    return create(tmp_path / "reports", bench="flight", dut="SN1")


def told(folder):
    """Return what verification finds."""
    return [str(finding) for finding in verify(folder).findings]


def catalogue(folder, old, new):
    """Return the frozen catalogue with another text in it."""
    freeze_catalogue(folder, entries_of(REQUIREMENTS))
    data = (folder / CATALOGUE).read_bytes()
    assert data.count(old) == 1
    return data.replace(old, new)


def lock(**changes):
    """Return the lock of the plan, with changes to its first requirement."""
    return canonical({"format": 1, "requirements": {**LOCKED, "GYR-030": LOCKED["GYR-030"] | changes}})


def parameters(**changes):
    """Return the frozen parameters of the plan, with changes to the only one."""
    return canonical({"format": 1, "plans": {"gyro": [ROW | changes]}})


def test_what_is_the_same_twice_is_sound(folder):
    """A lock, a parameter that was changed on the command line, and a skipped case included."""
    changed = {"value": "0.02 A", "deviation": "parameter current is 0.02 A instead of 0.01 A"}
    files = {
        f"{OF_PLAN}/parameters.yaml": PARAMETERS_FILE,
        f"{OF_PLAN}/requirements.lock.json": lock(),
        PARAMETERS: parameters(**changed),
    }
    given = {"overrides": {"current": "0.02"}, "skips": {"b": "late"}, "deviations": [changed["deviation"], "b: late"]}
    sealed_run(folder, files=files, **given)
    assert told(folder) == []


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({"sources": "1" * 64}, f"{JOURNAL}:1:1: field 'sources' is not the hash over the frozen sources"),
        ({"bench_files": "1" * 64}, f"{JOURNAL}:1:1: field 'bench_files' is not the hash over the frozen files of"),
        ({"dut": DUT | {"firmware": "9"}}, f'{DUT_FILE}: field \'firmware\' is "", and the journal has "9"'),
        ({"dut": DUT | {"serial": "SN2"}}, f"{DUTS}: it has no entry 'SN2', which the run was for"),
        ({"bench": "other"}, f'{BENCH}: field \'bench.name\' is "flight", and the journal has "other"'),
        ({"plans": ["battery"]}, "data/catalogue/battery/requirements.yaml: its requirements cannot be read"),
        ({"only": ["a"]}, f"{JOURNAL}:1:1: field 'deviations' does not name every changed parameter"),
        ({"skips": {"b": "late"}}, f"{JOURNAL}:1:1: field 'deviations' does not name every changed parameter"),
    ],
)
def test_a_journal_that_says_something_else_is_found(folder, changes, found):
    """The first event is rewritten, and everything after it: the frozen files contradict it."""
    sealed_run(folder, **changes)
    assert any(line.startswith(found) for line in told(folder)), told(folder)


@pytest.mark.parametrize(
    ("files", "found"),
    [
        (
            {DUT_FILE: canonical({**DUT, "simulated": True, "format": 1})},
            f"{DUT_FILE}: field 'simulated' is true, and {DUTS} has false",
        ),
        (
            {DUTS: DUTS_FILE.replace("part: P1", "part: P2").encode()},
            f'{DUT_FILE}: field \'part\' is "P1", and {DUTS} has "P2"',
        ),
        (
            {BENCH: BENCH_FILE.replace("2026-12-31", "2025-12-31").encode()},
            f'{CALIBRATION}: field \'psu1.due\' is "2026-12-31", and {BENCH} has "2025-12-31"',
        ),
        (
            {BENCH: BENCH_FILE.replace("C-1", "C-2").encode(), "data/bench/C-2": b"Certificate C-1\n"},
            f'{CALIBRATION}: field \'psu1.certificate\' is "C-1", and {BENCH} has "C-2"',
        ),
        (
            {BENCH: BENCH_FILE.replace("  psu1:\n", "  psu1:\n    dut: true\n").encode()},
            f"{CALIBRATION}: field 'psu1.dut' is false, and {BENCH} has true",
        ),
        (
            {BENCH: BENCH_FILE.replace('"0.01"', '"0.001"').encode()},
            f"{CALIBRATION}: field 'psu1.ranges' is",
        ),
        ({"data/bench/C-1": b""}, f"{CALIBRATION}: field 'psu1.sha256' is"),
        (
            {BENCH: (BENCH_FILE + "  dmm1: {driver: none}\n").encode()},
            f"{BENCH}: instrument 'dmm1' is missing in {CALIBRATION}",
        ),
        ({BENCH: b"schema: [\n"}, f"{CALIBRATION}: cannot be checked: {BENCH}:2:1: "),
        (
            {f"{OF_PLAN}/requirements.yaml": REQUIREMENTS_FILE.replace("small", "zero").encode()},
            f"{CATALOGUE}: field 'GYR-030.text' is \"The error shall be small.\", and requirements.yaml of gyro has",
        ),
        (
            {f"{OF_PLAN}/requirements.yaml": REQUIREMENTS_FILE.replace('max: "0.5"', 'max: "0.1"').encode()},
            f"{CATALOGUE}: field 'GYR-030.limits' is",
        ),
        (
            {f"{OF_PLAN}/requirements.yaml": REQUIREMENTS_FILE.replace("GYR-010", "GYR-011").encode()},
            f"{CATALOGUE}: requirement GYR-011: it is missing, and the plans have it",
        ),
        (
            {f"{OF_PLAN}/requirements.lock.json": lock(rev=2)},
            f"{CATALOGUE}: field 'GYR-030.rev' is 1, and {OF_PLAN}/requirements.lock.json has 2",
        ),
        (
            {f"{OF_PLAN}/requirements.lock.json": lock(fingerprint="0")},
            f"{CATALOGUE}: field 'GYR-030.fingerprint' is ",
        ),
        (
            {f"{OF_PLAN}/parameters.yaml": PARAMETERS_FILE, PARAMETERS: parameters(value="0.02 A")},
            f'{PARAMETERS}: field \'current.value\' is "0.02 A", and parameters.yaml of gyro has "0.01 A"',
        ),
        (
            {f"{OF_PLAN}/parameters.yaml": PARAMETERS_FILE},
            f"{PARAMETERS}: plan gyro has 1 parameter in parameters.yaml, and 0 here",
        ),
        ({PARAMETERS: canonical({"format": 1, "plans": {}})}, f"{PARAMETERS}: its plans are not those of the run"),
    ],
)
def test_a_frozen_file_that_says_something_else_is_found(folder, files, found):
    """One of two frozen files is rewritten, and every hash with it."""
    sealed_run(folder, files=files)
    assert any(line.startswith(found) for line in told(folder)), told(folder)


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        (b'"text":"The error shall be small."', b'"text":"Anything goes."', "GYR-030.text"),
        (b'"rev":1,"source":"s 30"', b'"rev":2,"source":"s 30"', "GYR-030.rev"),
        (b'"max":"0.5"', b'"max":"5"', "GYR-030.limits"),
        (REQUIREMENTS[0].fingerprint.encode(), b"0" * 64, "GYR-030.fingerprint"),
    ],
)
def test_a_catalogue_that_says_something_else_is_found(folder, old, new, found):
    """The frozen catalogue is rewritten with its hash in the first event; its plan's own file contradicts it."""
    sealed_run(folder, files={CATALOGUE: catalogue(folder, old, new)})
    assert any(line.startswith(f"{CATALOGUE}: field '{found}' is") for line in told(folder)), told(folder)


def test_a_calibration_that_says_something_else_is_found(folder):
    """A due date is moved in the frozen records, with their hash in the first event."""
    freeze_calibration(folder, {"psu1": replace(RECORDS["psu1"], due="2031-12-31")})
    sealed_run(folder, files={CALIBRATION: (folder / CALIBRATION).read_bytes()})
    assert told(folder) == [
        f'{CALIBRATION}: field \'psu1.due\' is "2031-12-31", and data/bench/bench.yaml has "2026-12-31"'
    ]


def test_frozen_files_that_nothing_names_are_found(folder, monkeypatch):
    """The second event is rewritten and names nothing: no event introduced what lies there frozen."""
    begin(folder).close()
    monkeypatch.setattr("hil.evidence.package.sealing.set_aside", lambda *_: [])
    without(folder, lambda body: body | {"files": {}} if body["kind"] == "frozen" else body)
    found = told(folder)
    assert f"{BENCH}: no event of the journal introduced this file" in found
    assert f"{DUT_FILE}: no event of the journal introduced this file" in found


@pytest.mark.parametrize(
    ("kind", "found"),
    [
        ("armed", "supply.coil.enable drives the bench, which is not armed"),
        ("gate", "the bench was armed without a gate"),
    ],
)
def test_a_bench_that_was_driven_without_being_armed_is_found(folder, kind, found):
    """Somebody takes the arming, or its gates, out of the journal."""
    journal = begin(folder)
    fields = {"case": "test_rest", "step": "", "name": "supply.coil.enable", "ordinal": 1, "effect": "drives"}
    journal.write(event_of("effect", arguments={}, result=None, **fields), 1.0)
    journal.close()
    without(folder, lambda body: None if body["kind"].endswith(kind) else body)
    assert any(line.endswith(found) for line in told(folder)), told(folder)


def without(folder, change):
    """Rewrite a run's journal, event by event as `change` gives them, and seal the run."""
    lines = [parse_strict(line) for line in (folder / JOURNAL).read_bytes().splitlines()]
    (folder / JOURNAL).unlink()
    journal = Journal(folder / JOURNAL)
    for line in lines:
        if (body := change(line["body"])) is not None:
            rest = {key: value for key, value in body.items() if key not in {"kind", "seq", "t"}}
            beside = {key: value for key, value in line["wall"].items() if key == "files"}
            journal.write(event_of(body["kind"], **rest), body["t"], beside=beside)
    whole_case(folder, journal)
    seal(folder, journal, exit_code=0, write_reports=write_report)
