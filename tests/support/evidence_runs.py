"""A small run, written as the executive would write it."""

from __future__ import annotations

import hashlib
import itertools
import shutil
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import msgspec
from typed_events import event_of

from hil.clock.wall import WallStamp
from hil.documents.canonical import canonical
from hil.evidence.folder import CALIBRATION as CALIBRATION_FILE
from hil.evidence.folder import CATALOGUE as CATALOGUE_FILE
from hil.evidence.folder import JOURNAL, PARAMETERS, RECORDINGS, RESERVE, RESULTS, TRANSCRIPT
from hil.evidence.journal.writer import Journal
from hil.evidence.package.bag import inventory
from hil.evidence.package.contents import Package
from hil.evidence.package.sealing import seal
from hil.evidence.recordings.rows import Rows
from hil.evidence.results.facts import FrozenCalibration, FrozenRange, entries_of, freeze_calibration, freeze_catalogue
from hil.model.figure import Figure
from hil.requirements.decision import judge
from hil.requirements.requirement import Kind, Limit, Requirement

__all__ = [
    "BENCH_FILE",
    "CALIBRATION",
    "DUT",
    "DUTS_FILE",
    "LIMIT",
    "OF_ALL_RUNS",
    "OF_THIS_PLACE",
    "REQUIREMENTS",
    "REQUIREMENTS_FILE",
    "SOFTWARE",
    "WRITTEN_BY_THE_RUN",
    "begin",
    "case_end",
    "check",
    "frozen_hashes",
    "planned",
    "record",
    "run_fields",
    "sealed_run",
    "stamps",
    "writable_copy",
    "write_report",
]

LIMIT = Limit(parameter="rate_error", of=("x", "y"), unit="deg/s", minimum="-0.5", maximum="0.5")
REQUIREMENTS = (
    Requirement(
        id="GYR-030",
        rev=1,
        text="The error shall be small.",
        kind=Kind.LIMIT,
        limits=(LIMIT,),
        source="s 30",
        plan="gyro",
        stage="qualification",
    ),
    Requirement(
        id="GYR-010", rev=1, text="The rest shall be recorded.", kind=Kind.RECORD, plan="gyro", stage="qualification"
    ),
)
REQUIREMENTS_FILE = """\
schema: hil/requirements/1
document: {id: GYR, issue: "1.0", title: Gyroscope}
requirements:
- id: GYR-030
  rev: 1
  text: The error shall be small.
  kind: limit
  method: test
  source: s 30
  stage: qualification
  limits:
  - {parameter: rate_error, of: [x, y], unit: deg/s, min: "-0.5", max: "0.5"}
- id: GYR-010
  rev: 1
  text: The rest shall be recorded.
  kind: record
  method: test
  stage: qualification
"""
BENCH_FILE = """\
schema: hil/bench/1
bench: {name: flight}
instruments:
  psu1:
    calibration:
      certificate: C-1
      due: "2026-12-31"
      ranges:
      - {quantity: rate, unit: deg/s, from: "-10", to: "10", absolute: "0.01"}
"""
DUT = {"serial": "SN1", "part": "P1", "model": "QM", "hardware": "A", "firmware": "", "title": "Gyroscope"}
DUTS_FILE = """\
schema: hil/duts/1
duts:
- {serial: SN1, part: P1, model: QM, hardware: A, firmware: "", title: Gyroscope}
"""
CERTIFICATE = b"Certificate C-1\n"
RANGE = {"from": "-10.0", "to": "10.0", "absolute": "0.01", "relative": "0.0", "k": "2.0"}
CALIBRATION = {
    "psu1": FrozenCalibration(
        certificate="C-1",
        due="2026-12-31",
        sha256=hashlib.sha256(CERTIFICATE).hexdigest(),
        size=len(CERTIFICATE),
        ranges=(msgspec.convert({"quantity": "rate", "unit": "deg/s", **RANGE}, FrozenRange),),
    )
}
SOFTWARE = {
    "format": 1,
    "hil": {"commit": {"id": "1" * 40, "changed": False}},
    "workspace": {"commit": {"id": "2" * 40, "changed": False}},
    "flags": {"optimize": 0},
}
OF_ALL_RUNS = {
    "data/bench/bench.yaml": BENCH_FILE.encode(),
    "data/bench/C-1": CERTIFICATE,
    "data/bench/duts.yaml": DUTS_FILE.encode(),
    "data/catalogue/gyro/requirements.yaml": REQUIREMENTS_FILE.encode(),
    "data/dut.json": canonical({**DUT, "format": 1}),
    "data/sources/testplans/gyro/test_rest.py": b"def test_rest(): ...\n",
    PARAMETERS: canonical({"format": 1, "plans": {"gyro": []}}),
}
WRITTEN_BY_THE_RUN = (CATALOGUE_FILE, CALIBRATION_FILE, RESULTS, TRANSCRIPT, "data/recordings/001-rest.h5")
OF_THIS_PLACE = {
    "data/place.json": b'{"format":1,"host":"here","workspace":{"fixtures":"fixtures","testplans":"testplans"}}',
    "data/software.json": canonical(SOFTWARE),
}


