import pytest
import specimen_run
from typed_events import body_of, event_of, outcome_of

from hil.documents.canonical import JsonError
from hil.documents.text import fitting
from hil.evidence.folder import RESULTS
from hil.evidence.package.contents import Package
from hil.evidence.results.outcome import read_outcome
from hil.report.summary import check_lines, closing_lines


def test_closing_block_of_a_failed_run(folder):
    """Verdict and counts first, then a block per check that is not good, then what the run can close."""
    lines = closing_lines(Package(folder).outcome())
    assert lines[:3] == [
        "FAIL  5 cases: 1 failed, 1 not run, 3 passed.",
        "  SIMULATED: the instruments were simulated; this run is not evidence about hardware.",
        "  DEVIATION: the run deviates from its plan; the report says how.",
    ]
    start = lines.index("  FAIL ADCS-GYR-030 rate_error [z]")
    assert lines[start + 1 : start + 8] == [
        "    value        (-0.712 ± 0.098) deg/s",
        "    limit        -0.5 to 0.5 deg/s, guarded",
        "    margin       -0.31 deg/s",
        "    TUR          5.1",
        f"    case         {specimen_run.CASES['rate']}, step 1.1",
        "    instruments  gyro, table1",
        "    reason       outside the limit by more than the expanded uncertainty",
    ]
    assert not any("[x]" in line for line in lines)
    place = lines.index(f"NOT_RUN {specimen_run.CASES['cold']}")
    assert lines[place + 1] == "  skipped: the chamber is away (--skip)"
    assert "This run can close none of its 4 requirements. SIMULATED." in lines
    assert "  the run's source is simulated" in lines
    assert "  its verdict is FAIL (ADCS-GYR-030)" in lines
    assert lines[-1] == "  table1 has no calibration record (ADCS-GYR-030)"


def test_reasons_that_a_check_tells_are_not_told_twice():
    """A case's reason that names one of its checks is left to the block of that check; others stay."""
    check = body_of("check", requirement="A-1", parameter="x", verdict="FAIL", value=3, unit="V", reason="too high")
    reasons = ["A-1 x is FAIL: too high", "the case took too long"]
    case = {"case": "c", "verdict": "FAIL", "reasons": reasons, "checks": [check]}
    lines = closing_lines(outcome_of({"verdict": "FAIL", "run": {}, "cases": [case], "requirements": []}))
    assert sum("too high" in line for line in lines) == 1
    assert "  the case took too long" in lines


def test_of_two_reasons_that_begin_alike_the_longer_is_told():
    """What tripped, and the same with what became of it, are one thing."""
    why = "plate: 60.2 degC is above 60 degC"
    case = {"case": "c", "verdict": "ERROR", "reasons": [why, f"{why}; the bench was made safe (x.py:9)"], "checks": []}
    lines = closing_lines(outcome_of({"verdict": "ERROR", "run": {}, "cases": [case], "requirements": []}))
    assert [line for line in lines if why in line] == [f"  {why}; the bench was made safe (x.py:9)"]


def test_the_margin_of_a_temperature_is_a_difference():
    """A limit in degC leaves a margin in K."""
    check = {"requirement": "A-1", "parameter": "x", "verdict": "FAIL", "value": 43.0, "unit": "degC", "margin": -1.24}
    lines = check_lines(event_of(**body_of("check", **check, limit_unit="degC")))
    assert any(line.split() == ["margin", "-1.24", "K"] for line in lines)


def test_a_run_without_a_word_on_safety_says_so():
    """Nothing on record about the bench's end is a warning, not silence."""
    results = {"verdict": "ABORTED", "run": {"source": "hardware"}, "cases": [], "requirements": [], "safe": None}
    assert any("SAFE STATE UNKNOWN" in line for line in closing_lines(outcome_of(results)))
    assert not any("SAFE STATE" in line for line in closing_lines(outcome_of(results | {"safe": True})))


