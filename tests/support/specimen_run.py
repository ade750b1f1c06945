"""A run made by hand, with something of everything, sealed by the product's own means."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from typed_events import event_of

from hil.clock.wall import WallStamp
from hil.evidence.journal.writer import Journal
from hil.evidence.package.sealing import seal
from hil.evidence.recordings.rows import Rows
from hil.evidence.results.facts import FrozenCalibration, FrozenRequirement, freeze_calibration, freeze_catalogue
from hil.report.write import write_reports

NAME = "20261121T053012Z-flatsat-GYR-007-3fa9c1"
CASES = {
    "rest": "testplans/gyroscope/test_rest.py::test_noise_at_rest",
    "rate": "testplans/gyroscope/test_rate.py::test_rate_error[45 degC]",
    "power": "testplans/gyroscope/test_rate.py::test_supply_current",
    "cold": "testplans/gyroscope/test_rate.py::test_rate_error[10 degC]",
    "extra": "testplans/gyroscope/test_extra.py::test_blink",
}
REQUIREMENTS: dict[str, dict[str, Any]] = {
    "ADCS-GYR-010": {
        "rev": 1,
        "text": "Each gyroscope axis shall be recorded at rest for ten minutes at 10 Hz without a gap over 0.2 s.",
        "kind": "record",
        "method": "test",
        "source": "ADCS specification, section 30",
    },
    "ADCS-GYR-011": {
        "rev": 2,
        "text": "The angle random walk of each axis shall be characterised at rest.",
        "kind": "characterise",
        "method": "test",
        "source": "ADCS specification, section 31",
    },
    "ADCS-GYR-030": {
        "rev": 1,
        "text": "The calibrated rate shall differ from the true rate by less than 0.5 deg/s from 10 to 45 degC.",
        "kind": "limit",
        "method": "test",
        "source": "ADCS specification, section 32",
    },
    "ADCS-GYR-040": {
        "rev": 1,
        "text": "The board shall draw less than 12 mA.",
        "kind": "limit",
        "method": "test",
        "source": "EPS budget, line 7",
    },
}
BENCH = """schema: hil/bench/1
bench: {name: flatsat, title: Flat satellite in the clean room, place: "Clean room 2, table B"}
instruments:
  psu1:
    driver: keysight-e36300
    port: "socket://psu1:5025"
    identity: {manufacturer: Keysight, model: E36313A, serial: MY59002117}
    calibration:
      certificate: K-2026-0418
      due: "2027-04-18"
      ranges:
      - {quantity: current, unit: A, from: "0", to: "2", absolute: "0.0004", relative: "0.0005"}
      - {quantity: voltage, unit: V, from: "0", to: "25", absolute: "0.003", relative: "0.0003"}
  table1:
    driver: ideal-aerosmith-1291
    port: "/dev/serial/by-id/table"
    calibration: {certificate: R-77-2026, due: "2026-12-31", ranges: []}
  gyro:
    driver: bmi270
    bus: main
    address: 104
    dut: true
wiring:
- {role: supply, instance: board, instrument: psu1, channel: 2, note: "5 V, fuse 500 mA, red to J1.1"}
- {role: rotation_table, instrument: table1, settings: {turns: "400"}}
- {role: gyroscope, instrument: gyro}
"""
PARAMETERS = """schema: hil/parameters/1
parameters:
- {name: rest_duration, value: "14400", unit: s, text: How long the board is left alone.}
- {name: rates, values: ["-50", "50"], unit: deg/s}
"""
PLAN = """schema: hil/requirements/1
document: {id: ADCS-GYR, issue: "1.3", title: Gyroscope characterisation}
requirements:
- id: ADCS-GYR-030
  parents: [ADCS-001]
  level: equipment
  stage: qualification
  over: {temperature: ["10", "45"]}
  limits:
  - {parameter: rate_error, of: [x, y, z], unit: deg/s, min: "-0.5", max: "0.5", decision: guarded, min_tur: "2"}
  anomaly: The source gives the equation of axis x with the wrong sign.
