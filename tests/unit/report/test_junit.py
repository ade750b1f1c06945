from xml.etree import ElementTree as ET

import pytest
import specimen_run
from told_as_json import results_as_json
from typed_events import outcome_of

from hil.evidence.package.contents import Package
from hil.model.verdict import Verdict
from hil.report.write import junit

EXPECTED = {
    "PASS": None,
    "RECORDED": None,
    "FAIL": "failure",
    "INCONCLUSIVE": "failure",
    "NOT_EVALUATED": "failure",
    "ERROR": "error",
    "ABORTED": "error",
    "NOT_RUN": "skipped",
}


def parsed(results, **how):
    """Return the written XML, read back."""
    written = junit(
        outcome_of(results), **({"run": "r", "began": "2026-11-21T05:00:00.000000Z", "evidence_digest": "d"} | how)
    )
    return ET.fromstring(written)  # noqa: S314 - our own output


def properties(element):
    """Return names and values of the properties of a suite or case."""
    return [(item.get("name"), item.get("value")) for item in element.findall("properties/property")]


def results_with(*verdicts, **fields):
    """Return results with a case per verdict."""
    cases = [
        {"case": f"c{place}", "plan": "p", "verdict": verdict, "requirements": {}, "reasons": [], "checks": []}
        for place, verdict in enumerate(verdicts)
    ]
    return {"verdict": "FAIL", "run": {}, "cases": cases} | fields


def test_reads_back_as_the_results(folder):
    """One test case per case, with its requirements; counts agree with the results."""
    package = Package(folder)
    results = results_as_json(package)
    root = ET.parse(folder / "data/report/junit.xml").getroot()  # noqa: S314 - our own output
    (suite,) = root.findall("testsuite")
    cases = suite.findall("testcase")
    assert [case.get("name") for case in cases] == [case["case"] for case in results["cases"]]
    assert suite.get("tests") == str(sum(results["counts"].values()))
    assert suite.get("failures") == str(len(suite.findall("testcase/failure"))) == "1"
    assert suite.get("errors") == str(len(suite.findall("testcase/error"))) == "0"
    assert suite.get("skipped") == str(len(suite.findall("testcase/skipped"))) == "1"
    for case, told in zip(cases, results["cases"], strict=True):
        found = properties(case)
        assert [value for name, value in found if name == "requirement"] == sorted(told["requirements"])
        assert ("verdict", told["verdict"]) in found
    facts = dict(properties(suite))
    assert facts["evidence-digest"] == package.evidence_digest
    assert facts["source"] == "simulated"
    assert facts["dut"] == "SUB-GYR-3 GYR-007"
    assert facts["interrupted"] == "false"
    assert facts["safe"] == "true"


def test_failure_holds_the_checks(folder):
    """Value, uncertainty, limit, margin and reason of what failed stand in the failure."""
    root = ET.parse(folder / "data/report/junit.xml").getroot()  # noqa: S314 - our own output
    (failure,) = root.iter("failure")
    assert failure.get("type") == "FAIL"
    assert failure.get("message") == "1 check failed"
    assert "FAIL ADCS-GYR-030 rate_error [z]" in failure.text
    assert "(-0.712 ± 0.098) deg/s" in failure.text
    assert "-0.5 to 0.5 deg/s, guarded" in failure.text
    assert "rate_error [x]" not in failure.text


@pytest.mark.parametrize(("verdict", "element"), EXPECTED.items())
def test_each_verdict_has_its_element(verdict, element):
    """What is not good is a failure, an error, or skipped; nothing else counts as passed."""
    assert set(EXPECTED) == set(Verdict)
    root = parsed(results_with(verdict))
    case = root.find("testsuite/testcase")
    assert [child.tag for child in case if child.tag != "properties"] == ([element] if element else [])
    if element:
        assert case.find(element).get("type") == verdict
    suite = root.find("testsuite")
    counted = {"failure": "failures", "error": "errors", "skipped": "skipped"}
    for name, attribute in counted.items():
        assert suite.get(attribute) == str(int(name == element))
        assert root.get(attribute) == suite.get(attribute)


def test_interrupted_run_is_visible():
    """An interrupted run says so, even if every case that ended passed."""
    root = parsed(results_with("PASS", interrupted=True, tripped=True, safe=None))
    assert "INTERRUPTED: the run did not reach its planned end." in root.findtext("testsuite/system-err")
    facts = dict(properties(root.find("testsuite")))
    assert facts["interrupted"] == "true"
    assert facts["tripped"] == "true"
    assert facts["safe"] == "not recorded"


def test_hostile_text_stays_text():
    """Markup is escaped, and what XML or a reader's eye cannot stand is removed."""
    hostile = "<script>&\"'\x00\x08\x1b[31m\ufffe\u202eabc\r\n]]>"
    results = results_with("FAIL", run={"operator": hostile, "deviations": [hostile]})
    results["cases"][0] |= {"case": hostile, "reasons": [hostile], "requirements": {hostile: "FAIL"}}
    root = parsed(results, run=hostile)
    case = root.find("testsuite/testcase")
    assert case.get("name") == "<script>&\"'[31mabc ]]>"
    assert case.find("failure").text.strip() == "<script>&\"'[31mabc\n]]>"
    assert case.find("failure").get("message") == "<script>&\"'[31mabc ]]>"
    assert dict(properties(root.find("testsuite")))["operator"] == "<script>&\"'[31mabc ]]>"


def test_case_that_did_not_end_takes_no_time():
    """A case without a duration counts as none."""
    assert parsed(results_with("ABORTED")).find("testsuite/testcase").get("time") == "0.000"


def test_run_without_cases_is_a_suite_without_tests():
    """A run that was interrupted before its plan still gives a file that can be read."""
    root = parsed({"verdict": "ABORTED", "run": {}}, run=specimen_run.NAME, began="")
    assert root.get("tests") == "0"
    assert root.find("testsuite").get("name") == specimen_run.NAME