def test_run_that_closes_says_so_and_nothing_else():
    """A run on hardware in which everything passed needs two sentences."""
    results = {
        "verdict": "PASS",
        "run": {"source": "hardware"},
        "safe": True,
        "counts": {"PASS": 1},
        "cases": [{"case": "a", "verdict": "PASS"}],
        "requirements": [
            {"id": "A-1", "verdict": "PASS", "eligible": True, "cases": [{"case": "a", "verdict": "PASS"}]}
        ],
    }
    assert closing_lines(outcome_of(results)) == ["PASS  1 case: 1 passed.", "", "This run can close its requirement."]


def test_requirements_without_a_case_stand_beside_the_verdict():
    """The verdict of a run is that of its cases; a requirement that has none must not hide behind a PASS."""
    cases = [{"case": "a", "verdict": "PASS"}]
    covered = {"id": "A-1", "verdict": "PASS", "eligible": True, "reasons": [], "cases": cases}
    bare = {"id": "A-2", "verdict": "NOT_RUN", "eligible": False, "reasons": ["no case"], "cases": []}
    results = {
        "verdict": "PASS",
        "run": {"source": "hardware"},
        "safe": True,
        "counts": {"PASS": 1},
        "cases": cases,
        "requirements": [covered, bare],
    }
    assert (
        closing_lines(outcome_of(results))[1] == "  NOT COVERED: 1 of 2 requirements has no case in this run: NOT_RUN."
    )
    assert not any("NOT COVERED" in line for line in closing_lines(outcome_of(results | {"requirements": [covered]})))


def test_the_last_lines_name_what_the_run_leaves_uncovered():
    """A requirement without a case, and one whose cases came to no verdict; a FAIL is a verdict."""
    said = {"PASS": "A-1", "FAIL": "A-2", "NOT_EVALUATED": "A-3", "ERROR": "A-4"}
    entries = [
        {"id": name, "verdict": verdict, "cases": [{"case": "a", "verdict": verdict}]} for verdict, name in said.items()
    ]
    bare = {"id": "A-5", "verdict": "NOT_RUN", "cases": []}
    lines = closing_lines(outcome_of({"verdict": "FAIL", "run": {}, "requirements": [*entries, bare]}))
    told = "This run leaves 3 requirements of its plans uncovered: A-3 (NOT_EVALUATED), A-4 (ERROR), A-5 (no case)."
    assert told in lines
    covered = closing_lines(outcome_of({"verdict": "FAIL", "run": {}, "requirements": entries[:2]}))
    assert not any("uncovered" in line for line in covered)


def test_eligible_requirement_that_did_not_pass_is_not_closed():
    """A good word of the evidence does not make up for a verdict that is none."""
    entry = {"id": "A-1", "verdict": "NOT_EVALUATED", "eligible": True, "reasons": []}
    results = {"verdict": "NOT_EVALUATED", "run": {"source": "hardware"}, "requirements": [entry]}
    assert closing_lines(outcome_of(results))[-2:] == [
        "This run cannot close its requirement.",
        "  its verdict is NOT_EVALUATED",
    ]


def test_case_names_the_requirements_that_it_left_unevaluated():
    """A case without a bad check says which of its requirements got no check."""
    case = {
        "case": "a",
        "verdict": "NOT_EVALUATED",
        "requirements": {"A-2": "NOT_EVALUATED", "A-1": "PASS"},
        "reasons": [],
    }
    lines = closing_lines(outcome_of({"verdict": "NOT_EVALUATED", "run": {"source": "hardware"}, "cases": [case]}))
    assert "NOT_EVALUATED a" in lines
    assert "  not evaluated  A-2" in lines


