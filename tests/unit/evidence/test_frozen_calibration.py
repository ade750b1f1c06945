"""What a frozen calibration record says about measurements of a day."""

from __future__ import annotations

import json

import pytest

from hil.evidence.events.codec import convert
from hil.evidence.folder import CALIBRATION
from hil.evidence.results.facts import FrozenCalibration, FrozenRange, freeze_calibration

RANGE = FrozenRange(quantity="voltage", unit="V", low="-1.0", high="30.0", absolute="0.003", relative="0.0005", k="2.0")
GOOD = {
    "certificate": "certificates/psu-01.pdf",
    "due": "2027-09-30",
    "sha256": "0" * 64,
    "size": 5,
    "ranges": (RANGE,),
    "register": "PSU-01",
    "date": "2026-09-30",
    "as_left": "in tolerance",
}


@pytest.mark.parametrize(
    ("changes", "first", "last", "problems"),
    [
        ({}, "2026-09-30T00:00:00Z", "2027-09-30T23:59:59Z", []),
        ({}, "2026-09-29T23:59:59Z", "2026-09-30", ["was used before its calibration: calibrated 2026-09-30, used"]),
        ({}, "2027-09-30", "2027-10-01T00:00:00Z", ["was out of calibration: due 2027-09-30, used 2027-10-01"]),
        ({"size": 0}, "2027-01-01", "2027-01-01", ["has an empty certificate, certificates/psu-01.pdf"]),
        ({"ranges": ()}, "2027-01-01", "2027-01-01", ["has a certificate without any range"]),
        ({"as_left": "out of tolerance"}, "2027-01-01", "2027-01-01", ["was returned out of tolerance"]),
        ({"certificate": "", "due": ""}, "2027-01-01", "2027-01-01", ["has no calibration record"]),
        ({"sha256": None, "size": None, "ranges": None, "date": ""}, "1999-01-01", "2027-01-01", []),
    ],
)
def test_certificate_counts_from_its_date_to_its_due_date(changes, first, last, problems):
    """Out of calibration by a second, used before the calibration, an empty certificate, one without ranges."""
    found = list(FrozenCalibration(**{**GOOD, **changes}).problems(first, last))
    assert len(found) == len(problems)
    assert all(words in sentence for words, sentence in zip(problems, found, strict=True)), found


def test_a_record_is_frozen_whole_and_older_ones_are_read(tmp_path):
    """Everything that the record holds comes back; a record of format 1 has what it had."""
    record = FrozenCalibration(**GOOD)
    freeze_calibration(tmp_path, {"psu1": record})
    written = json.loads((tmp_path / CALIBRATION).read_bytes())
    assert written["format"] == 2
    assert convert(written["instruments"]["psu1"], FrozenCalibration, "psu1") == record
    older = convert({"certificate": "c", "due": "2026-01-01", "dut": False}, FrozenCalibration, "psu1")
    assert (older.certificate, older.sha256, older.ranges) == ("c", None, None)
