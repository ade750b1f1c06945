"""What a certificate says of a reading, and until when."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan

import pytest
from adcs_bench import adcs

from hil.executive.cases.certificate import calibrated, standard_uncertainty, uncovered
from hil.model.bench import CalibratedRange, Calibration
from hil.model.figure import Figure

RECORD = Calibration(
    certificate="psu1.txt",
    due="2027-09-30",
    ranges=(
        CalibratedRange(quantity="current", unit="A", low=-0.02, high=0.02, absolute=8e-5, relative=0.0025),
        CalibratedRange(quantity="current", unit="A", low=-1, high=1, absolute=0.002, relative=0.0004, k=1.96),
        CalibratedRange(quantity="voltage", unit="V", low=0, high=25, absolute=0.005),
    ),
)


@pytest.mark.parametrize(
    ("unit", "value", "uncertainty"),
    [
        ("A", 0.016, (8e-5 + 0.0025 * 0.016) / 2),
        ("A", -0.016, (8e-5 + 0.0025 * 0.016) / 2),
        ("A", 0.02, (8e-5 + 0.0025 * 0.02) / 2),
        ("A", 0.0201, (0.002 + 0.0004 * 0.0201) / 1.96),
        ("A", -1, (0.002 + 0.0004) / 1.96),
        ("V", 5, 0.0025),
        ("A", 1.0001, None),
        ("V", -0.001, None),
        ("mA", 16, (8e-5 + 0.0025 * 0.016) / 2 * 1e3),
        ("mV", 5000, 2.5),
        ("ohm", 5, None),
        ("A", nan, None),
        ("A", inf, None),
    ],
)
def test_first_range_that_covers_the_reading_counts(unit, value, uncertainty):
    """The expanded uncertainty over its k, ends included; outside every range it is unknown."""
    found = standard_uncertainty(RECORD, unit, value)
    assert found == (uncertainty if uncertainty is None else pytest.approx(uncertainty, rel=1e-12))


def test_no_record_no_uncertainty():
    """An instrument without certificate does not know how good it is."""
    assert standard_uncertainty(None, "A", 0.1) is None
    assert calibrated(Figure(value=0.1, unit="A"), None).uncertainty is None


def test_reading_gets_the_certificates_uncertainty_and_keeps_its_own():
    """What the driver or the analysis knows is not overwritten, zero neither."""
    assert calibrated(Figure(value=5.0, unit="V"), RECORD) == Figure(value=5.0, unit="V", uncertainty=0.0025)
    for own in (0.0, 0.1):
        assert calibrated(Figure(value=5.0, unit="V", uncertainty=own), RECORD).uncertainty == own


def test_committed_certificates_cover_what_the_campaign_reads():
    """A coil current of 16 mA, 5 V and the Earth's field have an uncertainty."""
    spec = adcs()
    supply, sensor = spec.instrument("psu1").calibration, spec.instrument("mag1").calibration
    assert standard_uncertainty(supply, "A", 0.016) == pytest.approx(6e-5)
    assert standard_uncertainty(supply, "V", 5.0) == pytest.approx(0.0035)
    assert standard_uncertainty(sensor, "uT", -38.9) == pytest.approx(0.2945)


def test_a_difference_of_temperatures_needs_no_certificate_of_its_own():
    """A certificate in degC says what to do with K: the readings brought their uncertainties."""
    entry = CalibratedRange(quantity="temperature", unit="degC", low=-40, high=125, absolute=0.2)
    record = Calibration(certificate="psu1.txt", due="2027-09-30", ranges=(entry,))
    (told,) = uncovered(replace(adcs().instrument("psu1"), calibration=record), "K", 1.97)
    assert told.startswith("the certificate of psu1 covers nothing in K: a difference of temperatures has")