def test_checks_that_an_error_kept_from_being_made_are_told_in_one_line():
    """What went wrong does not drown in what followed from it; a case that came to its end names each."""
    missing = [f"A-{number} got no check of u of 1 to 10 (10 checks)" for number in range(1, 5)]
    case = {"case": "a", "verdict": "ERROR", "requirements": {}, "reasons": ["the load fell silent", *missing]}
    lines = closing_lines(outcome_of({"verdict": "ERROR", "run": {"source": "hardware"}, "cases": [case]}))
    assert lines[lines.index("ERROR a") + 1 :][:2] == [
        "  the load fell silent",
        "  checks of A-1, A-2, A-3 and A-4 are missing; the report names them",
    ]
    case["verdict"] = "NOT_EVALUATED"
    lines = closing_lines(outcome_of({"verdict": "NOT_EVALUATED", "run": {"source": "hardware"}, "cases": [case]}))
    assert [f"  {reason}" for reason in missing] == [line for line in lines if "got no check" in line]


def test_many_requirements_are_counted():
    """A reason that concerns many requirements names the first six of them."""
    entries = [
        {"id": f"A-{place}", "verdict": "PASS", "eligible": place > 8, "reasons": [] if place > 8 else ["late"]}
        for place in range(1, 10)
    ]
    lines = closing_lines(outcome_of({"verdict": "PASS", "run": {"source": "hardware"}, "requirements": entries}))
    assert lines[-2:] == [
        "This run can close 1 of its 9 requirements.",
        "  late (A-1, A-2, A-3, A-4, A-5, A-6 and 2 more)",
    ]


def test_check_without_uncertainty_says_so():
    """A number whose uncertainty is unknown is not left looking exact; a word needs none."""
    _, _, number = specimen_run.check(0.0, "a", "A-1", "current", uncertainty=None, expanded=None, value=1.5)
    assert check_lines(event_of("check", **number))[1] == "  value        1.5 deg/s, uncertainty not recorded"
    _, _, word = specimen_run.check(0.0, "a", "A-1", "hand", uncertainty=None, expanded=None, value="left")
    assert check_lines(event_of("check", **word))[1] == "  value        left"


def test_check_that_is_no_number_says_so():
    """A value that was NaN is told in words."""
    _, _, check = specimen_run.check(0.0, "a", "A-1", "current", value=None, verdict="INCONCLUSIVE", margin=None)
    assert check_lines(event_of("check", **check))[:2] == ["INCONCLUSIVE A-1 current", "  value        not a number"]


def test_verdict_of_another_format_is_an_error(folder):
    """A verdict that this version does not know is never shown as if it were understood."""
    told = (folder / RESULTS).read_bytes().replace(b'"verdict":"FAIL"', b'"verdict":"SPLENDID"')
    with pytest.raises(JsonError, match="SPLENDID"):
        closing_lines(read_outcome(told))


def test_cases_that_were_not_run_for_one_reason_are_one_block():
    """A stopped run names its reason once, and the first few of the cases."""
    cases = [
        {"case": f"test_x.py::test_{n}", "verdict": "NOT_RUN", "reasons": ["stopped by Ada"], "checks": []}
        for n in range(8)
    ]
    other = {"case": "test_x.py::test_other", "verdict": "NOT_RUN", "reasons": ["no jig"], "checks": []}
    lines = closing_lines(outcome_of({"verdict": "NOT_RUN", "run": {}, "cases": [*cases, other], "requirements": []}))
    start = lines.index("NOT_RUN 8 cases")
    assert lines[start + 1 : start + 6] == [
        "  stopped by Ada",
        "  test_0, test_1, test_2, test_3, test_4, test_5 and 2 more",
        "",
        "NOT_RUN test_x.py::test_other",
        "  no jig",
    ]


def test_lines_break_between_words_on_a_terminal():
    """A terminal of 80 columns breaks no word, and what is broken hangs under its beginning; a pipe gets it whole."""
    line = "  reason  " + "outside the limit by more than the expanded uncertainty of " * 3
    wide = fitting([line, "", "short"], 80)
    assert max(map(len, wide)) <= 80
    assert wide[1].startswith("    ")
    assert wide[-2:] == ["", "short"]
    assert " ".join(" ".join(wide[:-2]).split()) == " ".join(line.split())
    assert fitting([line], 0) == [line]
