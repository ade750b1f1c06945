"""An interrupted run as it is found, and where it can be entered again."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import pytest
from told_as_json import bodies
from typed_events import event_of

from hil.evidence.events import Entry, Failed, Voided
from hil.evidence.journal.past import entries
from hil.evidence.journal.reader import read_journal
from hil.evidence.journal.writer import Journal
from hil.evidence.state import standing
from hil.executive.resuming.beginnings import ResumedRun, Resumption
from hil.executive.resuming.earlier import find_earlier
from hil.executive.resuming.preconditions import require_answers
from hil.executive.setup.configuration import Request
from hil.model.errors import Refused

HEAD_OF = {"run": {"format": 1}, "frozen": {"files": {}}, "planned": {"cases": []}}
CASE = [("armed", {}), ("case", {"case": "a"}), ("step", {"number": "1", "turn": 1}), ("step-end", {"number": "1"})]
TURN = [*CASE, ("step", {"number": "2", "turn": 2}), ("step", {"number": "2.1"}), ("effect", {"effect": "drives"})]
ENDED = [*CASE, ("case-end", {"case": "a", "verdict": "PASS"})]
STOP = [("stop", {"reason": "weekend", "urgent": False, "resumable": True}), ("safe-end", {"ok": True})]

VOID = (Voided(recording="x", first=1, end=2),)


def folder_of(tmp_path, *parts):
    """Return a run's folder with these events after its head."""
    (tmp_path / "data").mkdir()
    with Journal(tmp_path / "data/journal.jsonl") as journal:
        for second, (kind, fields) in enumerate([*HEAD_OF.items(), *(event for part in parts for event in part)]):
            journal.write(event_of(kind, **fields), float(second))
    return tmp_path


def open_recording(continues):
    """Return the beginning of a recording."""
    return [("recording", {"recording": "007-a", "case": "a", **({"continues": True} if continues else {})})]


ABORTED = [
    ("recording-end", {"recording": "007-a", "complete": False}),
    ("case-end", {"case": "a", "verdict": "ABORTED"}),
]


@pytest.mark.parametrize(
    ("parts", "place", "kept"),
    [
        ([TURN, ABORTED, STOP], 8, ""),
        ([ENDED, STOP], 8, ""),
        ([CASE[:2], ABORTED, STOP], 5, ""),
        ([CASE, open_recording(True), ABORTED, STOP], 8, "007-a"),
        ([CASE, open_recording(False), ABORTED, STOP], 6, ""),
    ],
)
def test_a_stopped_run_is_entered_at_its_last_beginning(tmp_path, parts, place, kept):
    """That is the recording that continues, the turn, the case, or the end of the case before."""
    boundary = find_earlier(folder_of(tmp_path, *parts)).boundary
    assert (boundary.place, boundary.sequence, boundary.kept) == (place, place - 1, kept)


LIVE = {"format": 1, "live": {"served": True, "speed": 1}}
PLANNED = {"cases": [{"case": "a"}, {"case": "b"}]}
LEFT_OUT = [("not-run", {"case": "b", "reason": "the envelope tripped"})]
WATCHED = [("safe-end", {"ok": True}), ("recording", {"recording": "after-x", "case": None})]


@pytest.mark.parametrize(
    ("parts", "over"),
    [
        ([ENDED], False),
        ([ENDED, LEFT_OUT, WATCHED], True),
        ([ENDED, LEFT_OUT, STOP], False),
        ([CASE, ABORTED, LEFT_OUT], False),
        ([ENDED, [("case", {"case": "b"}), ("case-end", {"case": "b", "verdict": "ERROR"})], WATCHED, STOP], True),
    ],
    ids=["one to come", "one left out", "stopped before it", "none whole", "both ended"],
)
def test_a_run_is_over_once_every_case_has_its_outcome(tmp_path, monkeypatch, parts, over):
    """What a stop kept from running is still to be run; what was begun after the last case comes again as a whole."""
    monkeypatch.setitem(HEAD_OF, "run", LIVE)
    monkeypatch.setitem(HEAD_OF, "planned", PLANNED)
    earlier = find_earlier(folder_of(tmp_path, *parts))
    assert earlier.boundary.over is over
    assert earlier.begun_after == (("after-x",) if WATCHED in parts else ())


