"""Results: verdicts that are never better than their evidence, and why a run closes nothing."""

from __future__ import annotations

import msgspec
import pytest
from evidence_runs import (
    LIMIT,
    REQUIREMENTS,
    begin,
    case_end,
    check,
    frozen_hashes,
    planned,
    recorded_check,
    run_fields,
    whole_case,
)
from told_as_json import results_as_json
from typed_events import event_of

from hil.documents.canonical import canonical
from hil.evidence.events import HostGate
from hil.evidence.folder import JOURNAL
from hil.evidence.journal.reader import read_journal
from hil.evidence.results.derived import derive, results_of
from hil.evidence.results.facts import DamagedFile, Facts, FrozenCalibration, entries_of, facts_of
from hil.evidence.results.outcome import is_outcome, write_outcome
from hil.model.errors import EvidenceError


def derived(folder, **changes):
    """Return the results of a whole run."""
    with begin(folder, **changes) as journal:
        whole_case(folder, journal)
    return results_as_json(results_of(folder, read_journal(folder / JOURNAL)))


@pytest.mark.parametrize(
    ("was", "now"),
    [
        (b'"proven":true', b'"proven":1'),
        (b'"proven":true', b'"proven": true'),
        (b'"checks":1', b'"checks":1.0'),
        (b'"checks":1', b'"checks":2'),
        (b'"unit":"deg/s"', b'"status":null,"unit":"deg/s"'),
        (b'"verdict":', b'"verdicts":'),
        (b'"requirements":[{', b'"requirements":[{},{'),
    ],
)
def test_results_are_compared_to_the_byte_without_being_written(tmp_path, was, now):
    """What says the same in other bytes, or has one field more, is not what a run writes."""
    with begin(tmp_path) as journal:
        whole_case(tmp_path, journal)
    outcome = results_of(tmp_path, read_journal(tmp_path / JOURNAL))
    written = write_outcome(outcome)
    assert is_outcome(written, outcome)
    changed = written.replace(was, now, 1)
    assert changed != written
    assert not is_outcome(changed, outcome)


def test_results_of_many_requirements_are_compared_to_the_byte(tmp_path):
    """Wherever among hundreds of requirements a byte differs, and however large a revision is."""
    with begin(tmp_path) as journal:
        whole_case(tmp_path, journal)
    few = results_of(tmp_path, read_journal(tmp_path / JOURNAL))
    for rev in (7, 2**53 - 1):
        many = tuple(
            msgspec.structs.replace(few.requirements[0], id=f"EPS-{number:03}", rev=rev) for number in range(250)
        )
        outcome = msgspec.structs.replace(few, requirements=many)
        written = write_outcome(outcome)
        assert is_outcome(written, outcome)
        assert not is_outcome(written, msgspec.structs.replace(outcome, requirements=many[:-1]))
        for number in (0, 99, 100, 249):
            assert not is_outcome(written.replace(b'"EPS-%03d"' % number, b'"EPS-%03dx"' % number), outcome)


def derived_from(events, facts, **options):
    """Return the results of these events, as JSON."""
    stamped = [event_of(**{"seq": place, "t": 0.0, **event}) for place, event in enumerate(events)]
    return results_as_json(derive(stamped, facts, content_digest="", **options))


def events_of(*events):
    """Return bodies of a run that was begun and planned, and of these events."""
    return [
        {"kind": "run", **run_fields()},
        {"kind": "planned", "cases": [planned("test_a", ["GYR-030"]), planned("test_b", ["GYR-030"])]},
        *events,
    ]


def verdicts_of(*events):
    """Return the verdicts of cases, of the first requirement that they carry, and of the run."""
    results = derived_from(events_of(*events), Facts(catalogue=entries_of(REQUIREMENTS)))
    cases = {case["case"]: str(case["verdict"]) for case in results["cases"]}
    carried = [requirement for requirement in results["requirements"] if requirement["cases"]]
    return cases, str(carried[0]["verdict"]), str(results["verdict"])


