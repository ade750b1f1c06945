"""How far a run is and how much bench time is left, from its events."""

from __future__ import annotations

import pytest
from typed_events import event_of

from hil.report.live.lines import one_line
from hil.report.live.outlook import Outlook


def taken(*events) -> Outlook:
    """Return the outlook after these events, each a kind, a time and its fields."""
    outlook = Outlook()
    for kind, t, fields in events:
        outlook.take(event_of(**{"kind": kind, "t": t, **fields}))
    return outlook


def planned(**limits):
    """Return the event that plans cases with these declared durations."""
    return ("planned", 0.0, {"cases": [{"case": case, "max_duration": limit} for case, limit in limits.items()]})


def turn(t, number, of=10, name="cycle"):
    """Return the beginning of one turn of a loop."""
    return ("step", t, {"path": [f"{name} {number} of {of}"], "number": str(number)})


def recording(t, case, duration):
    """Return the beginning of a recording."""
    return ("recording", t, {"recording": "r", "case": case, "duration": duration, "name": "rest", "channels": []})


def test_declared_durations_bound_what_is_left():
    """The present case counts from its beginning, cases to come as a whole, ended ones not at all."""
    outlook = taken(planned(a=100.0, b=50.0, c=30.0), ("case", 10.0, {"case": "a"}))
    outlook.at(40.0)
    assert outlook.left().at_most == pytest.approx(70 + 50 + 30)
    outlook.take(event_of(kind="not-run", t=40.0, case="c"))
    assert outlook.left().at_most == pytest.approx(70 + 50)


def test_turns_that_were_seen_tell_what_is_left():
    """After two turns of 10 s, of ten, and 4 s into the third, 76 s are left."""
    outlook = taken(
        planned(a=1e6),
        ("case", 5.0, {"case": "a"}),
        turn(5.0, 1),
        ("step-end", 15.0, {}),
        turn(15.0, 2),
        ("step-end", 25.0, {}),
        turn(25.0, 3),
    )
    outlook.at(29.0)
    left = outlook.left()
    assert (left.case, left.run) == (pytest.approx(76.0), pytest.approx(76.0))
    assert [str(each) for each in outlook.turns] == ["cycle 3 of 10"]


def test_nothing_is_foretold_from_nothing():
    """In the first turn of the first case only the bound is known."""
    left = taken(planned(a=600.0), ("case", 0.0, {"case": "a"}), turn(0.0, 1)).left()
    assert (left.case, left.run, str(left)) == (None, None, "at most 10 min left")


def test_a_recording_with_a_duration_tells_what_is_left():
    """An hour that has been recorded for ten minutes leaves fifty."""
    outlook = taken(planned(a=1e5), ("case", 0.0, {"case": "a"}), recording(60.0, "a", 3600.0))
    outlook.at(660.0)
    assert outlook.left().case == pytest.approx(3000.0)
    outlook.take(event_of(kind="recording-end", t=3660.0, recording="r"))
    assert outlook.left().case is None


def test_cases_of_one_function_take_as_long():
    """A parametrised case is foretold from its like; a run with an unknown case is not foretold as a whole."""
    ended = ("case-end", 20.0, {"case": "t[x]", "verdict": "PASS"})
    events = (("case", 0.0, {"case": "t[x]"}), ended, ("case", 20.0, {"case": "t[y]"}))
    both = taken(planned(**{"t[x]": 99.0, "t[y]": 99.0}), *events)
    both.at(25.0)
    assert both.left().run == pytest.approx(15.0)
    third = taken(planned(**{"t[x]": 99.0, "t[y]": 99.0, "u": 99.0}), *events)
    assert (third.left().case, third.left().run) == (pytest.approx(20.0), None)


def test_time_on_hold_is_no_time_of_the_case():
    """What passed while the bench was held does not bring a case nearer to its bound."""
    outlook = taken(planned(a=100.0), ("case", 0.0, {"case": "a"}), ("hold", 10.0, {"text": "door"}))
    assert outlook.held == "door"
    outlook.take(event_of(kind="hold-end", t=40.0))
    assert (outlook.held, outlook.left().at_most) == (None, pytest.approx(90.0))


def test_days_are_told_as_days():
    """Nobody counts 844 hours."""
    assert str(taken(planned(a=844 * 3600.0)).left()) == "at most 35 d 4 h left"


def test_one_line_tells_where_the_run_is():
    """Case, bench time, what is left, and step."""
    line = one_line(taken(planned(a=600.0), ("case", 0.0, {"case": "a"}), turn(60.0, 1)))
    assert line == "[1/1] 0:01:00.0 · at most 9 min left · 1 cycle 1 of 10"
