"""Gates that people did not open, taken from the record."""

from __future__ import annotations

from typed_events import event_of

from hil.bench.gate import Gate
from hil.executive.resuming.earlier import not_opened
from hil.executive.watching.arming import FIRST_ARMING


def gate(name, *, ok=True, kind="host-gate"):
    """Return one gate."""
    return event_of(kind, name=name, ok=ok, detail="said so")


def entered(void_to):
    """Return the event of a run that was entered again."""
    return event_of("resumed", entry={"void_to": void_to})


ARMED = event_of("armed")
NO = Gate("confirmed again: fuse", ok=False, detail="said so")


def test_each_arming_has_the_gate_that_ended_it():
    """The first arming, and those at which the run was entered again; one that came to its end has none."""
    no = gate(NO.name, ok=False)
    assert not_opened([gate("a"), ARMED]) == {}
    assert not_opened([gate("a"), no]) == {FIRST_ARMING: NO}
    events = [gate("a"), ARMED, entered(7), no, entered(20), gate("a"), ARMED, entered(40), gate("a"), no]
    assert not_opened(events) == {7: NO, 40: NO}


def test_what_the_guardian_finds_at_last_ended_no_arming():
    """Nor does what follows a gate of the bench's own."""
    last = gate("guardian", ok=False)
    assert not_opened([gate("a"), ARMED, last]) == {}
    assert not_opened([gate("psu1", ok=False, kind="gate"), last]) == {}
    assert not_opened([gate("a"), ARMED, event_of("resumed"), last]) == {}  # went on where it was, and was not armed