def test_a_requirement_that_no_case_carries_is_listed():
    """What the plan's catalogue asks for and no planned case verifies is NOT_RUN, with that reason."""
    events = events_of({"kind": "case", "case": "test_a", "attempt": 1}, ended("test_a", "PASS", {"GYR-030": "PASS"}))
    results = derived_from(events, Facts(catalogue=entries_of(REQUIREMENTS)))
    missing = [requirement for requirement in results["requirements"] if not requirement["cases"]]
    assert missing
    assert all(requirement["verdict"] == "NOT_RUN" for requirement in missing)
    assert all("no planned case carries it" in requirement["reasons"] for requirement in missing)


def ended(case, verdict, requirements):
    """Return a case's end."""
    return {
        "kind": "case-end", "case": case, "attempt": 1, "verdict": verdict, "reasons": [], "duration": 1.0,
        "requirements": requirements, "used": {},
    }  # fmt: skip


def checked(case, of, verdict="PASS"):
    """Return a check of the case."""
    return {
        "kind": "check", "case": case, "requirement": "GYR-030", "parameter": "rate_error", "of": of,
        "verdict": verdict, "instruments": [],
    }  # fmt: skip


def passed(case, attempt=1):
    """Return the events of a case that passed."""
    begun = {"kind": "case", "case": case, "attempt": attempt}
    return begun, checked(case, "x"), checked(case, "y"), ended(case, "PASS", {"GYR-030": "PASS"})


def test_a_whole_run_is_derived(tmp_path):
    """Cases, requirements, counts and the run's facts are those of the journal."""
    results = derived(tmp_path)
    assert results["verdict"] == "PASS"
    assert results["counts"] == {"PASS": 1}
    assert results["run"] == run_fields(**frozen_hashes(tmp_path))
    assert (results["interrupted"], results["tripped"], results["safe"]) == (False, False, True)
    (case,) = results["cases"]
    assert (case["title"], case["plan"], case["recordings"]) == ("test_rest.", "gyro", ["001-rest"])
    assert case["requirements"] == {"GYR-010": "RECORDED", "GYR-030": "PASS"}
    assert case["attempts"] == [{"attempt": 1, "verdict": "PASS", "reasons": []}]
    assert case["steps"] == [{"path": ["Hold"], "number": "1", "outcome": "done", "duration": 4}]
    assert [check["of"] for check in case["checks"]] == ["x", "y", None]
    assert [(item["id"], item["verdict"], item["checks"]) for item in results["requirements"]] == [
        ("GYR-010", "RECORDED", 1),
        ("GYR-030", "PASS", 2),
    ]
    assert all(item["eligible"] for item in results["requirements"])


def test_the_same_events_give_the_same_bytes(tmp_path):
    """Deriving twice, and on another day, gives equal canonical JSON."""
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    assert canonical(derived(tmp_path / "a")) == canonical(derived(tmp_path / "b"))


def test_a_requirement_is_as_good_as_its_worst_case():
    """One planned case that failed, or did not run, takes the pass of the other."""
    assert verdicts_of(*passed("test_a"), *passed("test_b")) == ({"test_a": "PASS", "test_b": "PASS"}, "PASS", "PASS")
    assert verdicts_of(*passed("test_a")) == ({"test_a": "PASS", "test_b": "NOT_RUN"}, "NOT_RUN", "NOT_RUN")
    failed = ({"kind": "case", "case": "test_b", "attempt": 1}, checked("test_b", "x", "FAIL"), checked("test_b", "y"))
    assert verdicts_of(*passed("test_a"), *failed, ended("test_b", "FAIL", {"GYR-030": "FAIL"}))[1:] == ("FAIL", "FAIL")


def test_a_case_that_did_not_end_is_aborted():
    """Begun and not ended is ABORTED, whatever its checks say so far."""
    cases, requirement, run = verdicts_of(*passed("test_a"), *passed("test_b")[:-1])
    assert (cases["test_b"], requirement, run) == ("ABORTED", "ABORTED", "ABORTED")


