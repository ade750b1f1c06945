"""The journal: lines, chain, sequence, and what is on the disk when."""

from __future__ import annotations

import hashlib
import json
import os
import threading

import pytest
from evidence_runs import stamps
from told_as_json import bodies
from typed_events import event_of

from hil.documents.canonical import JsonError, canonical
from hil.evidence.journal import reader
from hil.evidence.journal.reader import cut_torn_tail, read_journal
from hil.evidence.journal.writer import Journal
from hil.model.errors import EvidenceError, Refused


def journal_of(path, **options):
    """Return a journal with a wall clock of its own."""
    return Journal(path / "journal.jsonl", stamp=stamps(), **options)


def test_every_line_is_canonical_and_chained(tmp_path):
    """A line is canonical JSON, holds the hash of the line before, and its body holds no wall time."""
    with journal_of(tmp_path) as journal:
        assert [
            journal.write(event_of("note", text="é\n", by="Ada"), 0.5),
            journal.write(event_of("note", text="", by=""), 1.0),
        ] == [0, 1]
    first, second = (tmp_path / "journal.jsonl").read_bytes().splitlines()
    assert [canonical(json.loads(line)) for line in (first, second)] == [first, second]
    assert json.loads(first)["prev"] == "0" * 64
    assert json.loads(second)["prev"] == hashlib.sha256(first).hexdigest()
    assert json.loads(first)["body"] == {"by": "Ada", "kind": "note", "seq": 0, "t": 0.5, "text": "é\n"}
    assert json.loads(first)["wall"] == {"boot": 1.5, "boot_id": "one-boot", "utc": "2026-11-21T10:00:00.000000Z"}


def test_equal_runs_have_equal_content_digests(tmp_path):
    """The digest is over the bodies, so another day gives the same one, and another value another."""
    digests = []
    for name, day, text in (("a", "2026-11-21", "x"), ("b", "2027-01-01", "x"), ("c", "2026-11-21", "y")):
        with Journal(tmp_path / name, stamp=stamps(day)) as journal:
            journal.write(event_of("note", text=text, by=""), 1.0)
            digests.append(journal.content_digest)
        assert read_journal(tmp_path / name).content_digest == digests[-1]
    assert digests[0] == digests[1] != digests[2]


@pytest.mark.parametrize("value", [float("nan"), float("inf"), {1: 2}, object(), 2**60])
def test_what_json_does_not_have_is_refused_and_not_written(tmp_path, value):
    """NaN and its like raise, and the journal goes on as if nothing had been asked."""
    with journal_of(tmp_path) as journal:
        with pytest.raises(JsonError):
            journal.write(event_of("note", text=value), 0.0)
        assert journal.write(event_of("note", text="fine"), 0.0) == 0
    assert not read_journal(tmp_path / "journal.jsonl").findings


def test_edges_and_verdicts_are_synced(tmp_path):
    """Steps, checks and safety are on the disk when write returns; effects and notes have left the process only."""
    synced = []
    with journal_of(tmp_path, sync=synced.append) as journal:
        journal.write(event_of("effect"), 0.0)
        journal.write(event_of("note"), 0.0)
        assert not synced
        for kind in ("step", "step-end", "check", "trip", "safe", "safe-end", "case-end", "results", "end"):
            journal.write(event_of(kind), 0.0)
            assert synced, kind
            synced.clear()


def test_what_is_not_synced_at_once_is_within_half_a_second(tmp_path):
    """The beginning of a recording waits for no step: the next tick half a second later brings it to the disk, once."""
    synced, now = [], [10.0]
    with journal_of(tmp_path, sync=synced.append, now=lambda: now[0]) as journal:
        journal.tick()
        journal.write(event_of("recording"), 0.0)
        now[0] += 0.4
        journal.write(event_of("recording-end"), 0.0)
        journal.tick()
        assert not synced
        now[0] += 0.1
        journal.tick()
        journal.tick()
        assert len(synced) == 1
        journal.write(event_of("effect"), 0.0)
        journal.write(event_of("step-end"), 0.0)
        now[0] += 9.0
        journal.tick()
        assert len(synced) == 2


