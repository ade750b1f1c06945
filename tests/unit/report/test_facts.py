"""The facts at the head of a report: what bench time was, and who served the bench."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from typed_events import event_of

from hil.report.page.assemble import facts


def told(run):
    """Return value by label for a run that lasted two minutes."""
    material = SimpleNamespace(stamps=lambda: ("2026-11-21T20:00:00.5Z", ""), run=lambda: "a-run")
    asked = event_of("run", **run) if run else None
    return {fact.label: fact.value for fact in facts(material, asked, {}, [event_of("end", t=120.0)])}


@pytest.mark.parametrize(
    ("run", "source", "time"),
    [
        (
            {"source": "simulated", "epoch": "2026-01-01T08:00:00Z"},
            "simulated",
            "2 min, virtual from 2026-01-01T08:00:00Z",
        ),
        ({"source": "hardware", "live": {"speed": 1.0, "served": False}}, "hardware", "2 min"),
        (
            {"source": "simulated", "live": {"speed": 1.0, "served": True}},
            "simulated, served by another process",
            "2 min",
        ),
        (
            {"source": "simulated", "live": {"speed": 60.0, "served": True}},
            "simulated, served by another process",
            "2 min, at 60 times real time",
        ),
    ],
)
def test_bench_time_is_what_it_was(run, source, time):
    """Virtual time, real time, or real time at a speed; a served bench is no hardware."""
    found = told(run)
    assert (found["Source"], found["Bench time"]) == (source, time)


def test_stamps_are_read_to_the_second():
    """What is not recorded stays empty."""
    found = told({})
    assert (found["Started (UTC)"], found["Ended (UTC)"], found["Run"]) == ("2026-11-21 20:00:00", "", "a-run")
