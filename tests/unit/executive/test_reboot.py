"""A machine that was started over between a run's end and its resumption."""

from __future__ import annotations

import pytest
from told_as_json import bodies
from typed_events import event_of

from hil.clock import wall
from hil.evidence.journal.reader import read_journal
from hil.evidence.journal.writer import Journal
from hil.executive.resuming.beginnings import Resumption
from hil.executive.resuming.earlier import find_earlier

EVENTS = {"run": {"format": 1}, "frozen": {"files": {}}, "planned": {"cases": []}, "case": {"case": "a"}}


def stamp_of(boot_id):
    """Return a stamp of the machine as it runs since this boot."""
    return lambda: wall.WallStamp(utc="2026-01-01T10:00:00.000000Z", boot=5.0, boot_id=boot_id)


@pytest.mark.parametrize(("boot_id", "kinds"), [("another", ["reboot", "resumed"]), ("one", ["resumed"])])
def test_a_reboot_is_an_event(tmp_path, monkeypatch, boot_id, kinds):
    """It stands in the journal before anything of the machine as it is now, and says how long it took."""
    path = tmp_path / "data" / "journal.jsonl"
    path.parent.mkdir()
    with Journal(path, stamp=stamp_of("one")) as journal:
        for kind, fields in EVENTS.items():
            journal.write(event_of(kind, **fields), 0.0)
    monkeypatch.setattr(wall, "stamp", stamp_of(boot_id))
    monkeypatch.setattr(wall, "seconds_since", lambda _: 7200.04)
    earlier = find_earlier(tmp_path)
    with Journal(path, stamp=stamp_of(boot_id)) as journal:
        Resumption(earlier, journal).resume(0.0, None)
    written = bodies(read_journal(path))[len(EVENTS) :]
    assert [(body["kind"], body["seconds"]) for body in written] == [(kind, 7200.0) for kind in kinds]
