"""Heads of a running journal in the ledger: what it saw cannot be cut off, whoever edits the folder."""

from __future__ import annotations

import errno
import shutil
from datetime import timedelta

import pytest
from typed_events import event_of

from hil.clock import wall
from hil.evidence.folder import JOURNAL
from hil.evidence.journal.reader import read_journal
from hil.evidence.journal.writer import Journal
from hil.evidence.ledger.book import append, ledger_file, read
from hil.evidence.ledger.entries import Head
from hil.evidence.ledger.heads import require_uncut
from hil.evidence.package.verification import State, verify
from hil.evidence.runs import find_runs, status
from hil.executive.ending.stop import StopFlags
from hil.executive.journaling.events import Events
from hil.executive.journaling.heads import Heads
from hil.executive.resuming.earlier import find_earlier
from hil.executive.setup import head
from hil.model.errors import EvidenceError, Refused

READ = {"kind": "effect", "case": "a", "name": "supply.load.current", "effect": "reads", "result": 0.04166}
DROVE = {**READ, "effect": "drives"}
PASSED = {"kind": "check", "case": "a", "verdict": "PASS"}
HEAD_OF = [
    {"kind": "run", "format": 1},
    {"kind": "frozen", "files": {}},
    {"kind": "planned", "cases": [{"case": "a"}]},
]
BEGUN = [*HEAD_OF, {"kind": "case", "case": "a"}]


def ran(tmp_path, *bodies, live=True, ledger=None):
    """Write a run's journal, with the heads of it in the ledger; return its folder and what was told."""
    folder = tmp_path / "20261122T000000Z-load-1-abcdef"
    (folder / "data").mkdir(parents=True)
    if ledger is not None:
        ledger_file(tmp_path).parent.write_text(ledger)
    told = []
    with Journal(folder / JOURNAL) as journal:
        written = Events(journal, StopFlags())
        written.listen(Heads(folder, journal, told.append, source="hardware", all_of_them=live))
        for body in bodies:
            written.write(event_of(**body))
    return folder, told


def seen(tmp_path):
    """Return how many events the ledger saw of the run, each time, and its state then."""
    return [(each.events, each.state) for each in read(tmp_path).of(Head)]


def test_what_nobody_may_take_back_is_entered(tmp_path, monkeypatch):
    """The plan, the first reading of an attempt and of each turn, the case's end, and a stop."""
    monkeypatch.setattr("hil.clock.wall.monotonic", lambda: 7.0)
    turn = {"kind": "step", "case": "a", "number": "1", "turn": 1}
    ended, stop = {"kind": "case-end", "case": "a", "verdict": "PASS"}, {"kind": "stop", "resumable": True}
    folder, _ = ran(tmp_path, *BEGUN, DROVE, READ, READ, turn, DROVE, READ, PASSED, ended, stop)
    assert seen(tmp_path) == [
        (3, "RUNNING"),
        (6, "RUNNING"),
        (10, "RUNNING"),
        (12, "RUNNING"),
        (13, "INTERRUPTED"),
    ] or (seen(tmp_path)[3] == (11, "RUNNING"))
    require_uncut(folder, read_journal(folder / JOURNAL), "resume")


def test_a_bench_in_the_process_of_the_run_needs_its_beginning_and_its_stop(tmp_path):
    """It closes nothing, and costs no more."""
    ran(tmp_path, *BEGUN, READ, PASSED, {"kind": "stop"}, live=False)
    assert seen(tmp_path) == [(3, "RUNNING"), (7, "INTERRUPTED")]


def test_good_checks_one_after_the_other_are_one_entry(tmp_path, monkeypatch):
    """A thousand of them cost no thousand syncs; one that is not good is entered at once."""
    monkeypatch.setattr("hil.clock.wall.monotonic", lambda: 7.0)
    ran(tmp_path, *BEGUN, READ, *[PASSED] * 50, {**PASSED, "verdict": "FAIL"})
    assert [count for count, _ in seen(tmp_path)] == [3, 5, 56]


def test_a_journal_that_was_cut_is_not_resumed(tmp_path):
    """Cut after the first case, chain and all: what the ledger saw is missing, and is told with its day."""
    folder, _ = ran(tmp_path, *BEGUN, READ, {**PASSED, "verdict": "FAIL"})
    path = folder / JOURNAL
    whole = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(whole[:4]))
    day = read(tmp_path).of(Head)[-1].utc[:10]
    with pytest.raises(Refused, match=rf"cannot resume: the journal has 4 events, and the ledger saw event 6 on {day}"):
        find_earlier(folder)
    with pytest.raises(Refused, match="cannot seal: .*: it was cut"):
        require_uncut(folder, read_journal(path), "seal")
    found = verify(folder)
    assert (found.state, "it was cut" in str(found.findings)) == (State.DAMAGED, True)
    seen = status(folder)
    assert (seen.state, "it was cut" in seen.problem) == (State.DAMAGED, True)
    assert [run.state for run in find_runs(tmp_path)] == [State.DAMAGED]
    path.write_bytes(b"".join(whole))
    find_earlier(folder)


def test_a_journal_that_was_rewritten_is_not_resumed(tmp_path):
    """As long as before, with a whole chain, and other events."""
    folder, _ = ran(tmp_path, *BEGUN, READ)
    (folder / JOURNAL).unlink()
    with Journal(folder / JOURNAL) as journal:
        for body in [*BEGUN, {**READ, "result": 0.05}]:
            journal.write(event_of(**body), 0.0)
    with pytest.raises(Refused, match="event 3 of the journal is not the one that the ledger saw|event 5 of"):
        find_earlier(folder)


def test_a_ledger_that_cannot_be_written_is_told_once_and_stops_nothing(tmp_path):
    """The run goes on; its journal says that nobody outside saw it."""
    _, told = ran(tmp_path, *BEGUN, READ, READ, PASSED, {"kind": "stop"}, ledger="a file where a folder is due")
    assert len(told) == 1
    assert told[0].startswith("the ledger does not know how far this run came: ")


def test_a_run_is_told_that_the_ledger_has_a_later_time(tmp_path, monkeypatch):
    """A clock that was set back by 40 days between two runs on hardware; one that differs by a minute is none."""
    append(tmp_path, Head(run="before", events=1, sha256="0" * 64, state="RUNNING"))
    now = wall.seconds_of(wall.utc_now())
    for seconds, live in ((60.0, True), (40 * 86_400.0, False), (40 * 86_400.0, True)):
        moment = wall.epoch() + timedelta(seconds=now - seconds)
        monkeypatch.setattr(wall, "utc_now", lambda moment=moment: moment.strftime("%Y-%m-%dT%H:%M:%S.%fZ"))
        folder, told = ran(tmp_path, *HEAD_OF, live=live)
        assert len(told) == (live and seconds > 60.0)
        shutil.rmtree(folder)
    assert told[0].startswith("CLOCK: the times of this run cannot be believed: line 5 of")
    assert told[0].endswith("a clock was set back, or had been ahead")


def test_a_full_disk_is_told_with_the_folder_of_the_run(tmp_path, monkeypatch):
    """A write that fails names no file, and 'None' says nothing to anybody."""

    def write(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(head, "_freeze", write)
    with pytest.raises(EvidenceError, match=r"/run-1: cannot be frozen: No space left on device"):
        head.freeze(None, tmp_path / "run-1")
