"""What is said after a run that was interrupted: no way is offered that does not lead anywhere."""

from __future__ import annotations

import pytest
from typed_events import event_of

from hil.cli.died import ways_on
from hil.evidence.journal.writer import Journal
from hil.executive.resuming.earlier import find_earlier
from hil.model.errors import HilError

HEAD = {"run": {"format": 1}, "frozen": {"files": {}}, "planned": {"cases": []}}
LIVE = {**HEAD, "run": {"format": 1, "live": {"served": True, "speed": 1}}}
GATE = {"gate": {"name": "identity of psu1"}}
CASE = {"armed": {}, "case": {"case": "a"}}
STOP = {"reason": "SIGINT", "urgent": False}


@pytest.mark.parametrize(
    ("events", "why_not"),
    [
        ({"run": {"format": 1}}, "no case had begun"),
        (HEAD, ""),
        ({**HEAD, **GATE}, ""),
        ({**HEAD, **CASE}, ""),
        (LIVE, "no case had begun"),
        ({**LIVE, **GATE}, "no case had begun"),
        ({**LIVE, **CASE}, ""),
        ({**LIVE, **CASE, "results": {}}, "it has ended"),
        ({**HEAD, **CASE, "results": {}}, "it has ended"),
        ({**LIVE, **CASE, "stop": STOP}, "it was stopped for good"),
        ({**HEAD, **CASE, "stop": STOP}, "it was stopped for good"),
        ({**LIVE, **CASE, "stop": {**STOP, "resumable": True}}, ""),
    ],
)
def test_a_resume_is_offered_where_there_is_something_to_go_on_with(tmp_path, events, why_not):
    """That is where hil resume accepts the run; else why not, and what to do instead."""
    (tmp_path / "data").mkdir()
    with Journal(tmp_path / "data/journal.jsonl") as journal:
        for kind, fields in events.items():
            journal.write(event_of(kind, **fields), 0.0)
    try:
        accepted = bool(find_earlier(tmp_path))
    except HilError:
        accepted = False
    told = "\n".join(ways_on(tmp_path))
    assert accepted is not bool(why_not)
    assert ("hil resume" in told) is accepted
    assert f"hil seal {tmp_path}" in told
    assert why_not in told


def test_what_the_guardian_did_is_acknowledged_before_the_run_resumes(tmp_path, monkeypatch):
    """Without it a resume is refused; the line can be typed as it stands."""
    (tmp_path / "data").mkdir()
    with Journal(tmp_path / "data/journal.jsonl") as journal:
        for kind, fields in {**LIVE, **CASE}.items():
            journal.write(event_of(kind, **fields), 0.0)
    assert not any("hil ack" in way for way in ways_on(tmp_path))
    monkeypatch.setattr("hil.bench.lease.latches_of", lambda run: {tmp_path: run})
    _, acknowledge, resume, _ = ways_on(tmp_path)
    assert acknowledge.endswith(f': hil ack {tmp_path.name} --by NAME --text "what was seen and done"')
    assert resume == f"resume it: hil resume {tmp_path}"


def test_a_run_without_a_journal_is_not_resumed(tmp_path):
    """Its folder is all that it came to."""
    told = "\n".join(ways_on(tmp_path))
    assert "because its journal cannot be read" in told
