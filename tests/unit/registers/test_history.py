"""What later certificates and events say about earlier evidence, on the boundary days."""

from __future__ import annotations

import pytest

from hil.model.identity import UnitEvent, UnitEventKind
from hil.registers.history import calibration_problem, doubts, events_after
from hil.registers.instruments import AsFound, AsLeft, Certificate, RegisteredInstrument

IN, OUT, UNKNOWN = AsFound.IN_TOLERANCE, AsFound.OUT_OF_TOLERANCE, AsFound.NOT_STATED


def certificate(date: str, as_found: AsFound = IN, as_left: AsLeft = AsLeft.IN_TOLERANCE) -> Certificate:
    """Return a certificate of a day, due a year later, numbered by its year."""
    year = int(date[:4])
    return Certificate(
        number=f"N-{year}",
        laboratory="Metrology Ltd",
        file="certificates/x.pdf",
        sha256="0" * 64,
        date=date,
        due=f"{year + 1}{date[4:]}",
        as_found=as_found,
        as_left=as_left,
        ranges=(),
    )


def meter(*certificates: Certificate) -> RegisteredInstrument:
    """Return an instrument with these certificates."""
    return RegisteredInstrument(id="DMM-017", maker="K", model="M", serial="1", certificates=certificates)


def spans(*certificates: Certificate) -> list[tuple[str, str]]:
    """Return first and last day of every interval in doubt."""
    return [(each.first, each.last) for each in doubts(meter(*certificates))]


def test_out_of_tolerance_as_found_reopens_back_to_the_last_good_certificate():
    """An instrument is found out of tolerance a year after a run that it measured: the run is in doubt."""
    first, second, third = (certificate(f"{year}-03-10") for year in (2024, 2025, 2026))
    third = certificate("2026-03-10", OUT, AsLeft.ADJUSTED)
    assert spans(first, second) == []
    assert spans(first, second, third) == [("2025-03-10", "2026-03-10")]
    (doubt,) = doubts(meter(first, second, third))
    assert doubt.reason == (
        "DMM-017 (certificate N-2026) was found out of tolerance on 2026-03-10: "
        "what it measured since 2025-03-10 is in doubt"
    )


@pytest.mark.parametrize(
    ("first", "last", "covered"),
    [
        ("2025-03-08", "2025-03-09", False),
        ("2025-03-09", "2025-03-10T00:00:01Z", True),
        ("2025-03-10", "2025-03-10", True),
        ("2026-03-10T23:59:59Z", "2026-03-11T04:00:00Z", True),
        ("2026-03-11", "2026-03-11", False),
        ("2024-01-01", "2027-01-01", True),
    ],
)
def test_both_ends_of_an_interval_belong_to_it(first, last, covered):
    """The day of a certificate does not tell whether a run of that day was before or after it: it is in doubt."""
    (doubt,) = doubts(meter(certificate("2025-03-10"), certificate("2026-03-10", OUT)))
    assert doubt.covers(first, last) is covered


def test_a_certificate_that_left_the_instrument_bad_is_not_the_last_good_one():
    """Everything since the last good certificate is in doubt, and everything until the next one."""
    bad = certificate("2025-03-10", IN, AsLeft.OUT_OF_TOLERANCE)
    assert spans(certificate("2024-03-10"), bad) == [("2025-03-10", "")]
    later = certificate("2026-03-10", OUT, AsLeft.ADJUSTED)
    assert spans(certificate("2024-03-10"), bad, later) == [("2024-03-10", "2026-03-10"), ("2025-03-10", "2026-03-10")]


def test_adjusted_without_saying_what_was_found_is_in_doubt():
    """An adjustment wipes out what the instrument was; the first certificate has nothing before it."""
    unknown = certificate("2025-03-10", UNKNOWN, AsLeft.ADJUSTED)
    assert spans(unknown) == []
    assert spans(certificate("2024-03-10"), unknown) == [("2024-03-10", "2025-03-10")]
    assert spans(certificate("2024-03-10"), certificate("2025-03-10", UNKNOWN)) == []


def test_out_of_tolerance_without_any_earlier_certificate():
    """Nothing before it can count."""
    (doubt,) = doubts(meter(certificate("2025-03-10", OUT, AsLeft.ADJUSTED)))
    assert doubt.covers("1999-01-01", "1999-01-01")
    assert "what it measured at any time before is in doubt" in doubt.reason


@pytest.mark.parametrize(
    ("first", "last", "problem"),
    [
        ("2025-03-10", "2025-03-10", ""),
        ("2025-03-09T23:59:59Z", "2025-03-10", "was used on 2025-03-09, before its calibration on 2025-03-10"),
        ("2026-03-10", "2026-03-10T23:59:59Z", ""),
        ("2026-03-10", "2026-03-11T00:00:00Z", "was used on 2026-03-11, and its calibration was due on 2026-03-10"),
        ("2026-09-01", "2026-09-02", ""),
        ("2027-09-02", "2027-09-02", "was used on 2027-09-02, and its calibration was due on 2027-09-01"),
    ],
)
def test_a_certificate_counts_from_its_date_to_its_due_date(first, last, problem):
    """Out of calibration by one second: before its calibration, or after the last day."""
    instrument = meter(certificate("2025-03-10"), certificate("2026-09-01"))
    assert calibration_problem(instrument, first, last) == (f"DMM-017 {problem}" if problem else "")


def test_instrument_without_certificate():
    """It was never in calibration."""
    assert calibration_problem(meter(), "2025-03-10", "2025-03-10") == "DMM-017 has no certificate"


@pytest.mark.parametrize(
    ("began", "after"), [("2026-05-01", True), ("2026-05-03T23:59:59Z", True), ("2026-05-04", False)]
)
def test_events_after_evidence(began, after):
    """A repair after a run: its evidence must be obtained again, unless it began after the last day of the repair."""
    repair = UnitEvent(
        kind=UnitEventKind.REPAIR, date="2026-05-02", until="2026-05-03", text="New connector", reverify=True
    )
    minor = UnitEvent(kind=UnitEventKind.DEMATE, date="2027-01-01", text="x", reference="NRB-3", reverify=False)
    assert events_after((repair, minor), began) == ((repair,) if after else ())
