"""What a run freezes of the registers: entries and certificates that its bench uses, and what was done to its unit."""

from __future__ import annotations

import hashlib
import json
import shutil

from workspaces import ROOT

from hil.evidence.results.facts import FrozenCalibration
from hil.executive.setup.configuration import Request, configure
from hil.executive.setup.head import freeze
from hil.model.identity import Source

OWN = """    calibration:
      certificate: certificates/tec1.txt
      due: "2027-09-30"
      ranges:
      - {quantity: temperature, unit: degC, from: "-30", to: "60", absolute: "0.2"}
"""
"""The calibration of an instrument that is in no register."""
EVENT = 'events: [{kind: repair, date: "2026-05-02", text: New leads, reference: NCR-1, reverify: true}],\n   title'


def test_registers_are_frozen_with_what_the_bench_uses(tmp_path):
    """Register, certificate with its hash, serial number and dates: an auditor needs nothing but the package."""
    root = tmp_path / "workspace"
    shutil.copytree(ROOT / "fixtures", root / "fixtures", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "testplans/battery_charge", root / "testplans/battery_charge")
    shutil.copy(ROOT / "testplans/requirements.yaml", root / "testplans")
    (root / "hil.toml").touch()
    duts = root / "fixtures/duts.yaml"
    text, title = duts.read_text(encoding="utf-8"), 'title: "Lithium'
    assert title in text
    duts.write_text(text.replace(title, f"{EVENT}{title.removeprefix('title')}"), encoding="utf-8")
    bench = root / "fixtures/benches/battery/bench.yaml"
    bench.write_text(bench.read_text(encoding="utf-8").replace("    register: TEC-01\n", OWN), encoding="utf-8")
    package = tmp_path / "package"
    (package / "data").mkdir(parents=True)
    request = Request(start=root, plans=("battery_charge",), bench="battery", dut="SIM-BAT-1", source=Source.SIMULATED)
    frozen = freeze(configure(request), package)
    certificate = (root / "fixtures/certificates/psu-01-2026.txt").read_bytes()
    assert (package / "data/registers/certificates/psu-01-2026.txt").read_bytes() == certificate
    assert "data/registers/instruments.yaml" in frozen.files
    records = json.loads((package / "data/bench/calibration.json").read_bytes())["instruments"]
    psu1, tec1 = (FrozenCalibration(**records[name]) for name in ("psu1", "tec1"))
    assert (psu1.register, psu1.serial, psu1.number) == ("PSU-01", "DP8C231402017", "SPECIMEN-2026-1")
    assert (psu1.date, psu1.due, psu1.as_left) == ("2026-09-30", "2027-09-30", "in tolerance")
    assert (psu1.sha256, psu1.size) == (hashlib.sha256(certificate).hexdigest(), len(certificate))
    assert psu1.ranges is not None
    assert len(psu1.ranges) == 2
    assert (tec1.register, tec1.certificate, tec1.due) == ("", "certificates/tec1.txt", "2027-09-30")
    assert tec1.sha256 == hashlib.sha256((package / "data/bench/certificates/tec1.txt").read_bytes()).hexdigest()
    for name, entry in (("cycler1", "TESTER-01"), ("psu2", "PSU-02")):
        file = f"data/registers/benches/battery/certificates/{name}.txt"
        found = FrozenCalibration(**records[name])
        assert (found.register, found.sha256) == (entry, hashlib.sha256((package / file).read_bytes()).hexdigest())
    (event,) = json.loads((package / "data/dut.json").read_bytes())["events"]
    assert (event["kind"], event["date"], event["reverify"]) == ("repair", "2026-05-02", True)
