"""A campaign that was published as a report: put in as packages, the audit lists what is open and why."""

from __future__ import annotations

import pytest
from published_campaign import as_published, put_in

from hil.audit.cache import Cache
from hil.audit.engine import audit
from hil.audit.reading import Folders, read_world
from hil.evidence.package.verification import verify
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


def test_packages_say_that_there_was_no_bench_file_and_are_whole(document):
    """They verify, and that they were recorded elsewhere is a reason on its own for each of their requirements."""
    assert document.problems == ()
    told = "it was recorded elsewhere, without a bench file: the published report of the campaign"
    assert all(("NOT_ELIGIBLE", told) in {(str(each.code), each.text) for each in row.reasons} for row in document.rows)
    assert not any("INTEGRITY" in {reason.code for reason in row.reasons} for row in document.rows)


def test_a_package_that_was_recorded_elsewhere_has_no_bench_file(tmp_path):
    """One that has a bench file, or lacks it without saying so, is damaged."""
    put_in(tmp_path, bench={"charge": b"schema: hil/bench/1\n"}, silent={"gyroscope"})
    found = {path.name[11:]: verify(path) for path in (tmp_path / "reports").glob("2*")}
    (wrong,) = [str(each) for each in found["charge"].findings]
    assert wrong.startswith("data/bench/bench.yaml: the journal says that the run was recorded elsewhere, without a")
    assert [str(each) for each in found["gyroscope"].findings] == [
        "data/bench/duts.yaml: it has no entry '', which the run was for",
        "data/bench/calibration.json: cannot be checked: data/bench/bench.yaml: the file is missing",
    ]
    assert found["degradation"].ok


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
        ("PQ-CHG-001", "NOT_ELIGIBLE", "the bench was not armed, so no limit of the envelope was tried"),
        ("PQ-CHG-001", "NOT_ELIGIBLE", "the number was taken from a printed report"),
        ("PQ-PHD-001", "SIM_ONLY", "the run's source is simulated"),
        ("PQ-PHD-001", "NO_VERDICT", "its verdict is NOT_EVALUATED"),
        ("PQ-GYR-001", "WRONG_DUT", "the register has no unit without serial number"),
        ("PQ-GYR-002", "NO_VERDICT", "its verdict is NOT_EVALUATED"),
    ],
)
def test_the_audit_lists_what_is_open_and_why(document, requirement, code, text):
    """4.3 V at a limit of 4.2 V without a nonconformance, cases that did not run, no serial number, and more."""
    row = next(each for each in document.rows if each.id == requirement)
    assert (code, text) in {(str(each.code), each.text) for each in row.reasons}


def test_no_nonconformance_was_reported_for_what_failed(document):
    """4.3 V at a limit of 4.2 V: there is neither a report nor a waiver, and the row says nothing of one."""
    row = next(each for each in document.rows if each.id == "PQ-DEG-003")
    assert (row.records, row.waiver, document.inputs.records) == ((), "", "")


def test_a_fail_that_nobody_signed_for_is_no_compliance(document):
    """The voltage was above its limit, and the report calls it harmless."""
    row = next(each for each in document.rows if each.id == "PQ-DEG-003")
    assert (row.compliance, row.evidence[0].verdict) == ("no", "FAIL")
