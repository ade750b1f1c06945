"""How a case ends: its verdict comes from what the executive saw."""

from __future__ import annotations

from dataclasses import replace

import pytest
from case_parts import Case, limit, monitor, scheduler

from hil.evidence.attempts import Abandoned
from hil.executive.cases.checks import CheckFailed
from hil.executive.cases.effects import Recall
from hil.executive.ending.stop import Stopped
from hil.executive.watching.scheduler import CaseTimeout
from hil.model.errors import Diverged, Implausible, Misused, NoReply, Tripped
from hil.model.figure import Figure

SILENCE = NoReply("psu1", "nothing came")


def skipped(case):
    """Take itself out."""
    case.run.skip("no jig")


def good(case):
    """Evaluate everything that T-010 asks for."""
    case.run.check("T-010", "ratio", 1.0)


def swallowed_fault(case):
    """Go on after silence."""
    case.supply.fault = SILENCE
    with pytest.raises(NoReply):
        case.coil.voltage()


def raised_fault(case):
    """End with silence that was noted."""
    swallowed_fault(case)
    case.run.raised(SILENCE)


def tripped(case):
    """Leave the envelope, and go on."""
    made = scheduler(case.clock, monitor(case.clock, limit(maximum=1.0)))
    with pytest.raises(Tripped):
        made.sleep(1.0)
    case.run.scheduler = made


def overrun(case):
    """Pass the deadline where no scheduling point sees it."""
    case.run.scheduler.deadline_ns = 1
    case.clock.sleep(1.0)


def diverged(case):
    """Disagree with the record, and go on."""
    case.run.effects._recall = Recall([], frozenset())
    with pytest.raises(Diverged):
        case.run.effects.perform("supply.enable", "drives", {}, lambda: None)


ENDINGS = [
    ("passes", [good], "PASS"),
    ("fails", [lambda case: case.run.check("T-010", "ratio", 9.0)], "FAIL"),
    ("is not a number", [lambda case: case.run.check("T-010", "ratio", float("nan"))], "INCONCLUSIVE"),
    ("passes, then fails", [good, lambda case: case.run.check("T-010", "ratio", 9.0)], "FAIL"),
    ("checks nothing", [], "NOT_EVALUATED"),
    ("raises", [good, lambda case: case.run.raised(ValueError("x"))], "ERROR"),
    ("asserts", [good, lambda case: case.run.raised(AssertionError("x"))], "ERROR"),
    ("bench silent", [good, raised_fault], "ERROR"),
    ("bench silent, swallowed", [good, swallowed_fault], "ERROR"),
    ("a fault of its own", [good, lambda case: case.run.raised(NoReply("x", "never noted"))], "ERROR"),
    ("tripped, swallowed", [good, tripped], "ERROR"),
    ("too long", [good, lambda case: case.run.raised(CaseTimeout())], "ERROR"),
    ("too long, unseen", [good, overrun], "ERROR"),
    ("diverged, swallowed", [good, diverged], "ERROR"),
    ("stopped", [lambda case: case.run.raised(Stopped("SIGINT"))], "ABORTED"),
    ("stopped after its checks", [good, lambda case: case.run.raised(Stopped("SIGINT"))], "ABORTED"),
    ("stopped in error", [lambda case: case.run.raised(Stopped("x")), raised_fault], "ERROR"),
    ("skipped", [good, lambda case: case.run.skip("no jig")], "NOT_RUN"),
    ("skipped without a word", [lambda case: case.run.skip("")], "NOT_RUN"),
    ("skipped after a failure", [lambda case: case.run.check("T-010", "ratio", 2.0), skipped], "FAIL"),
    ("skipped in error", [lambda case: case.run.skip("no jig"), raised_fault], "ERROR"),
    ("require failed", [good, lambda case: case.run.raised(CheckFailed("x"))], "PASS"),
]


@pytest.mark.parametrize(("steps", "verdict"), [ending[1:] for ending in ENDINGS], ids=[each[0] for each in ENDINGS])
def test_a_case_ends_as_what_happened_in_it(tmp_path, steps, verdict):
    """Each way to end has its verdict, for the case and for its requirement; only a pass has no reason."""
    case = Case(tmp_path, "T-010")
    for step in steps:
        step(case)
    case.run.close()
    outcome = case.run.outcome()
    assert outcome.verdict == verdict
    assert outcome.requirements == {"T-010": verdict}
    assert (outcome.reasons == ()) == (verdict == "PASS")
    assert len(set(outcome.reasons)) == len(outcome.reasons)