"""
Event = tuple[str, float, dict[str, Any]]


def stamps() -> Callable[[], WallStamp]:
    """Return a wall clock that goes one second per event."""
    ticks = iter(range(10_000_000))

    def stamp() -> WallStamp:
        tick = next(ticks)
        utc = f"2026-11-21T{5 + tick // 3600:02d}:{tick // 60 % 60:02d}:{tick % 60:02d}.000000Z"
        return WallStamp(utc=utc, boot=float(tick), boot_id="b")

    return stamp


def build(
    reports: Path, *, run: dict[str, Any] | None = None, events: list[Event] | None = None, rows: int = 6000
) -> Path:
    """Make and seal a run, and return its folder.

    Args:
        reports: where the folder is made.
        run: fields of the `run` event that differ.
        events: what happens between `run` and the end; the ordinary specimen if not given.
        rows: how many rows its recording has.
    """
    folder = reports / NAME
    journal = begin(folder)
    journal.write(event_of("run", **run_body() | (run or {})), 0.0)
    for kind, t, fields in happened() if events is None else events:
        if kind == "samples":
            record(folder, journal, t, rows)
        else:
            journal.write(event_of(kind, **fields), t)
    seal(folder, journal, exit_code=1, write_reports=write_reports)
    return folder


def begin(folder: Path) -> Journal:
    """Make the folder with what is frozen before the first step, and return its journal."""
    for inner in ("data/recordings", "data/catalogue/gyroscope", "data/bench", "data/attachments", "inbox"):
        (folder / inner).mkdir(parents=True)
    freeze_catalogue(folder, msgspec.convert(REQUIREMENTS, dict[str, FrozenRequirement]))
    freeze_calibration(folder, {"psu1": FrozenCalibration(certificate="K-2026-0418", due="2027-04-18")})
    (folder / "data/bench/bench.yaml").write_text(BENCH, encoding="utf-8")
    (folder / "data/catalogue/gyroscope/parameters.yaml").write_text(PARAMETERS, encoding="utf-8")
    (folder / "data/catalogue/gyroscope/requirements.yaml").write_text(PLAN, encoding="utf-8")
    software = {"commit": "5f0c2d9e", "dirty": False, "python": "3.11.7", "numeric": {"blas": "openblas Haswell"}}
    (folder / "data/software.json").write_text(json.dumps(software), encoding="utf-8")
    (folder / "data/place.json").write_text(json.dumps({"host": "bench-pc", "user": "amolla"}), encoding="utf-8")
    return Journal(folder / "data/journal.jsonl", stamp=stamps())


def run_body() -> dict[str, Any]:
    """Return the `run` event of the ordinary specimen."""
    return {
        "format": 1,
        "bench": "flatsat",
        "source": "simulated",
        "purpose": "qualification",
        "dut": {
            "serial": "GYR-007",
            "part": "SUB-GYR-3",
            "model": "QM",
            "hardware": "C",
            "firmware": "",
            "title": "Gyroscope board",
        },
        "operator": "Ada Molla",
        "plans": ["gyroscope"],
        "seed": "20261121",
        "catalogue": "a" * 64,
        "parameters": "b" * 64,
        "sources": "c" * 64,
        "version": "0.1.0",
        "deviations": ["parameter gyroscope.rest_duration is 600 s, the plan says 14400 s"],
    }


def check(t: float, case: str, requirement: str, parameter: str, **fields: Any) -> Event:
    """Return a check event; what is not given is what an ordinary limit check has."""
    ordinary = {
        "step": "",
        "of": None,
        "value": 0.0,
        "unit": "deg/s",
        "uncertainty": 0.05,
        "dof": None,
        "limit": {"min": "-0.5", "max": "0.5", "equals": None},
        "limit_unit": "deg/s",
        "decision": "guarded",
        "expanded": 0.098,
        "margin": 0.4,
        "tur": 5.1,
        "verdict": "PASS",
        "reason": "",
        "instruments": ["gyro", "table1"],
    }
    return "check", t, {"case": case, "requirement": requirement, "parameter": parameter} | ordinary | fields


def planned() -> Event:
    """Return the plan of the ordinary specimen."""
    titles = {
        "rest": "Allan deviation of every axis over ten minutes at rest.",
        "rate": "Rate error at both ends of the range, hot.",
        "power": "Supply current at 5 V.",
        "cold": "Rate error at both ends of the range, cold.",
        "extra": "The lamp blinks.",
    }
    ids = {"rest": ["ADCS-GYR-010", "ADCS-GYR-011"], "power": ["ADCS-GYR-040"], "extra": []}
    cases = [
        {
            "case": CASES[key],
            "title": title,
            "plan": "gyroscope",
            "requirements": ids.get(key, ["ADCS-GYR-030"]),
            "max_duration": 3600.0,
        }
        for key, title in titles.items()
    ]
    return "planned", 0.0, {"cases": cases}


def happened() -> Iterator[Event]:
    """Give everything between `run` and the end of the ordinary specimen."""
    yield planned()
    yield "orphan", 0.0, {"cases": [CASES["extra"]]}
    yield from _armed()
    yield from _rest()
    yield from _rate()
    yield from _power()
    yield "not-run", 900.0, {"case": CASES["cold"], "reason": "skipped: the chamber is away (--skip)"}
    yield "case", 900.0, {"case": CASES["extra"], "attempt": 1}
    yield "case-end", 901.0, _end("extra", "PASS", {}, 1.0)
    yield "note", 902.0, {"text": "Fan of the chamber is loud today.", "by": "Jane Doe"}
    yield "safe", 903.0, _safe("rotation_table", "at rest", "encoder 0.0 deg/s", 2.1)
    yield "safe", 903.4, _safe("supply.board", "off", "current 0.0001 A, below 0.005 A", 0.4)
    yield "safe-end", 904.0, {"ok": True}


def _safe(output: str, state: str, detail: str, took: float) -> dict[str, Any]:
    return {"output": output, "state": state, "ok": True, "detail": detail, "duration": took}


def _armed() -> Iterator[Event]:
    gates = {
        "identity psu1": "Keysight E36313A MY59002117",
        "found-off supply.board": "0.0000 V, off",
        "reduced-level supply.board": "1.000 V set, 0.9997 V read, positive",
        "envelope self-test": "board-current tripped at 0.51 A as it must",
    }
    for name, detail in gates.items():
        yield "gate", 1.0, {"name": name, "ok": True, "detail": detail}
    yield "armed", 2.0, {}


def _step(case: str, number: str, begin: float, end: float, *path: str) -> tuple[Event, Event]:
    where = {"case": CASES[case], "path": list(path), "number": number}
    return ("step", begin, where), ("step-end", end, where | {"outcome": "done", "duration": end - begin})


def _end(case: str, verdict: str, requirements: dict[str, str], duration: float, *reasons: str) -> dict[str, Any]:
    return {
        "case": CASES[case],
        "attempt": 1,
        "verdict": verdict,
        "reasons": list(reasons),
        "requirements": requirements,
        "duration": duration,
        "used": {"psu1": "simulated", "gyro": "simulated"},
    }


def _rest() -> Iterator[Event]:
    case = CASES["rest"]
    yield "case", 3.0, {"case": case, "attempt": 1}
    begin, end = _step("rest", "1", 3.0, 60.0, "Hold the board at ambient temperature")
    yield begin
    where = {"case": case, "step": "1", "name": "operator.confirm"}
    asked = where | {"form": "confirm"}
    yield "question", 3.0, asked | {"text": "Is the board free of the table's clamps?", "options": []}
    yield "answer", 4.0, where | {"value": True, "by": "Ada Molla"}
    drive = {"case": case, "step": "1", "name": "supply.board.configure", "ordinal": 1, "effect": "drives"}
    yield "effect", 5.0, drive | {"arguments": {"voltage": 5.0, "current": 0.1}, "result": None}
    yield "effect", 6.0, drive | {"name": "supply.board.on", "arguments": {}, "result": None}
    yield end
    begin, end = _step("rest", "2", 60.0, 660.0, "Record the gyroscope at rest")
    yield begin
    yield "samples", 60.0, {}
    yield end
    nothing = {"min": None, "max": None, "equals": None}
    recorded = {
        "limit": nothing,
        "margin": None,
        "tur": None,
        "verdict": "RECORDED",
        "instruments": ["gyro"],
        "step": "2",
    }
    for axis, value in (("x", 0.00412), ("y", 0.00398), ("z", 0.00531)):
        known = {"unit": "deg/sqrt(s)", "limit_unit": "deg/sqrt(s)", "uncertainty": 0.00011, "expanded": 0.00022}
        yield check(660.0, case, "ADCS-GYR-011", "angle_random_walk", of=axis, value=value, **known, **recorded)
    word = {"unit": "", "limit_unit": "", "uncertainty": None, "expanded": None}
    yield check(660.0, case, "ADCS-GYR-010", "rest", value="complete", **word, **recorded)
    done = {"ADCS-GYR-010": "RECORDED", "ADCS-GYR-011": "RECORDED"}
    yield "case-end", 661.0, _end("rest", "PASS", done, 658.0)


def _rate() -> Iterator[Event]:
    case = CASES["rate"]
    yield "case", 662.0, {"case": case, "attempt": 1}
    begin, end = _step("rate", "1", 662.0, 800.0, "Turn the table at both ends of the range")
    inner, inner_end = _step("rate", "1.1", 663.0, 720.0, "Turn the table at both ends of the range", "50 deg/s")
    yield begin
    yield inner
    turn = {"case": case, "step": "1.1", "name": "rotation_table.turn", "ordinal": 1, "effect": "drives"}
    yield "effect", 663.0, turn | {"arguments": {"rate": 50.0}, "result": None}
    near = "inside the limit, but closer to it than the expanded uncertainty"
    far = "outside the limit by more than the expanded uncertainty"
    of_rate = ("ADCS-GYR-030", "rate_error")
    yield check(720.0, case, *of_rate, of="x", step="1.1", value=0.0871234, margin=0.315)
    yield check(
        720.0, case, *of_rate, of="y", step="1.1", value=0.4612, margin=-0.0592, verdict="INCONCLUSIVE", reason=near
    )
    yield check(720.0, case, *of_rate, of="z", step="1.1", value=-0.7123, margin=-0.310, verdict="FAIL", reason=far)
    yield inner_end
    yield end
    yield "anomaly", 721.0, {"text": "the table overshot its rate by 0.3 deg/s for 0.2 s"}
    yield "case-end", 801.0, _end("rate", "FAIL", {"ADCS-GYR-030": "FAIL"}, 139.0, "1 check failed")


def _power() -> Iterator[Event]:
    case = CASES["power"]
    yield "case", 802.0, {"case": case, "attempt": 1}
    drawn = {"value": 0.01013, "unit": "A", "uncertainty": 0.0002, "expanded": 0.00039, "margin": 0.00148}
    most = {"limit": {"min": None, "max": "0.012", "equals": None}, "limit_unit": "A", "tur": None}
    yield check(803.0, case, "ADCS-GYR-040", "current", **drawn, **most, instruments=["psu1"])
    yield "case-end", 804.0, _end("power", "PASS", {"ADCS-GYR-040": "PASS"}, 2.0)


def record(folder: Path, journal: Journal, begin: float, rows: int) -> None:
    """Record the gyroscope at rest: three axes and a temperature at 10 Hz."""
    channels = [("x", "deg/s"), ("y", "deg/s"), ("z", "deg/s"), ("temperature", "degC")]
    where = {"case": CASES["rest"], "step": "2", "recording": "rest-1", "name": "rest"}
    told = [
        {"name": name, "unit": unit, "instrument": "gyro", "calibration": "", "uncertainty": None}
        for name, unit in channels
    ]
    journal.write(
        event_of("recording", **where, channels=told, rate=10.0, duration=rows / 10.0, source="simulated"), begin
    )
    noise = np.random.default_rng(7).normal([0.1, -0.05, 0.02], 0.05, (rows, 3))
    file = Rows(
        folder / "data/recordings/rest-1.rows",
        recording="rest-1",
        channels=channels,
        on_block=lambda count, digest: _block(journal, begin, count, digest),
        now=lambda: 0.0,
    )
    for index, (x, y, z) in enumerate(noise):
        file.append((begin + index / 10.0, x, y, z, 25.0 + np.sin(index / 900.0)))
    end = file.finish()
    journal.write(
        event_of(
            "recording-end",
            recording="rest-1",
            rows=end.rows,
            sha256=end.sha256,
            complete=True,
            gaps=round(end.largest_gap_s, 9),
        ),
        begin + rows / 10.0,
    )


def _block(journal: Journal, t: float, count: int, digest: str) -> None:
    journal.write(event_of("rows", recording="rest-1", rows=count, sha256=digest), t)