def test_a_killed_run_goes_on_where_it_was(tmp_path):
    """Without a stop there is no boundary; its next recording has a new number."""
    earlier = find_earlier(folder_of(tmp_path, TURN, open_recording(False)))
    assert (earlier.boundary, earlier.next_recording, earlier.own_course) == (None, 8, 3)


CUT = [("effect", {"effect": "waits", "raised": "Stopped"})]
STOPPED = [("case-end", {"case": "a", "verdict": "ABORTED", "reasons": ["stopped by disk full"]})]
GAP = [("anomaly", {"text": "disk full: 3 events before this one could not be written"})]
UNWRITTEN = [("anomaly", {"text": "disk full: operations before this event could not be written"})]
NEXT = [("step", {"number": "3", "turn": 3})]


@pytest.mark.parametrize("stop", [[], STOP], ids=["without stop", "stop"])
@pytest.mark.parametrize("ending", [CUT, STOPPED, GAP, UNWRITTEN], ids=["cut", "aborted", "gap", "unwritten"])
def test_a_run_is_not_entered_past_its_end(tmp_path, ending, stop):
    """A case hears of a stop before the journal does, and a full disk leaves events out; nothing retraces that."""
    assert find_earlier(folder_of(tmp_path, TURN, ending, NEXT, stop)).boundary.sequence == 7


def test_an_attempt_that_counts_is_no_end(tmp_path):
    """The case is ABORTED for what was read before the run was resumed; the killed run goes on where it was."""
    ended = [("case-end", {"case": "a", "verdict": "ABORTED", "reasons": ["an earlier attempt counts: stopped by"]})]
    assert find_earlier(folder_of(tmp_path, CASE, ended)).boundary is None


def test_a_gap_that_is_void_keeps_nothing_from_being_entered(tmp_path):
    """Anomalies stand for ever; the run was entered before this one."""
    folder = folder_of(tmp_path, TURN, GAP, STOP)
    found = find_earlier(folder)
    entry = Entry(place=8, boundary=7, void_to=found.lines[-1].event.seq, operations=5, number=1, rows=(), kept="")
    with Journal(folder / "data/journal.jsonl") as journal:
        Resumption(found, journal).resume(99.0, entry)
        journal.write(event_of("step", number="2.1"), 99.0)
    assert find_earlier(folder).boundary is None


@pytest.mark.parametrize(
    ("parts", "why"),
    [
        ([CASE, [("results", {})]], "has ended"),
        ([CASE, [("recovered", {})]], "is sealed in part"),
        ([CASE, [("stop", {"reason": "smell"})]], "stop for good"),
        ([CASE[:1], STOP], "no case had begun"),
    ],
)
def test_what_cannot_be_gone_on_with_is_refused(tmp_path, parts, why):
    """A run that has ended, is sealed in part, was stopped for good, or never began."""
    with pytest.raises(Refused, match=why):
        find_earlier(folder_of(tmp_path, *parts))


def test_void_events_do_not_stand(tmp_path):
    """Between boundary and entry nothing stands but what came from outside; a second entry there takes its place."""
    note = [("note", {"text": "a door was opened"})]
    folder = folder_of(tmp_path, TURN, note, ABORTED, STOP)
    earlier = find_earlier(folder)
    for number in (1, 2):
        entry = Entry(
            place=8,
            boundary=7,
            void_to=13 + number,
            operations=5,
            number=8,
            rows=VOID,
            kept="",
        )
        with Journal(folder / "data/journal.jsonl") as journal:
            Resumption(earlier, journal).resume(99.0, entry)
    events = read_journal(folder / "data/journal.jsonl").events
    assert [event.kind() for event in standing(events)][8:] == ["note", "resumed", "resumed"]
    assert [entry.rows for entry, _ in entries(events)] == [VOID] * 2
    assert {t for _, t in entries(events)} == {99.0}


