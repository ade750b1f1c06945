"""The past of a journal, which a resumed run comes to again."""

from __future__ import annotations

import pytest

from hil.evidence.journal.past import Past
from hil.evidence.journal.reader import read_journal
from hil.evidence.journal.writer import Journal
from hil.model.errors import Diverged

EVENTS = [("step", {"title": "one"}), ("note", {"text": "from a person"}), ("check", {"value": 1.5}), ("note", {})]


@pytest.fixture
def past(tmp_path):
    """A past of four events, two of them from outside."""
    with Journal(tmp_path / "journal.jsonl") as journal:
        for second, (kind, fields) in enumerate(EVENTS):
            journal.write(kind, float(second), **fields)
    return Past(read_journal(tmp_path / "journal.jsonl").lines)


def test_events_come_again_in_their_order(past):
    """An event that the journal holds is taken, what came from outside is passed over, and then the past is over."""
    assert past.take("step", 0.0, {"title": "one"})
    assert not past.over
    assert past.take("check", 2.0, {"value": 1.5})
    assert past.over
    assert not past.take("step", 9.0, {"title": "new"})


def test_what_came_from_outside_may_come_again(past):
    """A note that a case itself causes again is taken in its place."""
    assert past.take("step", 0.0, {"title": "one"})
    assert past.take("note", 1.0, {"text": "from a person"})
    assert past.take("check", 2.0, {"value": 1.5})


def test_what_comes_from_outside_now_is_new(past):
    """A note that nobody had written when the run was interrupted takes nothing from its past."""
    assert not past.take("note", 0.0, {"text": "just now"})
    assert past.take("step", 0.0, {"title": "one"})
    assert not past.take("note", 1.0, {"text": "just now"})
    assert past.take("check", 2.0, {"value": 1.5})


@pytest.mark.parametrize(
    ("kind", "t", "fields"), [("check", 2.0, {"value": 1.5}), ("step", 0.1, {"title": "one"}), ("step", 0.0, {})]
)
def test_another_event_is_refused(past, kind, t, fields):
    """Another kind, time or content than the journal holds is Diverged, and both are told."""
    with pytest.raises(Diverged, match="but its journal holds .*one"):
        past.take(kind, t, fields)


def test_a_person_who_took_time_does_not_have_to_take_it_again(tmp_path):
    """A question comes before its time, and what was read while it waited comes before it."""
    fields = {"case": "c", "name": "fuse"}
    with Journal(tmp_path / "journal.jsonl") as journal:
        journal.write("question", 47.2, **fields)
        journal.write("monitor-late", 48.0, limit="cell")
        journal.write("answer", 49.3, value=True, **fields)
        journal.write("effect", 49.3, name="operator.fuse")
    past = Past(read_journal(tmp_path / "journal.jsonl").lines)
    assert past.take("monitor-late", 48.0, {"limit": "cell"})
    assert past.take("question", 49.3, fields)
    with pytest.raises(Diverged, match="the run came to"):
        past.take("answer", 49.3, {"value": False, **fields})
    assert past.take("answer", 49.3, {"value": True, **fields})
    assert past.take("effect", 49.3, {"name": "operator.fuse"})
    assert past.over