def test_a_case_cannot_be_better_than_its_checks():
    """A case that says PASS over a failed, missing or no check is not believed."""
    begun = {"kind": "case", "case": "test_a", "attempt": 1}
    end = ended("test_a", "PASS", {"GYR-030": "PASS"})
    failing = verdicts_of(begun, checked("test_a", "x", "FAIL"), checked("test_a", "y"), end, *passed("test_b"))
    assert (failing[0]["test_a"], failing[1]) == ("FAIL", "FAIL")
    missing = verdicts_of(begun, checked("test_a", "x"), end, *passed("test_b"))
    assert (missing[0]["test_a"], missing[1]) == ("NOT_EVALUATED", "NOT_EVALUATED")
    nothing = verdicts_of(begun, end, *passed("test_b"))
    assert nothing[0]["test_a"] == "NOT_EVALUATED"


def test_an_error_elsewhere_in_the_case_takes_its_checks():
    """Passed checks of a case in ERROR do not make its requirement pass."""
    begun, *checks, _ = passed("test_a")
    error = ended("test_a", "ERROR", {"GYR-030": "PASS"})
    assert verdicts_of(begun, *checks, error, *passed("test_b"))[1] == "ERROR"


def test_the_worst_attempt_counts_and_every_attempt_is_kept():
    """Nothing declares a retry, so a pass does not replace the failure before it; nor does it replace a death."""
    facts = Facts(catalogue=entries_of(REQUIREMENTS))
    first = ({"kind": "case", "case": "test_a", "attempt": 1}, checked("test_a", "x", "FAIL"))
    failed = events_of(*first, ended("test_a", "FAIL", {"GYR-030": "FAIL"}), *passed("test_a", 2))
    case = derived_from(failed, facts)["cases"][0]
    assert (case["verdict"], case["requirements"]["GYR-030"]) == ("FAIL", "FAIL")
    assert [attempt["verdict"] for attempt in case["attempts"]] == ["FAIL", "PASS"]
    assert len(case["checks"]) == 2
    died = events_of(*passed("test_a")[:-1], *passed("test_a", 2))
    assert derived_from(died, facts)["cases"][0]["verdict"] == "ABORTED"


def test_a_second_body_of_one_id_is_not_dropped():
    """Two planned cases of one id are as good as the worse, and one of them that never ran is NOT_RUN."""
    facts = Facts(catalogue=entries_of(REQUIREMENTS))
    events = events_of(*passed("test_a"), *passed("test_b"))
    again = next(event for event in events if event["kind"] == "planned")
    case = derived_from([again, *events], facts)["cases"][0]
    assert (case["verdict"], case["requirements"]["GYR-030"]) == ("NOT_RUN", "NOT_RUN")


def test_a_failure_stands_in_a_case_that_takes_itself_out():
    """What was found before a skip counts; what was not evaluated is NOT_RUN."""
    begun = {"kind": "case", "case": "test_a", "attempt": 1}
    end = ended("test_a", "NOT_RUN", {"GYR-030": "NOT_RUN"})
    failing = verdicts_of(begun, checked("test_a", "x", "FAIL"), end, *passed("test_b"))
    assert (failing[0]["test_a"], failing[1]) == ("FAIL", "FAIL")
    passing = verdicts_of(begun, checked("test_a", "x"), end, *passed("test_b"))
    assert (passing[0]["test_a"], passing[1]) == ("NOT_RUN", "NOT_RUN")


def test_not_run_has_its_reason():
    """A case that was left out says why, and one that nobody spoke of says that the run ended."""
    events = events_of({"kind": "not-run", "case": "test_a", "reason": "skipped: no cold plate"})
    results = derived_from(events, Facts(catalogue={}))
    assert [case["reasons"] for case in results["cases"]] == [
        ["skipped: no cold plate"],
        ["the run ended before this case"],
    ]


def test_nothing_planned_is_not_a_pass():
    """An empty run is NOT_EVALUATED, and a journal without its first event is ABORTED."""
    assert derived_from([{"kind": "run", **run_fields()}], Facts(catalogue={}))["verdict"] == "NOT_EVALUATED"
    assert derived_from([], Facts(catalogue={}))["verdict"] == "ABORTED"


