"""What a person at the running terminal sees."""

from __future__ import annotations

import io

import pytest
from rich.text import Text
from typed_events import event_of

from hil.plugin.terminal.progress import Progress, folded


def shown(*events):
    """Return what progress writes of these events."""
    stream = io.StringIO()
    progress = Progress(stream)
    for event in events:
        progress(event_of(**event))
    return stream.getvalue()


@pytest.mark.parametrize(
    ("event", "line"),
    [
        ({"kind": "note", "text": "door opened", "by": "Ada"}, "note: door opened (Ada)"),
        ({"kind": "note", "text": "door opened", "by": ""}, "note: door opened (by whom is not recorded)"),
        (
            {"kind": "attachment", "file": "1-nc-photo.txt", "text": "a photo", "by": "Ada", "sha256": "00"},
            "attachment: 1-nc-photo.txt: a photo (Ada)",
        ),
        ({"kind": "anomaly", "text": "inbox, hold by Ada: tea"}, "anomaly: inbox, hold by Ada: tea"),
    ],
    ids=["note", "nobody", "attachment", "hold"],
)
def test_what_another_terminal_says_is_acknowledged(event, line):
    """A note, an attachment, or anything else from the inbox is a line at once."""
    gate = {"kind": "gate", "ok": True, "name": "identity", "detail": "as it should be"}
    assert shown(gate, event) == f"  {line}\n"


@pytest.mark.parametrize(
    ("kind", "value", "line"),
    [
        ("answer", True, "answered fuse: yes (Ada)"),
        ("answer", False, "answered fuse: no (Ada)"),
        ("answer", 3.7, "answered fuse: 3.7 (Ada)"),
        ("answer", "container", "answered fuse: container (Ada)"),
        ("confirmed", True, "confirmed again fuse: yes (Ada)"),
    ],
)
def test_an_answer_is_shown_as_it_was_given(kind, value, line):
    """Who typed yes reads yes."""
    assert shown({"kind": kind, "name": "fuse", "value": value, "by": "Ada"}) == f"  {line}\n"


def test_anomalies_of_sources_are_left_to_the_report():
    """What is wrong with the source of a requirement is known before the run, and does not hide what happens."""
    assert shown({"kind": "anomaly", "text": "A-1, source ECSS: the sign is wrong"}) == ""


def test_a_reason_stands_beside_its_check_only():
    """Why a check is not good is not told again when its case ends; other reasons are."""
    of = {"of": "x", "expanded": None, "unit": "V", "limit": {"max": "1"}, "limit_unit": "V"}
    check = {"kind": "check", "requirement": "A-1", "parameter": "u", "value": 3.0, "verdict": "FAIL", **of}
    reasons = ["A-1 u of x is FAIL: too high", "the case took too long"]
    end = {"kind": "case-end", "case": "c", "verdict": "FAIL", "duration": 1.0, "reasons": reasons}
    told = shown({"kind": "case", "case": "c"}, check | {"reason": "too high"}, end)
    assert told.count("too high") == 1
    assert "    the case took too long\n" in told


def test_a_trip_is_told_once_and_the_safe_end_once():
    """Why the bench tripped stands at the trip only; the end of the run says that the bench is safe."""
    why = "thermometer: temperature 60.2 degC is above 60 degC"
    reasons = [
        why,
        f"{why}; the bench was made safe and stays so for the rest of the run (test_x.py:9)",
        "no check of x",
    ]
    safe = {"kind": "safe-end", "ok": True}
    end = {"kind": "case-end", "case": "c", "verdict": "ERROR", "duration": 1.0, "reasons": reasons}
    trip = {"kind": "trip", "limit": "plate", "text": why}
    told = shown({"kind": "case", "case": "c"}, trip, safe, end, safe)
    assert (
        told.count(why)
        == told.count("bench safe: every output proven")
        == told.count("  made safe, and kept safe")
        == 1
    )
    assert "    no check of x\n" in told
    assert "THE BENCH COULD NOT BE PROVEN SAFE" in shown(trip, safe | {"ok": False})


def test_lines_break_between_words_on_a_terminal():
    """The colour of the verdict stays, and what follows is indented; a file gets lines as they are."""
    line = Text("  A-1 voltage = 3 V  (1 to 2 V)  ")
    line.append("FAIL", "red")
    line.append("  3 V is above the maximum of 2 V")
    assert [part.plain for part in folded(line, 40)] == [
        "  A-1 voltage = 3 V  (1 to 2 V)  FAIL  3",
        "    V is above the maximum of 2 V",
    ]
    assert any(span.style == "red" for span in folded(line, 40)[0].spans)
    assert [part.plain for part in folded(line, 0)] == [line.plain]


def test_cases_that_are_not_run_for_one_reason_are_grouped():
    """A stopped run of many cases does not print one line for each of them."""
    stopped = [{"kind": "not-run", "case": f"test_x.py::test_{n}", "reason": "stopped by Ada"} for n in range(9)]
    skipped = {"kind": "not-run", "case": "test_x.py::test_other", "reason": "no jig"}
    assert shown(*stopped, skipped).splitlines() == [
        "test_0 NOT_RUN: stopped by Ada",
        "further cases are NOT_RUN for the same reason",
        "test_other NOT_RUN: no jig",
    ]


def test_nothing_that_a_case_says_drives_the_terminal(monkeypatch):
    """Titles, reasons and texts stand in coloured lines, which a display lets through."""
    monkeypatch.setenv("TERM", "xterm")
    written = shown(
        {"kind": "planned", "cases": [{"case": "p/t.py::test_a", "title": "clears\x1b[2J", "requirements": []}]},
        {"kind": "case", "case": "p/t.py::test_a"},
        {"kind": "fault", "dut": False, "message": "psu1: \x9b2J", "hint": "look\rPASS"},
        {"kind": "note", "text": "\u202edlrow", "by": "Ada"},
    )
    assert not set(written) & {"\x1b", "\x9b", "\r", "\u202e"}
    for part in ("clears\\u001b[2J", "psu1: \\u009b2J", "look\\u000dPASS", "\\u202edlrow"):
        assert part in written
