"""Attempts: what an interrupted case had read counts, unless its plan declares the case repeatable."""

from __future__ import annotations

import pytest
from evidence_runs import REQUIREMENTS, planned, run_fields
from typed_events import event_of

from hil.documents.canonical import parse_strict
from hil.evidence.attempts import Abandoned, abandoned
from hil.evidence.results.derived import derive
from hil.evidence.results.facts import Facts, entries_of
from hil.evidence.results.outcome import without_sentences, write_outcome
from hil.model.verdict import Verdict

READ = {
    "kind": "effect", "case": "test_a", "name": "supply.load.measure_current", "effect": "reads",
    "result": {"value": 0.04166, "unit": "A", "uncertainty": None, "dof": None, "status": "measured"},
}  # fmt: skip
DROVE = {"kind": "effect", "case": "test_a", "name": "supply.load.enable", "effect": "drives", "result": None}
BEGUN = {"kind": "case", "case": "test_a", "attempt": 1}
ASKED = {"requirement": "GYR-030", "parameter": "rate_error"}
CHECKED = [
    {
        "kind": "check",
        "case": "test_a",
        "requirement": "GYR-030",
        "parameter": "rate_error",
        "of": of,
        "verdict": "PASS",
    }
    for of in "xy"
]
ENDED = {
    "kind": "case-end", "case": "test_a", "attempt": 1, "verdict": "PASS", "reasons": [], "duration": 1.0,
    "requirements": {"GYR-030": "PASS"}, "used": {},
}  # fmt: skip


def resumed(boundary, void_to, rows=()):
    """Return that the run was entered again after the event `boundary`."""
    entry = {
        "place": 1, "boundary": boundary, "void_to": void_to, "operations": 0, "number": 1, "rows": list(rows),
        "kept": "",
    }  # fmt: skip
    return {"kind": "resumed", "number": 1, "entry": entry}


def happened(*bodies, repeatable=""):
    """Return the events of a run with one case; its first event after the head is number 2."""
    case = {**planned("test_a", ["GYR-030"]), **({"repeatable": repeatable} if repeatable else {})}
    head = [{"kind": "run", **run_fields()}, {"kind": "planned", "cases": [case]}]
    return [event_of(**{"seq": place, "t": float(place), **body}) for place, body in enumerate([*head, *bodies])]


def outcome_of(events, form=3):
    """Return the one case's outcome."""
    return derive(events, Facts(catalogue=entries_of(REQUIREMENTS)), content_digest="", form=form).cases[0]


KILLED = [BEGUN, READ, resumed(2, 3), READ, *CHECKED, ENDED]


def test_a_bad_reading_is_not_undone_by_killing_the_run():
    """Killed with -9 after a reading outside the limit, acknowledged and resumed: the first attempt counts."""
    found = outcome_of(happened(*KILLED))
    assert (found.verdict, found.requirements) == (Verdict.ABORTED, {"GYR-030": Verdict.ABORTED})
    why = "interrupted at 3 s without a verdict, after it had read supply.load.measure_current 0.04166 A"
    assert [(each.attempt, each.verdict, each.reasons) for each in found.attempts] == [
        (1, None, (why,)),
        (2, Verdict.PASS, ()),
    ]
    assert found.reasons == (f"an earlier attempt counts: {why}; the plan does not declare the case repeatable",)


def test_a_case_that_is_declared_repeatable_passes_and_shows_every_attempt():
    """What had been read is shown all the same, with the reason that the plan gives."""
    found = outcome_of(happened(*KILLED, repeatable="reading a resistor does not change it"))
    assert (found.verdict, found.requirements) == (Verdict.PASS, {"GYR-030": Verdict.PASS})
    assert found.repeatable == "reading a resistor does not change it"
    assert [(each.verdict, each.read) for each in found.attempts] == [
        (None, ("supply.load.measure_current 0.04166 A",)),
        (Verdict.PASS, ()),
    ]


def test_results_of_earlier_formats_are_derived_as_they_were():
    """A sealed package keeps its results, byte for byte."""
    found = outcome_of(happened(*KILLED), form=2)
    assert (found.verdict, len(found.attempts), found.repeatable) == (Verdict.PASS, 1, "")


@pytest.mark.parametrize(
    ("void", "rows", "read"),
    [
        ([DROVE], (), None),
        ([{**READ, "raised": "NoReply"}], (), None),
        ([{**READ, "effect": "waits"}], (), None),
        ([{"kind": "note", "text": "a door was opened"}], (), None),
        ([{**READ, "effect": "asks", "name": "operator.confirm", "result": True}], (), "operator.confirm True"),
        ([CHECKED[0]], (), "GYR-030 rate_error PASS"),
        ([{"kind": "fault", "case": "test_a", "device": "dut", "dut": True, "message": "silent"}], (), "dut: silent"),
        ([{"kind": "fault", "case": "test_a", "device": "psu", "dut": False, "message": "silent"}], (), None),
        (
            [{"kind": "recording", "recording": "001-x", "name": "x", "case": "test_a"}],
            [{"recording": "001-x", "first": 0, "end": 7}],
            "recording x, 7 rows",
        ),
        ([{"kind": "recording", "recording": "001-x", "name": "after", "case": None}], (), None),
    ],
    ids=["drove", "no answer", "waited", "outside", "asked", "checked", "DUT silent", "bench silent", "rows", "watch"],
)
def test_an_attempt_is_what_was_learnt(void, rows, read):
    """Readings, answers, rows, checks and a silent device count; what drove, waited or failed does not."""
    found = abandoned(happened(BEGUN, *void, resumed(2, 2 + len(void), rows)))
    assert [each.read for each in found] == ([] if read is None else [(read,)])


def test_only_what_became_void_was_read_again():
    """Rows that stand, and turns that had ended, are no attempt."""
    stands = happened(
        {"kind": "recording", "recording": "001-x", "name": "rest", "case": "test_a"},
        READ,
        {"kind": "step", "case": "test_a", "number": "2", "turn": 2},
        DROVE,
        resumed(4, 5, [{"recording": "001-x", "first": 9, "end": 9}]),
    )
    assert abandoned(stands) == ()


def test_every_interruption_of_a_turn_is_an_attempt():
    """Each tells what it had read itself, also where the turn is entered at the same place again."""
    found = abandoned(happened(BEGUN, READ, resumed(2, 3), DROVE, READ, READ, resumed(2, 7), READ))
    assert [(each.void_to, each.count) for each in found] == [(3, 1), (7, 2)]


def test_what_was_read_is_told_in_short():
    """The newest readings stand for a long attempt, with the number of those before."""
    (found,) = abandoned(happened(BEGUN, *[READ] * 900, resumed(2, 902)))
    assert (found.count, len(found.read)) == (900, 5)
    assert found.text.endswith("(895 more before)")
    stopped = {"kind": "stop", "reason": "Ada: weekend", "urgent": False, "resumable": True}
    (found,) = abandoned(happened(BEGUN, READ, stopped, resumed(2, 4)))
    assert found.text.startswith("stopped by Ada: weekend at 4 s")


def test_how_an_attempt_is_worded_is_no_part_of_what_is_verified(monkeypatch):
    """Another version of hil tells the same attempt otherwise; its results are the same without their sentences."""

    def results():
        return parse_strict(write_outcome(derive(happened(*KILLED), Facts(catalogue={}), content_digest="")))

    before = results()
    monkeypatch.setattr(Abandoned, "text", "in other words")
    assert results() != before
    assert without_sentences(results()) == without_sentences(before)
