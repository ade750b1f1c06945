"""How long a live bench stood while its run was interrupted, in bench time."""

from __future__ import annotations

import pytest
from typed_events import event_of

from hil.clock import wall
from hil.evidence.journal.writer import Journal
from hil.executive.resuming.earlier import find_earlier

HEAD = {"run": {"format": 1, "live": {"speed": 4.0, "served": True}}, "frozen": {"files": {}}, "planned": {"cases": []}}


def stood(tmp_path, monkeypatch, *moments):
    """Return how long it stood: seconds since boot and bench time of each event, and the seconds since boot now."""
    *events, now = moments
    boot = [0.0]

    def stamp():
        return wall.WallStamp(utc="2026-01-01T10:00:00.000000Z", boot=boot[0], boot_id="one")

    (tmp_path / "data").mkdir()
    with Journal(tmp_path / "data" / "journal.jsonl", stamp=stamp) as journal:
        for kind, fields in HEAD.items():
            journal.write(event_of(kind, **fields), 0.0)
        for boot[0], t in events:
            journal.write(event_of("case", case="a"), t)
    boot[0] = now
    monkeypatch.setattr(wall, "stamp", stamp)
    return find_earlier(tmp_path).stood_s


def test_it_stood_since_the_newest_event(tmp_path, monkeypatch):
    """Seconds of boot time are so many times the bench's."""
    assert stood(tmp_path, monkeypatch, (100.0, 10.0), (101.0, 14.0), 111.0) == pytest.approx(40.0)


def test_a_suspend_right_before_that_counts(tmp_path, monkeypatch):
    """An event that was written after a wake, before bench time had come to it, does not hide the hours of sleep."""
    assert stood(tmp_path, monkeypatch, (100.0, 10.0), (7300.0, 10.0), 7310.0) == pytest.approx(4 * 7210.0)