@pytest.mark.parametrize(
    ("event", "verdict"),
    [
        ({"kind": "trip"}, "ERROR"),
        ({"kind": "safe-end", "ok": False}, "ERROR"),
        ({"kind": "host-gate", "name": HostGate.GUARDIANS_PROOF, "ok": False, "detail": "coil: silent"}, "ERROR"),
        ({"kind": "armed"}, "ERROR"),
        ({"kind": "stop"}, "ABORTED"),
        ({"kind": "recovered"}, "ABORTED"),
    ],
)
def test_a_run_that_went_wrong_does_not_pass(event, verdict):
    """A trip, an end that was not safe or never came, and an interruption each spoil the run's verdict."""
    assert verdicts_of(*passed("test_a"), *passed("test_b"), event)[2] == verdict


@pytest.mark.parametrize(
    ("changes", "reasons"),
    [
        ({"source": "simulated"}, ["the run's source is simulated"]),
        ({"source": "replayed"}, ["the run's source is replayed"]),
        (
            {"purpose": "development"},
            [
                "the purpose development does not close requirements",
                "its stage is qualification, but the run's purpose is development",
            ],
        ),
        ({"deviations": ["rest_duration = 1 s"]}, ["deviation: rest_duration = 1 s"]),
        ({"dut": {**run_fields()["dut"], "serial": ""}}, ["the device under test has no serial number"]),
    ],
)
def test_a_run_that_cannot_close_says_why(tmp_path, changes, reasons):
    """A passed requirement is not eligible, with every reason in words."""
    item = derived(tmp_path, **changes)["requirements"][0]
    assert (item["eligible"], item["reasons"]) == (False, reasons)


@pytest.mark.parametrize(
    ("calibration", "reason"),
    [
        ({"due": "2026-11-20"}, "psu1 was out of calibration: due 2026-11-20, used 2026-11-21"),
        ({"due": ""}, "psu1 has no calibration record"),
        ({"due": "2026-11-21"}, None),
        ({"due": "", "dut": True}, None),
        ({"due": "2027-11-21", "date": "2026-11-21"}, None),
        (
            {"due": "2027-11-21", "date": "2026-11-22"},
            "psu1 was used before its calibration: calibrated 2026-11-22, used 2026-11-21",
        ),
        ({"due": "2027-11-21", "certificate": "c.pdf", "size": 0}, "psu1 has an empty certificate, c.pdf"),
        (
            {"due": "2027-11-21", "certificate": "c.pdf", "ranges": ()},
            "psu1 has a certificate without any range, c.pdf",
        ),
        (
            {"due": "2027-11-21", "date": "2026-11-20", "as_left": "out of tolerance"},
            "psu1 was returned out of tolerance by its calibration on 2026-11-20",
        ),
    ],
)
def test_calibration_counts_from_its_first_day_to_its_last(tmp_path, calibration, reason):
    """Out of calibration by a day, a date after the run, an empty certificate; a device under test needs none."""
    with begin(tmp_path) as journal:
        whole_case(tmp_path, journal)
    reading = read_journal(tmp_path / JOURNAL)
    facts = Facts(
        catalogue=entries_of(REQUIREMENTS),
        calibration={"psu1": FrozenCalibration(**{"certificate": "C-1", "size": 16, **calibration})},
        date="2026-11-21",
        software=facts_of(tmp_path, reading).software,
    )
    results = results_as_json(derive(reading.events, facts, content_digest=""))
    assert [item["reasons"] for item in results["requirements"]] == 2 * [[reason] if reason else []]