def test_bench_time_is_written_to_the_nanosecond(tmp_path):
    """More digits than nanoseconds would not repeat between machines."""
    with journal_of(tmp_path) as journal:
        journal.write(event_of("note"), 0.1234567891234)
    assert read_journal(tmp_path / "journal.jsonl").events[0].t == 0.123456789


def test_a_journal_that_exists_is_continued(tmp_path):
    """Sequence, chain, digest and time go on where they were."""
    with journal_of(tmp_path) as journal:
        journal.write(event_of("note", text="before"), 3.0)
    with journal_of(tmp_path) as journal:
        assert journal.last_t == 3.0
        assert journal.write(event_of("note", text="after"), 4.0) == 1
        digest = journal.content_digest
    reading = read_journal(tmp_path / "journal.jsonl")
    assert reading.findings == ()
    assert reading.content_digest == digest


@pytest.mark.parametrize("damage", [lambda data: data[:-1], lambda data: data.replace(b"before", b"behind")])
def test_a_torn_or_changed_journal_is_not_continued(tmp_path, damage):
    """Going on after a damage would hide it."""
    path = tmp_path / "journal.jsonl"
    with journal_of(tmp_path) as journal:
        journal.write(event_of("note", text="before"), 3.0)
        journal.write(event_of("note", text="last"), 3.0)
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(EvidenceError, match="hil verify"):
        journal_of(tmp_path)


def test_the_reader_names_the_line_where_the_chain_breaks(tmp_path):
    """A changed line is found by the next one's predecessor, a lost one by chain and sequence."""
    path = tmp_path / "journal.jsonl"
    with journal_of(tmp_path) as journal:
        for number in range(4):
            journal.write(event_of("note", text=str(number)), 0.0)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([lines[0], lines[1].replace(b'"1"', b'"7"'), *lines[2:]]))
    assert [(found.line, "chain" in found.message) for found in read_journal(path).findings] == [(3, True)]
    path.write_bytes(b"".join([lines[0], *lines[2:]]))
    assert {found.line for found in read_journal(path).findings} == {2, 3}


@pytest.mark.parametrize(
    "line",
    [b"", b"{}", b"[]", b"nonsense", b'{"body":{},"prev":"","wall":{}}', b'{"body":1,"prev":"","wall":{}}', b"\xff"],
)
def test_a_line_that_is_no_event_is_a_finding(tmp_path, line):
    """Whatever stands in a journal, reading it gives findings and no traceback."""
    path = tmp_path / "journal.jsonl"
    path.write_bytes(line + b"\n")
    reading = read_journal(path)
    assert [found.line for found in reading.findings] == [1]
    assert bodies(reading) == ()


CHANGED = {
    "nothing": (b"", b""),
    "a key of the body twice": (b'"by":"Ada"', b'"by":"Ada","by":"Ada"'),
    "a key of the wall twice": (b'"boot":1.5', b'"boot":1.5,"boot":1.5'),
    "the predecessor twice": (b',"prev":', b',"prev":"","prev":'),
    "a key that nobody knows": (b'{"body":', b'{"a":1,"body":'),
    "no bench time": (b',"t":0.5', b""),
    "a bench time that is none": (b'"t":0.5', b'"t":true'),
    "a number with a zero more": (b'"t":0.5', b'"t":0.50'),
    "a whole number as a fraction": (b'"seq":0', b'"seq":0.0'),
    "a number that is too large": (b'"boot":1.5', b'"boot":1e999'),
    "no number": (b'"boot":1.5', b'"boot":NaN'),
    "more digits than a number holds": (b'"boot":1.5', b'"boot":12345678901234567890'),
    "an escape": (b"Ada", b"\\u0041da"),
    "half a character": (b"Ada", b"\\ud800"),
    "bytes that are no text": (b"Ada", b"\xff"),
    "a predecessor with an escape": (b'"prev":"000000', b'"prev":"\\u0030'),
    "a short predecessor": (b'"prev":"0', b'"prev":"'),
    "a space": (b'"wall":', b'"wall": '),
    "keys in another order": (b'"boot":1.5,"boot_id":"one-boot"', b'"boot_id":"one-boot","boot":1.5'),
}