def stamps(day: str = "2026-11-21"):
    """Return a wall clock of its own: a second later every time it is looked at."""
    seconds = itertools.count()

    def stamp():
        minute, second = divmod(next(seconds), 60)
        return WallStamp(utc=f"{day}T10:{minute:02d}:{second:02d}.000000Z", boot=1.5, boot_id="one-boot")

    return stamp


def supervised(stamp):
    """Return how a journal is stamped whose supervisor reads the same clocks."""
    latest = []

    def stamped():
        latest[:] = [stamp()]
        return latest[0]

    return {"stamp": stamped, "supervisor": lambda: latest[0]}


def run_fields(**changes):
    """Return the fields of the `run` event."""
    fields = {
        "format": 1, "bench": "flight", "source": "hardware", "purpose": "qualification", "dut": DUT, "operator": "Ada",
        "plans": ["gyro"], "seed": "7", "catalogue": "0" * 64, "parameters": "0" * 64, "calibration": "0" * 64,
        "sources": "0" * 64, "bench_files": "0" * 64, "version": "0.1.0", "overrides": {}, "skips": {},
        "deviations": [], "live": {"speed": 1.0, "served": False},
    }  # fmt: skip
    return fields | changes


def planned(case: str = "test_rest", requirements=("GYR-010", "GYR-030"), plan: str = "gyro"):
    """Return one case of the `planned` event."""
    return {
        "case": case, "title": f"{case}.", "plan": plan, "requirements": list(requirements), "max_duration": 60.0,
    }  # fmt: skip


def frozen_hashes(folder: Path) -> dict[str, str]:
    """Return the hashes that the `run` event has of what is frozen in a run's folder."""
    data = folder / "data"
    catalogue = {path: f"testplans/{path.parent.name}/{path.name}" for path in data.glob("catalogue/*/*")}
    sources = {path: str(path.relative_to(data / "sources")) for path in data.glob("sources/**/*.*")}
    bench = {path: str(path.relative_to(data / "bench")) for path in data.glob("bench/*")}
    own = {path: shown for path, shown in bench.items() if shown not in {"calibration.json", "duts.yaml"}}
    return {
        "catalogue": _hash(folder / CATALOGUE_FILE),
        "parameters": _hash(folder / PARAMETERS),
        "calibration": _hash(folder / CALIBRATION_FILE),
        "sources": _hash_over(catalogue | sources),
        "bench_files": _hash_over(own),
    }


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _hash_over(files: dict[Path, str]) -> str:
    lines = sorted((shown, f"{_hash(path)}  {shown}\n") for path, shown in files.items())
    return hashlib.sha256("".join(line for _, line in lines).encode()).hexdigest()


def begin(
    folder: Path,
    *,
    files: Mapping[str, bytes] = MappingProxyType({}),
    requirements=REQUIREMENTS,
    cases=None,
    stamp=None,
    **changes,
) -> Journal:
    """Write what stands in a journal before the first case, freeze everything, and return the journal.

    Args:
        folder: the run's folder.
        files: frozen files, by path, that are others than usual.
        requirements: what is frozen as the catalogue.
        cases: the planned cases, one by default.
        stamp: the wall clock.
        changes: fields of the `run` event that are others than usual.
    """
    folder.joinpath(RECORDINGS).mkdir(parents=True, exist_ok=True)
    freeze_catalogue(folder, entries_of(requirements))
    freeze_calibration(folder, CALIBRATION)
    for path, data in {**OF_ALL_RUNS, **OF_THIS_PLACE, **files}.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(data)
    named = inventory(folder)
    beside = {path: named.pop(path) for path in OF_THIS_PLACE}
    (folder / TRANSCRIPT).write_bytes(b"hil/transcript/1\n")
    journal = Journal(folder / JOURNAL, reserve=folder / RESERVE, **supervised(stamp or stamps()))
    journal.write(event_of("run", **run_fields(**(frozen_hashes(folder) | changes))), 0.0)
    journal.write(event_of("frozen", files=named), 0.0, beside={"files": beside})
    journal.write(event_of("planned", cases=cases or [planned()]), 0.0)
    port = {"name": "source of psu1", "detail": "/dev/psu1", "instrument": "psu1", "source": "hardware"}
    journal.write(event_of("host-gate", ok=True, **port), 0.0)
    journal.write(event_of("gate", name="identity of psu1", ok=True, detail="PSU 1", instrument="psu1"), 0.0)
    journal.write(event_of("gate", name="envelope supply.voltage", ok=True, detail="trips"), 0.0)
    journal.write(event_of("armed"), 0.0)
    return journal


