"""The register of instruments: read whole, and everything that is wrong at once, with its place."""

from __future__ import annotations

import hashlib

import pytest

from hil.documents.findings import Findings
from hil.registers.instruments import AsFound, AsLeft, file_problem, load_instruments

SHA = hashlib.sha256(b"certificate").hexdigest()
GOOD = f"""schema: hil/instruments/1
instruments:
  DMM-017:
    maker: Keysight Technologies
    model: 34465A
    serial: MY54500123
    title: Bench multimeter
    certificates:
    - number: K-2025-1
      laboratory: Metrology Ltd
      file: certificates/dmm-1.pdf
      sha256: {SHA}
      date: "2025-09-30"
      due: "2026-09-30"
      as_found: not stated
      as_left: in tolerance
      ranges: []
    - number: K-2026-7
      laboratory: Metrology Ltd
      file: certificates/dmm-2.pdf
      sha256: {SHA}
      date: "2026-09-28"
      due: "2027-09-28"
      as_found: in tolerance
      as_left: adjusted
      ranges:
      - {{quantity: voltage, unit: V, from: "-10", to: "10", absolute: "0.001", relative: "0.0002", k: "2"}}
"""
OTHER = """  DMM-018: {maker: Keysight Technologies, model: 34465A, serial: MY54500123}
"""


def load(tmp_path, text: str):
    """Return what a register holds, and what is wrong with it."""
    (tmp_path / "instruments.yaml").write_text(text, encoding="utf-8")
    findings = Findings()
    found = load_instruments(tmp_path / "instruments.yaml", "fixtures/instruments.yaml", findings)
    return found, [str(finding).removeprefix("fixtures/instruments.yaml:") for finding in findings]


def test_register_is_read_whole(tmp_path):
    """Every field arrives, and the newest certificate is the one that a bench uses."""
    found, wrong = load(tmp_path, GOOD + OTHER.replace("MY54500123", "MY54500124"))
    assert wrong == []
    meter = found["DMM-017"]
    assert (meter.maker, meter.model, meter.serial) == ("Keysight Technologies", "34465A", "MY54500123")
    first, second = meter.certificates
    assert (first.as_found, first.as_left, second.as_left) == (AsFound.NOT_STATED, AsLeft.IN_TOLERANCE, AsLeft.ADJUSTED)
    assert (second.laboratory, second.sha256, second.date, second.due) == (
        "Metrology Ltd",
        SHA,
        "2026-09-28",
        "2027-09-28",
    )
    calibration = meter.calibration
    assert calibration is not None
    assert (calibration.certificate, calibration.due) == ("certificates/dmm-2.pdf", "2027-09-28")
    assert [(each.low, each.high, each.k) for each in calibration.ranges] == [(-10.0, 10.0, 2.0)]
    assert found["DMM-018"].calibration is None


def test_workspace_without_a_register(tmp_path):
    """A workspace need not have one: inline records do without."""
    findings = Findings()
    assert load_instruments(tmp_path / "instruments.yaml", "fixtures/instruments.yaml", findings) == {}
    assert list(findings) == []


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "laboratory: Metrology Ltd\n      file: certificates/dmm-1",
            "labratory: X\n      file: a",
            "10:7: unknown key 'l",
        ),
        (SHA, "abc", "12:15: certificates: 'sha256' must be a SHA-256: 64 digits of 0-9 and a-f, found `abc`"),
        ("as_left: adjusted", "as_left: ajusted", "'as_left' must be one of in tolerance, adjusted, out of tolerance"),
        ('"2025-09-30"', '"2025-02-30"', "13:13: DMM-017: the date 2025-02-30 does not exist"),
        ('due: "2026-09-30"', 'due: "2025-09-29"', "14:12: DMM-017: certificate K-2025-1 is due on 2025-09-29, before"),
        ("K-2026-7", "K-2025-1", "9:15: DMM-017: certificate K-2025-1 is there twice"),
        (
            'date: "2026-09-28"',
            'date: "2025-09-01"',
            "DMM-017: certificate K-2026-7 of 2025-09-01 stands after that of",
        ),
        ('from: "-10"', 'from: "11"', "DMM-017: the range begins at 11 V and ends below, at 10; exchange from and to"),
        ("serial: MY54500123\n", 'serial: ""\n', "6:13: instruments DMM-017: 'serial' must not be empty"),
    ],
)
def test_wrong_entry_has_a_place(tmp_path, old, new, message):
    """What cannot be is told at its line and column, with the word that was meant."""
    assert old in GOOD
    _, wrong = load(tmp_path, GOOD.replace(old, new, 1))
    assert any(message in line for line in wrong), wrong


def test_all_that_is_wrong_is_told_at_once(tmp_path):
    """Several mistakes in several entries: each is told, and one instrument under two names is, too."""
    _, wrong = load(tmp_path, GOOD.replace('"2025-09-30"', '"2025-13-30"').replace("adjusted", "new") + OTHER)
    assert len(wrong) == 3
    assert any("DMM-018 is the same instrument as DMM-017" in line for line in wrong)


def test_a_second_entry_does_not_hide_a_certificate(tmp_path):
    """One that spells maker and model otherwise, and has a certificate that found nothing wrong."""
    _, wrong = load(tmp_path, GOOD + OTHER.replace("Keysight Technologies, model: 34465A", "Agilent, model: 34465a"))
    assert [line.partition(": ")[2] for line in wrong] == ["DMM-018 is the same instrument as DMM-017"]


@pytest.mark.parametrize(
    ("content", "path", "problem"),
    [
        (b"certificate", "certificates/dmm-2.pdf", ""),
        (b"other bytes", "certificates/dmm-2.pdf", "has another SHA-256 than the register says"),
        (b"", "certificates/dmm-2.pdf", "is empty"),
        (None, "certificates/dmm-2.pdf", "is missing"),
        (None, "../dmm-2.pdf", "is not below fixtures"),
    ],
)
def test_file_of_a_certificate(tmp_path, content, path, problem):
    """A certificate is its bytes: missing, empty, changed or outside of the fixtures it proves nothing."""
    found, _ = load(tmp_path, GOOD.replace("certificates/dmm-2.pdf", path))
    fixtures = tmp_path / "fixtures"
    (fixtures / "certificates").mkdir(parents=True)
    if content is not None:
        (fixtures / path).write_bytes(content)
    newest = found["DMM-017"].latest
    assert newest is not None
    said = file_problem(fixtures, newest)
    assert said == (f"the file {path} of certificate K-2026-7 {problem}" if problem else "")