def test_one_simulated_instrument_is_enough(tmp_path):
    """One that says it is simulated counts as that, and so does what is reached through the same port."""
    with begin(tmp_path) as journal:
        journal.write(event_of("case", case="test_rest", attempt=1), 0.0)
        check(journal, of="x")
        check(journal, of="y")
        recorded_check(journal)
        case_end(journal, used={"psu1": "hardware", "mag": "hardware", "obc": "hardware"})
        for name in ("mag", "obc"):
            journal.write(event_of("host-gate", name="-", ok=True, detail="/dev/obc", instrument=name), 4.0)
        seen = {
            "name": "identity of obc",
            "ok": True,
            "detail": "O1, SIMULATED",
            "instrument": "obc",
            "source": "simulated",
        }
        journal.write(event_of("gate", **seen), 4.0)
        journal.write(event_of("gate", name="found-off", ok=False, detail="psu1 was on"), 4.0)
        journal.write(event_of("safe-end", ok=True), 5.0)
    found = results_of(tmp_path, read_journal(tmp_path / JOURNAL))
    reasons = ["readiness gate found-off: psu1 was on", "SIMULATED: mag, obc", "it was not asked who mag is"]
    assert list(found.requirements[0].reasons) == reasons
    assert found.cases[0].used == {"psu1": "hardware", "mag": "simulated", "obc": "simulated"}
    assert [each.name for each in found.conditions if not each.proven] == ["readiness"]
    old = results_of(tmp_path, read_journal(tmp_path / JOURNAL), 2)
    assert list(old.requirements[0].reasons) == ["readiness gate found-off: psu1 was on"]
    assert (old.conditions, old.requirements[0].conditions) == (None, None)


def test_an_id_outside_the_frozen_catalogue_is_not_eligible():
    """What was not frozen before the first step closes nothing."""
    results = derived_from(events_of(*passed("test_a"), *passed("test_b")), Facts(catalogue={}))
    assert "it is not in the frozen catalogue" in results["requirements"][0]["reasons"]


def test_the_frozen_catalogue_is_read_as_it_was(tmp_path):
    """Requirements come back from the package with limits and fingerprints."""
    begin(tmp_path).close()
    facts = facts_of(tmp_path, read_journal(tmp_path / JOURNAL))
    assert facts.catalogue == entries_of(REQUIREMENTS)
    assert facts.catalogue["GYR-030"].limits[0].limit == LIMIT
    assert facts.date == "2026-11-21"


def test_a_frozen_file_that_cannot_be_read_is_named(tmp_path):
    """Nonsense where the catalogue should be is an error with its path."""
    begin(tmp_path).close()
    (tmp_path / "data/catalogue/catalogue.json").write_text('{"requirements": [NaN]}')
    with pytest.raises(EvidenceError, match=r"catalogue\.json"):
        facts_of(tmp_path, read_journal(tmp_path / JOURNAL))


def test_every_wrong_field_of_a_frozen_requirement_is_named(tmp_path):
    """With its requirement; nothing is read as empty that says something else."""
    begin(tmp_path).close()
    (tmp_path / "data/catalogue/catalogue.json").write_text(
        '{"requirements":{"A-1":{"rev":"one","limits":[{"of":[7],"parameter":"p"}]}}}'
    )
    with pytest.raises(DamagedFile) as refused:
        facts_of(tmp_path, read_journal(tmp_path / JOURNAL))
    assert str(refused.value.finding) == (
        "data/catalogue/catalogue.json: requirements.A-1: field 'rev' must be a whole number or null, found text;"
        " field 'limits[0].of[0]' must be text, found a whole number"
    )


def test_results_are_derived_in_the_format_that_they_were_sealed_in():
    """What format 1 did not tell would make every earlier package with a hold another one than its journal gives."""
    begin, *rest = passed("test_a")
    held = [{"kind": "hold", "t": 1.0, "by": "Ada", "text": "door"}, {"kind": "hold-end", "duration": 2.0}]
    events = events_of(begin, *held, *rest)
    new, old = (derived_from(events, Facts(catalogue={}), **form) for form in ({}, {"form": 1}))
    assert [(hold["by"], hold["duration"]) for hold in new["cases"][0]["holds"]] == [("Ada", 2.0)]
    assert (new["format"], old["format"], "holds" in old["cases"][0]) == (3, 1, False)