@pytest.mark.parametrize("change", CHANGED)
def test_a_line_is_read_alike_quickly_and_strictly(tmp_path, monkeypatch, change):
    """The quick way tells what the strict one tells, of what the writer wrote and of anything else."""
    path = tmp_path / "journal.jsonl"
    with journal_of(tmp_path) as journal:
        journal.write(event_of("note", text="x", by="Ada"), 0.5)
    path.write_bytes(path.read_bytes().replace(*CHANGED[change]))
    readings = [read_journal(path)]
    monkeypatch.setattr(reader, "_as_written", lambda *_: None)
    readings.append(read_journal(path))
    quick, strict = (
        (each.events, each.first, each.findings, each.head, [(line.wall, line.raw, line.rest) for line in each.lines])
        for each in readings
    )
    assert quick == strict
    assert any(line.as_written for line in readings[0].lines) is (change == "nothing")


def test_an_endless_line_is_not_held_in_memory(tmp_path, monkeypatch):
    """Its place is a finding, the chain goes on after it, and the lines around it are read."""
    path = tmp_path / "journal.jsonl"
    with journal_of(tmp_path) as journal:
        journal.write(event_of("note", text="before"), 0.0)
        journal.write(event_of("note", text="x" * 5_000_000), 1.0)
        journal.write(event_of("note", text="after"), 2.0)
    monkeypatch.setattr(reader, "LONGEST_LINE", 1_000_000)
    reading = read_journal(path)
    assert [event.text for event in reading.events] == ["before", "after"]
    assert [(found.line, found.message) for found in reading.findings] == [(2, "the line has more than 1000000 bytes")]
    path.write_bytes(path.read_bytes()[:2_000_000])
    assert (len(bodies(read_journal(path))), len(read_journal(path).torn)) == (1, 1_000_000)


@pytest.mark.parametrize("size", [1, 3_000_000])
def test_a_torn_tail_of_any_length_is_cut(tmp_path, size):
    """What stands after the last newline is kept, and the lines before it are whole."""
    (tmp_path / "data").mkdir()
    with Journal(tmp_path / "data/journal.jsonl", stamp=stamps()) as journal:
        journal.write(event_of("note", text="whole"), 0.0)
    with (tmp_path / "data/journal.jsonl").open("ab") as stream:
        stream.write(bytes(size))
    assert cut_torn_tail(tmp_path) == size
    assert (tmp_path / "data/journal.torn").read_bytes() == bytes(size)
    assert len(bodies(read_journal(tmp_path / "data/journal.jsonl"))) == 1


@pytest.mark.parametrize(
    "line", [b"[" * 200_000, b'{"a":' * 200_000, b'{"body":{"kind":"x","t":true},"prev":"","wall":{}}']
)
def test_a_line_that_is_nested_deeply_is_a_finding(tmp_path, line):
    """No depth of brackets ends in a traceback."""
    path = tmp_path / "journal.jsonl"
    path.write_bytes(line + b"\n")
    assert len(read_journal(path).findings) == 1


def test_no_journal_is_an_error_with_a_hint(tmp_path):
    """A folder that is no run's folder says so."""
    with pytest.raises(EvidenceError, match="run's folder"):
        read_journal(tmp_path / "journal.jsonl")


def test_another_thread_is_no_writer(tmp_path):
    """Its event is refused, and the chain stays whole."""
    refusals = []

    def stray(journal):
        try:
            journal.write(event_of("note", text="stray", by=""), 2.0)
        except Refused as error:
            refusals.append(str(error))

    with journal_of(tmp_path) as journal:
        journal.write(event_of("note", text="", by=""), 1.0)
        thread = threading.Thread(target=stray, args=(journal,))
        thread.start()
        thread.join()
        journal.write(event_of("note", text="", by=""), 3.0)
    assert len(refusals) == 1
    reading = read_journal(tmp_path / "journal.jsonl")
    assert (reading.findings, [line.event.t for line in reading.lines]) == ((), [1.0, 3.0])


def test_a_forked_copy_is_no_writer(tmp_path):
    """It has the descriptor, and may not use it."""
    with journal_of(tmp_path) as journal:
        journal.write(event_of("note", text="", by=""), 1.0)
        child = os.fork()
        if child == 0:
            try:
                journal.write(event_of("note", text="stray", by=""), 2.0)
            except Refused:
                os._exit(7)
            os._exit(0)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
        journal.write(event_of("note", text="", by=""), 3.0)
    assert len(read_journal(tmp_path / "journal.jsonl").lines) == 2
