"""The past of a journal, which a resumed run comes to again."""

from __future__ import annotations

import pytest
from typed_events import event_of

from hil.evidence.journal.past import Past
from hil.evidence.journal.reader import read_journal
from hil.evidence.journal.writer import Journal
from hil.model.errors import Diverged

EVENTS = [("step", {"number": "one"}), ("note", {"text": "from a person"}), ("check", {"value": 1.5}), ("note", {})]


@pytest.fixture
def past(tmp_path):
    """A past of four events, two of them from outside."""
    with Journal(tmp_path / "journal.jsonl") as journal:
        for second, (kind, fields) in enumerate(EVENTS):
            journal.write(event_of(kind, **fields), float(second))
    return Past(read_journal(tmp_path / "journal.jsonl").lines)


def test_events_come_again_in_their_order(past):
    """An event that the journal holds is taken, what came from outside is passed over, and then the past is over."""
    assert past.take(event_of("step", number="one"), 0.0)
    assert not past.over
    assert past.take(event_of("check", value=1.5), 2.0)
    assert past.over
    assert not past.take(event_of("step", number="new"), 9.0)


def test_what_came_from_outside_may_come_again(past):
    """A note that a case itself causes again is taken in its place."""
    assert past.take(event_of("step", number="one"), 0.0)
    assert past.take(event_of("note", text="from a person"), 1.0)
    assert past.take(event_of("check", value=1.5), 2.0)


def test_what_comes_from_outside_now_is_new(past):
    """A note that nobody had written when the run was interrupted takes nothing from its past."""
    assert not past.take(event_of("note", text="just now"), 0.0)
    assert past.take(event_of("step", number="one"), 0.0)
    assert not past.take(event_of("note", text="just now"), 1.0)
    assert past.take(event_of("check", value=1.5), 2.0)


@pytest.mark.parametrize(
    ("kind", "t", "fields"), [("check", 2.0, {"value": 1.5}), ("step", 0.1, {"number": "one"}), ("step", 0.0, {})]
)
def test_another_event_is_refused(past, kind, t, fields):
    """Another kind, time or content than the journal holds is Diverged, and both are told."""
    with pytest.raises(Diverged, match="but its journal holds .*one"):
        past.take(event_of(kind, **fields), t)


def test_a_person_who_took_time_does_not_have_to_take_it_again(tmp_path):
    """A question comes before its time, and what was read while it waited comes before it."""
    fields = {"case": "c", "name": "fuse"}
    with Journal(tmp_path / "journal.jsonl") as journal:
        journal.write(event_of("question", **fields), 47.2)
        journal.write(event_of("monitor-late", limit="cell"), 48.0)
        journal.write(event_of("answer", value=True, **fields), 49.3)
        journal.write(event_of("effect", name="operator.fuse"), 49.3)
    past = Past(read_journal(tmp_path / "journal.jsonl").lines)
    assert past.take(event_of("monitor-late", limit="cell"), 48.0)
    assert past.take(event_of("question", **fields), 49.3)
    with pytest.raises(Diverged, match="the run gave"):
        past.take(event_of("answer", **{"value": False, **fields}), 49.3)
    assert past.take(event_of("answer", **{"value": True, **fields}), 49.3)
    assert past.take(event_of("effect", name="operator.fuse"), 49.3)
    assert past.over