@pytest.mark.parametrize(
    ("requirement", "checked", "verdict"),
    [
        ("T-040", False, "FAIL"),
        ("T-040", True, "FAIL"),
        ("T-010", False, "INCONCLUSIVE"),
        ("T-010", True, "INCONCLUSIVE"),
    ],
)
def test_silence_of_the_article_is_its_own_fault(tmp_path, requirement, checked, verdict):
    """FAIL where a requirement speaks of answers, else INCONCLUSIVE, also after a check that passed."""
    case = Case(tmp_path, requirement, dut=True)
    if checked:
        case.run.check(requirement, *(("answers", "yes") if requirement == "T-040" else ("ratio", 1.0)))
    swallowed_fault(case)
    case.run.close()
    assert case.run.outcome().requirements == {requirement: verdict}
    assert case.run.bench_fault == ""


def test_what_a_fixture_finds_implausible_is_a_fault_of_the_bench(tmp_path):
    """ERROR for the case, no further case on this bench, and told once although the fixture says it again."""
    case = Case(tmp_path, "T-010")
    case.run.check("T-010", "ratio", 1.0)
    for _ in range(2):
        case.run.raised(Implausible("tec1", "the plate goes away", "look at the cooler"), "test_x.py:3")
    case.run.close()
    assert case.run.outcome().verdict == "ERROR"
    assert case.run.outcome().reasons == ("tec1: the plate goes away; look at the cooler",)
    assert case.run.bench_fault == "tec1: the plate goes away; look at the cooler"
    assert [event["device"] for event in case.written.of("fault")] == ["tec1"]


def test_many_members_are_told_by_the_first_and_the_last(tmp_path):
    """Who reads why a case of ten cycles was stopped is not told each check of each cycle."""
    case = Case(tmp_path, "T-020")
    requirement = case.run.requirements["T-020"]
    wide = replace(requirement.limits[0], of=tuple(f"{number}" for number in range(1, 11)))
    case.run.requirements = {"T-020": replace(requirement, limits=(wide,))}
    assert case.run.outcome().reasons == ("T-020 got no check of rate of 1 to 10 (10 checks)",)


def test_every_member_is_due(tmp_path):
    """One axis of two is not the requirement."""
    case = Case(tmp_path, "T-020")
    case.run.check("T-020", "rate", Figure(value=0.1, unit="deg/s"), of="x")
    assert case.run.outcome().verdict == "NOT_EVALUATED"
    assert case.run.outcome().reasons == ("T-020 got no check of rate of y",)
    case.run.check("T-020", "rate", Figure(value=0.1, unit="deg/s"), of="y")
    assert case.run.outcome().verdict == "PASS"


def test_recordings_are_evaluated_at_the_end(tmp_path):
    """A requirement that asks for data is RECORDED by the recording alone."""
    case = Case(tmp_path, "T-030")
    case.run.record("field", case.field, duration=1.0, rate=10.0)
    case.run.finish()
    assert case.run.outcome().requirements == {"T-030": "RECORDED"}


def test_a_case_without_a_requirement_is_not_evaluated(tmp_path):
    """It runs, and supports nothing."""
    outcome = Case(tmp_path).run.outcome()
    assert (outcome.verdict, outcome.reasons) == ("NOT_EVALUATED", ("the case carries no requirement",))


def test_iterations_are_steps_that_count_from_one(tmp_path):
    """Each turn is a checkpoint with its number in the title."""
    case = Case(tmp_path)
    assert list(case.run.iterations("cycle", 3)) == [1, 2, 3]
    assert [step["path"] for step in case.written.of("step")] == [(f"cycle {n} of 3",) for n in (1, 2, 3)]


def test_an_error_of_hil_is_its_sentence(tmp_path):
    """The name of a class says nothing to whoever wrote the case; the sentence and what to do next do."""
    case = Case(tmp_path, "T-010")
    case.run.raised(Misused("T-010 ratio: a bare 1 has no unit", "give a Figure"), "test_x.py:3")
    assert case.run.outcome().reasons[0] == "T-010 ratio: a bare 1 has no unit; give a Figure (test_x.py:3)"


def test_no_memory_address_is_a_reason(tmp_path):
    """An object's place in memory differs from run to run, and evidence does not."""
    case = Case(tmp_path, "T-010")
    case.run.raised(ValueError(f"bad {object()!r}"))
    assert case.run.outcome().reasons[0] == "ValueError: bad <object object>"


def test_an_attempt_before_this_one_counts_unless_the_plan_says_that_it_may_be_repeated(tmp_path):
    """Read, killed, read again and passed is ABORTED, with what had been read; declared repeatable it passes."""
    before = Abandoned(case="a", void_to=9, t=3.0, count=1, read=("supply.load.voltage 9 V",), how="interrupted")
    for repeatable, verdict in (("", "ABORTED"), ("a resistor does not change", "PASS")):
        case = Case(tmp_path / verdict, "T-010")
        case.run.planned = replace(case.run.planned, repeatable=repeatable)
        case.run.given_up.append(before)
        good(case)
        outcome = case.run.outcome()
        assert (outcome.verdict, outcome.requirements) == (verdict, {"T-010": verdict})
        assert any("supply.load.voltage 9 V" in reason for reason in outcome.reasons) is (not repeatable)
