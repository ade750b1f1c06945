"""A campaign that was published as a report: put in as packages, the audit lists what is open and why."""

from __future__ import annotations

import pytest
from published_campaign import as_published, put_in

from hil.audit.cache import Cache
from hil.audit.engine import audit
from hil.audit.reading import Folders, read_world
from hil.model.errors import ConfigurationError
from hil.requirements.catalogue import load_catalogue


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    """What the audit says of the campaign."""
    root = tmp_path_factory.mktemp("published")
    put_in(root)
    folders = Folders(
        root=root, testplans=root / "testplans", fixtures=root / "fixtures", reports=root / "reports", name="published"
    )
    return audit(read_world(folders, Cache(None, ""), version="1.0", locked=False))


def test_an_id_that_was_used_twice_is_refused(tmp_path):
    """One id stands for a requirement of each of two tests; both places are named."""
    with pytest.raises(ConfigurationError) as refused:
        load_catalogue(tmp_path, as_published(tmp_path, judged=False), locked=False)
    told = str(refused.value)
    assert "PQ-BAT-001" in told
    assert "testplans/charge/requirements.yaml:4" in told
    assert "testplans/degradation/requirements.yaml:4" in told


def test_requirements_without_limits_are_refused(tmp_path):
    """Nothing says what would meet them."""
    with pytest.raises(ConfigurationError, match="PQ-BAT-001 is of kind limit and has no limits"):
        load_catalogue(tmp_path, as_published(tmp_path, judged=True), locked=False)


def test_nothing_is_closed(document):
    """The report concludes that all is well; nothing of it can be closed."""
    assert document.summary.closed == 0
    assert document.summary.on_hardware == ()


def test_a_package_without_a_unit_and_a_bench_file_is_not_whole(document):
    """No package can leave out which unit and which bench it is of: that stays a finding, and is told for each."""
    assert len(document.problems) == 3
    assert all("it has no entry ''" in each for each in document.problems)
    assert all("INTEGRITY" in {reason.code for reason in row.reasons} for row in document.rows)


@pytest.mark.parametrize(
    ("requirement", "code", "text"),
    [
        ("PQ-DEG-003", "FAILED", "it failed on 2023-08-01"),
        ("PQ-CHG-008", "NO_VERDICT", "its verdict is NOT_RUN"),
        ("PQ-MTQ-001", "NO_VERDICT", "its verdict is NOT_EVALUATED"),
        ("PQ-DEG-006", "NOT_ELIGIBLE", "deviation: the discharges ran at 10 degC instead of the lowest 2 degC"),
        ("PQ-CHG-001", "NOT_ELIGIBLE", "the device under test has no serial number"),
        ("PQ-CHG-001", "WRONG_DUT", "the register has no unit without serial number"),
        ("PQ-CHG-001", "NOT_ELIGIBLE", "no operator is named"),
        ("PQ-CHG-001", "NOT_ELIGIBLE", "the bench has no envelope"),
        ("PQ-CHG-001", "NOT_ELIGIBLE", "the number was taken from a printed report"),
    ],
)
def test_the_audit_lists_what_is_open_and_why(document, requirement, code, text):
    """4.3 V at a limit of 4.2 V without a nonconformance, cases that did not run, no serial number, and more."""
    row = next(each for each in document.rows if each.id == requirement)
    assert (code, text) in {(str(each.code), each.text) for each in row.reasons}


def test_a_fail_that_nobody_signed_for_is_no_compliance(document):
    """The voltage was above its limit, and the report calls it harmless."""
    row = next(each for each in document.rows if each.id == "PQ-DEG-003")
    assert (row.compliance, row.evidence[0].verdict) == ("no", "FAIL")
