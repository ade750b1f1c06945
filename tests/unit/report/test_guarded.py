"""The guardian in the report: each time that it acted, before what became of the run then."""

from __future__ import annotations

import pytest
from typed_events import events_of

from hil.report.page.as_run import attributed
from hil.report.page.incidents import guarded, happenings

ACTING = {"event": "acting", "why": "the executive died", "utc": "2026-11-21T23:04:14.022418Z"}
OFF = [{"event": "off", "output": output, "ok": output != "tec"} for output in ("supply.charge", "tec", "cycler")]
FIRST = {"event": "first pass over", "seconds": 0.167}


def placed(*bodies):
    """Return the events of a journal, placed."""
    return attributed(events_of(bodies))


@pytest.mark.parametrize(
    ("last", "told"),
    [
        ([{"event": "done", "unproven": []}], "the guardian finished: every output is proven safe"),
        ([{"event": "done", "unproven": ["tec"]}], "the guardian finished: NOT PROVEN SAFE: tec"),
        ([], "whether every output was proven safe is not on record"),
        (
            [{"text": "{"}],
            "a line of the guardian's journal cannot be read: {; whether every output was proven safe is not on record",
        ),
    ],
)
def test_why_how_soon_and_what_was_proven(last, told):
    """What is not in its journal is not claimed; half a line is told as it stands."""
    (row,) = guarded([ACTING, *OFF, FIRST, *last])
    assert (row.at, row.kind) == (ACTING["utc"], "guardian")
    assert row.text == (
        "the guardian acted: the executive died; the guardian switched off supply.charge; tec did not take the"
        " guardian's command; the guardian switched off cycler; the guardian commanded every output off within 0.167 s;"
        f" {told}"
    )
    assert list(guarded([])) == []


def test_it_stands_before_what_became_of_the_run():
    """Each time it acted before the resumption after it, and what is left at the end."""
    acts = guarded([ACTING, {**ACTING, "why": "the executive hangs"}, {**ACTING, "why": "a wake"}])
    resumed = {"kind": "resumed", "t": 1.0, "text": "went on", "seconds": 1.0}
    said = {"kind": "acknowledged", "t": 1.0, "text": "all is off", "by": "Ada"}
    noted = {"kind": "note", "t": 2.0, "text": "cold", "by": "Ada"}
    rows = happenings(placed(noted, resumed, said, noted, resumed, said), {}, acts)
    assert [row.kind for row in rows if row.kind != "acknowledged"] == [
        "note", "guardian", "resumed", "note", "guardian", "resumed", "guardian",
    ]  # fmt: skip
    assert [row.text.partition(";")[0] for row in rows if row.kind == "guardian"] == [
        "the guardian acted: the executive died",
        "the guardian acted: the executive hangs",
        "the guardian acted: a wake",
    ]


def test_it_does_not_stand_before_a_resumption_after_a_stop():
    """A run that was stopped with its bench safe, and died later: nobody had anything to acknowledge at first."""
    resumed = {"kind": "resumed", "t": 1.0, "text": "went on", "seconds": 1.0}
    said = {"kind": "acknowledged", "t": 2.0, "text": "all is off", "by": "Ada"}
    rows = happenings(placed(resumed, resumed, said), {}, guarded([ACTING]))
    assert [row.kind for row in rows] == ["resumed", "guardian", "resumed", "acknowledged"]