def test_a_run_that_somebody_went_on_with_is_not_gone_on_with_twice(tmp_path):
    """What was found has to be there still once the folder is held."""
    folder = folder_of(tmp_path, TURN)
    earlier = find_earlier(folder)
    ResumedRun(earlier).take_over(folder)
    with Journal(folder / "data/journal.jsonl") as journal:
        journal.write(event_of("note", text="of another process"), 100.0)
    with pytest.raises(Refused, match="another process has resumed it"):
        ResumedRun(earlier).take_over(folder)


@pytest.mark.parametrize(
    ("by", "answers", "person", "refused"),
    [
        ("simulated person", None, False, False),
        ("answers.yaml", None, False, True),
        ("answers.yaml", Path("answers.yaml"), False, False),
        ("Ada", None, True, False),
        ("Ada", None, False, True),
    ],
)
def test_who_answered_before_is_not_replaced_without_a_word(tmp_path, by, answers, person, refused):
    """Where a file or a person answered, the simulated person does not step in unasked."""
    answer = [("answer", {"case": "a", "name": "jig", "value": True, "by": by})]
    earlier = find_earlier(folder_of(tmp_path, CASE, answer))
    request = Request(start=tmp_path, plans=(), bench="b", dut="d", answers=answers, person=person)
    with pytest.raises(Refused, match=by) if refused else nullcontext():
        require_answers(earlier, request)


def test_a_run_that_was_killed_is_not_said_to_have_been_stopped(tmp_path, monkeypatch):
    """The stop after which it had gone on before is void: it was interrupted this time."""
    monkeypatch.setitem(HEAD_OF, "run", LIVE)
    folder = folder_of(tmp_path, CASE, STOP)
    for following in (TURN[len(CASE) :], []):
        found = find_earlier(folder)
        at, last = found.boundary, found.lines[-1].event.seq
        entry = Entry(place=at.place, boundary=at.sequence, void_to=last, operations=5, number=1, rows=(), kept="")
        with Journal(folder / "data/journal.jsonl") as journal:
            Resumption(found, journal).resume(99.0, entry)
            for kind, fields in following:
                journal.write(event_of(kind, **fields), 99.0)
    events = bodies(read_journal(folder / "data/journal.jsonl"))
    told = [event["text"].partition(",")[0] for event in events if event["kind"] == "resumed"]
    assert told == ["stopped by weekend", "interrupted"]


def check(verdict, reason=""):
    """Return a check of case a."""
    told = {"case": "a", "requirement": "A-1", "parameter": "x", "of": None, "verdict": verdict, "reason": reason}
    return [("check", told)]


LOST = [("lost", {"what": "port", "device": "psu1", "text": "psu1: its port is gone"})]


@pytest.mark.parametrize("ending", [STOP, LOST + STOP], ids=["stopped", "lost"])
def test_what_failed_before_the_end_is_not_undone_by_a_pause(tmp_path, ending):
    """It counts although its turn is made again; what came of a bench that was lost does not."""
    failed = [*check("FAIL", "too high"), *check("PASS")]
    earlier = find_earlier(
        folder_of(tmp_path, TURN, failed, ending[:1], check("FAIL", "no reply"), ABORTED, ending[1:])
    )
    assert earlier.boundary.sequence == 7
    assert earlier.failed == (Failed(case="a", requirement="A-1", parameter="x", of=None, reason="too high"),)


def test_what_failed_before_the_point_of_entry_comes_again(tmp_path):
    """Nobody has to remember it."""
    assert find_earlier(folder_of(tmp_path, CASE, check("FAIL"), TURN[4:], STOP)).failed == ()
