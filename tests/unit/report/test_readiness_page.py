"""How a report tells that the bench was armed and made safe."""

from __future__ import annotations

from typed_events import events_of

from hil.report.page.incidents import armings


def gate(t, name, detail="as it must", *, ok=True, kind="gate"):
    """Return one gate."""
    return {"kind": kind, "t": t, "name": name, "ok": ok, "detail": detail}


ARMED = {"kind": "armed", "t": 2.0}
RESUMED = {"kind": "resumed", "t": 60.0, "entry": {"boundary": 3}}


def told(*events):
    """Return title and gates of each arming."""
    return [(arming.title, [row.name for row in arming.gates]) for arming in armings(events_of(events))]


def test_one_arming_needs_no_title():
    """Also of a simulated run that went on in its arming, where it had been killed."""
    resumed = {"kind": "resumed", "t": 1.0}
    assert told(gate(1.0, "a"), resumed, gate(1.5, "b"), ARMED) == [("", ["a", "b"])]
    assert told(ARMED) == []


def test_every_arming_stands_by_itself():
    """Each with its bench time; an arming that was refused is followed by the next one."""
    events = (gate(1.0, "a"), ARMED, RESUMED, gate(61.0, "a", ok=False), RESUMED, gate(90.0, "a"), ARMED)
    assert told(*events) == [
        ("Arming, at 0:00:01.0 of bench time", ["a"]),
        ("Not armed again, at 0:01:01.0 of bench time", ["a"]),
        ("Armed again, at 0:01:30.0 of bench time", ["a"]),
    ]


def test_what_the_guardian_finds_at_last_is_no_gate_of_an_arming():
    """It looks at the bench when it is released."""
    last = gate(99.0, "guardian", "supply.main is not proven off", ok=False, kind="host-gate")
    assert told(gate(1.0, "a"), ARMED, last)[1] == (
        "At the release of the bench, at 0:01:39.0 of bench time",
        ["guardian"],
    )


def test_a_cut_path_that_was_not_tried_did_not_hold():
    """Nobody knows whether it would; one that was tried and failed is told as that."""
    found = armings(
        events_of(
            (
                gate(1.0, "cut path of cycler: relay", "within 1 s; not tried: no software is part of it"),
                gate(1.0, "cut path of supply: relay", "0.1 A before, 0 A after it"),
                gate(1.0, "reduced level", "not tried: words of something else"),
            )
        )
    )
    assert [row.tried for row in found[0].gates] == [False, True, True]
