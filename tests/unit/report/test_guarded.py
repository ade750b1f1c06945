"""The guardian in the report: each time that it acted, before what became of the run then."""

from __future__ import annotations

import json

import pytest

from hil.report.page.incidents import guarded, happenings

ACTING = {"event": "acting", "why": "the executive died", "utc": "2026-11-21T23:04:14.022418Z"}
OFF = [{"event": "off", "output": output, "ok": output != "tec"} for output in ("supply.charge", "tec", "cycler")]
FIRST = {"event": "first pass over", "seconds": 0.167}


def journal(*lines):
    """Return a guardian's journal."""
    return "".join(f"{json.dumps(line)}\n" for line in lines)


@pytest.mark.parametrize(
    ("last", "told"),
    [
        ([{"event": "done", "unproven": []}], "every output was proven safe; the bench was latched"),
        ([{"event": "done", "unproven": ["tec"]}], "NOT proven safe: tec; the bench was latched"),
        ([], "whether all was proven safe is not written down"),
    ],
)
def test_why_how_soon_and_what_was_proven(last, told):
    """What is not in its journal is not claimed; half a line is left out."""
    (row,) = guarded(journal(ACTING, *OFF, FIRST, *last) + '{"event": "do')
    assert (row.at, row.kind) == (ACTING["utc"], "guardian")
    assert row.text == f"the executive died; it switched off supply.charge, cycler within 0.167 s; {told}"
    assert list(guarded("")) == []


def test_it_stands_before_what_became_of_the_run():
    """Each time it acted before the resumption behind it, and what is left at the end."""
    acts = guarded(journal(ACTING, {**ACTING, "why": "the executive hangs"}, {**ACTING, "why": "a wake"}))
    resumed = {"kind": "resumed", "t": 1.0, "text": "went on", "seconds": 1.0}
    said = {"kind": "acknowledged", "t": 1.0, "text": "all is off", "by": "Ada"}
    noted = {"kind": "note", "t": 2.0, "text": "cold", "by": "Ada"}
    rows = happenings([noted, resumed, said, noted, resumed, said], {}, acts)
    assert [row.kind for row in rows if row.kind != "acknowledged"] == [
        "note", "guardian", "resumed", "note", "guardian", "resumed", "guardian",
    ]  # fmt: skip
    assert [row.text.partition(";")[0] for row in rows if row.kind == "guardian"] == [
        "the executive died",
        "the executive hangs",
        "a wake",
    ]


def test_it_does_not_stand_before_a_resumption_behind_a_stop():
    """A run that was stopped with its bench safe, and died later: nobody had anything to acknowledge at first."""
    resumed = {"kind": "resumed", "t": 1.0, "text": "went on", "seconds": 1.0}
    said = {"kind": "acknowledged", "t": 2.0, "text": "all is off", "by": "Ada"}
    rows = happenings([resumed, resumed, said], {}, guarded(journal(ACTING)))
    assert [row.kind for row in rows] == ["resumed", "guardian", "resumed", "acknowledged"]