def record(folder: Path, journal: Journal, rows: int = 100, *, identifier: str = "001-rest", complete: bool = True):
    """Record `rows` rows of one channel, and end the recording."""
    channels = [{"name": "x", "unit": "deg/s", "instrument": "psu1", "calibration": "C-1", "uncertainty": None}]
    journal.write(
        event_of(
            "recording",
            case="test_rest",
            step="1",
            recording=identifier,
            name="rest",
            channels=channels,
            rate=100.0,
            duration=1.0,
            source="hardware",
        ),
        1.0,
    )
    file = Rows(
        folder / RECORDINGS / f"{identifier}.rows",
        recording=identifier,
        channels=[("x", "deg/s")],
        on_block=lambda count, digest: journal.write(
            event_of("rows", recording=identifier, rows=count, sha256=digest), 1.0
        ),
    )
    for index in range(rows):
        file.append((1.0 + index / 100, float("nan") if index == 3 else index / 7))
    end = file.finish()
    journal.write(
        event_of(
            "recording-end",
            recording=identifier,
            rows=end.rows,
            sha256=end.sha256,
            complete=complete,
            gaps=end.largest_gap_s,
        ),
        2.0,
    )


def check(journal: Journal, measured: float | None = 0.1, *, of: str = "x", **changes):
    """Judge a rate error and write the check down; `changes` are what a liar would write."""
    value = float("nan") if measured is None else measured
    figure = Figure(value=value, unit="deg/s", uncertainty=0.01)
    judged = judge(figure, LIMIT)
    fields = {
        "case": "test_rest", "step": "1", "requirement": "GYR-030", "parameter": "rate_error", "of": of,
        "value": measured, "unit": "deg/s", "uncertainty": judged.uncertainty, "dof": None,
        "limit": {"min": "-0.5", "max": "0.5", "equals": None}, "limit_unit": "deg/s", "decision": "guarded",
        "expanded": judged.expanded, "margin": judged.margin, "tur": judged.tur, "verdict": judged.verdict,
        "reason": judged.reason, "instruments": ["psu1"],
    }  # fmt: skip
    journal.write(event_of("check", **fields | changes), 3.0)


def recorded_check(journal: Journal):
    """Write down that the recording is there."""
    fields = {
        "requirement": "GYR-010", "parameter": "channels", "of": None, "value": "complete", "unit": "",
        "uncertainty": None, "limit": {"min": None, "max": None, "equals": "complete"}, "limit_unit": "",
        "decision": "simple", "expanded": None, "margin": None, "tur": None, "verdict": "RECORDED", "instruments": [],
    }  # fmt: skip
    check(journal, **(fields | {"of": None}))


def case_end(journal: Journal, verdict: str = "PASS", **changes):
    """End the case."""
    fields = {
        "case": "test_rest", "attempt": 1, "verdict": verdict, "reasons": [], "duration": 4.0,
        "requirements": {"GYR-010": "RECORDED", "GYR-030": verdict}, "used": {"psu1": "hardware"},
    }  # fmt: skip
    journal.write(event_of("case-end", **fields | changes), 4.0)


def whole_case(folder: Path, journal: Journal) -> None:
    """Run the case from its beginning to its end."""
    journal.write(event_of("case", case="test_rest", attempt=1), 0.0)
    journal.write(event_of("step", case="test_rest", path=["Hold"], number="1"), 0.0)
    record(folder, journal)
    check(journal, of="x")
    check(journal, -0.2, of="y")
    recorded_check(journal)
    journal.write(event_of("step-end", case="test_rest", path=["Hold"], number="1", outcome="done", duration=4.0), 4.0)
    case_end(journal)
    journal.write(event_of("safe-end", ok=True), 5.0)


def write_report(package: Package) -> None:
    """Write a report of one line."""
    (package.folder / "data/report").mkdir(exist_ok=True)
    (package.folder / "data/report/report.html").write_text("<p>report</p>\n", encoding="utf-8")


def sealed_run(folder: Path, **changes) -> str:
    """Write a whole run, seal it, and return its evidence digest; `changes` are those of `begin`."""
    journal = begin(folder, **changes)
    whole_case(folder, journal)
    return seal(folder, journal, exit_code=0, write_reports=write_report)


def writable_copy(sealed: Path, reports: Path) -> Path:
    """Copy a sealed package into a folder of reports, under its own name, and return the copy; it may be changed."""
    copy = shutil.copytree(sealed, reports / sealed.name, copy_function=shutil.copyfile)
    for path in (copy, *copy.rglob("*")):
        path.chmod(0o755)
    return copy
