"""The ledger: one chain that only grows, in which every change shows."""

from __future__ import annotations

import hashlib
import json
import os
from concurrent.futures import ThreadPoolExecutor

import pytest
from msgspec.structs import replace
from sweeps import sample

from hil.documents.canonical import canonical
from hil.evidence.ledger.book import (
    append,
    append_all,
    append_once,
    check,
    head,
    ledger_file,
    put_object,
    read,
    read_object,
)
from hil.evidence.ledger.entries import (
    KINDS,
    Acknowledged,
    Baseline,
    Head,
    Opened,
    Reason,
    Repaired,
    Replayed,
    Sealed,
    Status,
    encode,
    stamped,
)
from hil.evidence.ledger.packages import enter_replay
from hil.model.errors import EvidenceError

HEAD = Head(run="r1", events=7, sha256="a" * 64, state="RUNNING")
SEALED = Sealed(
    run="r1", evidence="b" * 64, content="c" * 64, verdict="PASS", source="simulated", bench="adcs", dut="SIM-1"
)
STATUS = Status(requirement="X-1", status="open", compliance="no", reasons=(Reason(code="SIM_ONLY", text="ü"),))


@pytest.fixture
def reports(tmp_path):
    """Return a folder of reports whose ledger has five lines."""
    for entry in (HEAD, SEALED, STATUS, Baseline(subject="catalogue", object=put_object(tmp_path, b"all"))):
        append(tmp_path, entry)
    return tmp_path


def lines(reports):
    """Return the lines of a ledger."""
    return ledger_file(reports).read_bytes().splitlines(keepends=True)


def put(reports, new):
    """Write other lines in their place."""
    ledger_file(reports).write_bytes(b"".join(new))


def messages(reports, published=None):
    """Return line and sentence of everything that is wrong."""
    return [(each.line, each.message) for each in check(reports, published)]


def test_what_was_appended_is_read_again_in_a_chain(reports):
    """Every line is canonical JSON, names the hash of the line before, and the last is the head."""
    ledger = read(reports)
    assert [type(each) for each in ledger.entries] == [Opened, Head, Sealed, Status, Baseline]
    assert [each.seq for each in ledger.entries] == [*range(5)]
    assert ledger.of(Head, "r1")[0].sha256 == "a" * 64
    assert ledger.of(Head, "r2") == ()
    assert ledger.of(Status)[0].reasons == STATUS.reasons
    before = "0" * 64
    for line in lines(reports):
        assert canonical(json.loads(line)) + b"\n" == line
        assert json.loads(line)["prev"] == before
        before = hashlib.sha256(line).hexdigest()
    assert ledger.head == head(reports) == before
    assert messages(reports, before) == messages(reports, ledger.hashes[1]) == []


def test_without_a_ledger_there_is_nothing_and_nothing_is_made(tmp_path):
    """Reading leaves no trace."""
    assert (read(tmp_path).entries, head(tmp_path), check(tmp_path)) == ((), "0" * 64, ())
    assert list(tmp_path.iterdir()) == []


def test_any_changed_byte_is_found(reports):
    """A byte of any line, the last included, or of an object."""
    good, thing = ledger_file(reports).read_bytes(), b"all"
    for place in sample(range(len(good)), 40):
        ledger_file(reports).write_bytes(good[:place] + bytes([good[place] ^ 1]) + good[place + 1 :])
        assert check(reports), place
    ledger_file(reports).write_bytes(good)
    path = reports / ".ledger/objects" / hashlib.sha256(thing).hexdigest()
    for place in range(len(thing)):
        path.write_bytes(thing[:place] + bytes([thing[place] ^ 1]) + thing[place + 1 :])
        ((line, said),) = messages(reports)
        assert line == 5
        assert "its bytes were changed" in said
    path.unlink()
    assert "cannot be read" in messages(reports)[0][1]


def test_a_line_that_was_taken_out_moved_or_put_in_breaks_the_chain(reports):
    """At the line where it shows."""
    good = lines(reports)
    put(reports, [good[0], *good[2:]])
    mend = "restore the ledger from a copy whose head was published"
    assert messages(reports)[0] == (2, f"this is entry 2: lines were moved, taken out or put in; {mend}")
    assert "the chain is broken here" in messages(reports)[1][1]
    put(reports, [good[0], good[2], good[1], *good[3:]])
    assert {line for line, _ in messages(reports)} == {2, 3, 4}
    put(reports, good[1:])
    assert "a ledger begins with one entry of kind 'opened'" in "".join(said for _, said in messages(reports))


def test_a_ledger_that_was_cut_off_or_forked_lacks_the_published_head(reports):
    """Its own chain is whole; only what was published outside of it shows that."""
    published = head(reports)
    good = lines(reports)
    put(reports, good[:-1])
    ((line, said),) = messages(reports, published)
    assert line == 4
    assert f"no line has the published head {published}: the ledger was cut off, rewritten or forked" in said
    assert messages(reports) == []
    append(reports, HEAD)
    assert messages(reports) == []
    assert len(messages(reports, published)) == 1


def test_a_torn_line_is_cut_off_kept_and_noted_at_the_next_entry(reports):
    """As after a crash in the middle of an append; until then it is told, and is no entry."""
    before = head(reports)
    with ledger_file(reports).open("ab") as stream:
        stream.write(b'{"kind":"head","ow')
    assert (head(reports), read(reports).torn, read(reports).findings) == (before, 18, ())
    assert "the last line is incomplete" in messages(reports)[0][1]
    append(reports, HEAD)
    (noted,) = read(reports).of(Repaired)
    assert (noted.bytes, read_object(reports, noted.object)) == (18, b'{"kind":"head","ow')
    assert noted.prev == before
    assert messages(reports, before) == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"kind": "heads"}, "there are no entries of kind 'heads', did you mean 'head'?"),
        ({"kind": 3}, "there are no entries of kind 3"),
        ({"events": "seven"}, "field 'events' must be a whole number, found text"),
        ({"more": 1}, "unknown field 'more'"),
        ({"state": None}, "field 'state' must be text, found null"),
    ],
)
def test_a_line_of_another_kind_or_form_is_told(reports, change, said):
    """By its line; the others are read all the same."""
    good = lines(reports)
    good[1] = canonical(json.loads(good[1]) | change) + b"\n"
    put(reports, good)
    assert said in messages(reports)[0][1]
    assert messages(reports)[0][0] == 2
    assert len(read(reports).entries) == 4


def test_a_format_of_the_future_is_told(tmp_path):
    """Nothing is guessed."""
    append(tmp_path, HEAD)
    put(tmp_path, [encode(stamped(Opened(format=9), seq=0, prev="0" * 64, utc=""))])
    assert "the ledger has format 9, and this version reads 1; update hil" in messages(tmp_path)[0][1]


def test_nothing_is_appended_to_a_damaged_last_line(reports):
    """A new line would make it look whole."""
    good = lines(reports)
    put(reports, [*good[:-1], good[-1].replace(b"catalogue", b"catalogua")])
    with pytest.raises(EvidenceError, match=r"ledger.jsonl:5: nothing can be appended: the line was changed"):
        append(reports, HEAD)


def test_an_entry_that_stands_is_not_written_again(reports):
    """Nor do others come in between the look and the entry."""
    assert append_once(reports, SEALED, lambda ledger: bool(ledger.of(Sealed, "r1"))) is None
    assert append_once(reports, SEALED, lambda ledger: bool(ledger.of(Sealed, "r2"))).seq == 5


def test_writers_at_the_same_time_wait_for_each_other(tmp_path):
    """The chain stays one."""
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda _: append(tmp_path, HEAD), range(12)))
    assert check(tmp_path) == ()
    assert len(read(tmp_path).of(Head)) == 12


def test_a_ledger_that_is_no_file_or_cannot_be_written_is_told(tmp_path):
    """A link in its place is neither read nor written."""
    (tmp_path / ".ledger").mkdir()
    ledger_file(tmp_path).symlink_to("/dev/null")
    with pytest.raises(EvidenceError, match="the ledger cannot be read"):
        read(tmp_path)
    with pytest.raises(EvidenceError, match="the ledger cannot be written"):
        append(tmp_path, HEAD)


def test_acknowledgements_of_older_versions_are_read(tmp_path):
    """They have a file each; what is none is left aside."""
    place = tmp_path / ".ledger/acknowledgements"
    place.mkdir(parents=True)
    old = {"by": "Ada", "format": 1, "run": "r1", "text": "looked", "utc": "2026-01-01T00:00:00Z", "why": ["it died"]}
    (place / "1-r1.json").write_bytes(canonical(old))
    (place / "2-r1.json").write_bytes(b"{")
    assert read(tmp_path).older == (
        Acknowledged(run="r1", by="Ada", text="looked", utc="2026-01-01T00:00:00Z", why=("it died",)),
    )


def test_every_kind_has_its_name():
    """The ledger calls an entry by its type, in small letters."""
    assert {name: kind.__name__.lower() for name, kind in KINDS.items()} == {name: name for name in KINDS}


AGAIN = Replayed(run="r1", evidence="b" * 64, analysis="d" * 64, same=True)


def test_a_replay_is_entered_once_and_every_change_of_it(reports):
    """The same result again says nothing new; another one, and by another analysis, does."""
    first = enter_replay(reports, AGAIN)
    assert (first.seq, enter_replay(reports, AGAIN)) == (5, first)
    worse = replace(AGAIN, same=False, differences=2)
    assert enter_replay(reports, worse).seq == 6
    assert enter_replay(reports, AGAIN).seq == 7  # the last one counts
    assert enter_replay(reports, replace(AGAIN, analysis="e" * 64)).seq == 8
    assert [each.same for each in read(reports).of(Replayed, "r1")] == [True, False, True, True]
    assert messages(reports) == []


def test_a_replay_of_what_the_ledger_does_not_have_leaves_no_trace(reports, tmp_path_factory):
    """Beside a copy there is no ledger, or one that knows nothing of this package: nothing is made or written."""
    empty = tmp_path_factory.mktemp("copy")
    before = lines(reports)
    assert enter_replay(empty, AGAIN) is enter_replay(reports, replace(AGAIN, evidence="f" * 64)) is None
    assert (list(empty.iterdir()), lines(reports)) == ([], before)


def test_a_replay_is_not_entered_in_a_damaged_ledger(reports):
    """The line is named, and nothing is appended to it."""
    damaged = [line.replace(b"RUNNING", b"SEALED ", 1) for line in lines(reports)]
    put(reports, damaged)
    with pytest.raises(EvidenceError, match=r"ledger.jsonl:2:1: the line was changed"):
        enter_replay(reports, AGAIN)
    assert lines(reports) == damaged


@pytest.mark.parametrize("torn", [b"", b'{"kind":"head"'])
def test_to_append_only_the_end_is_read(tmp_path, monkeypatch, torn):
    """However long the ledger is, and also where its last line is longer than what is read at once."""
    append_all(tmp_path, [HEAD] * 400)
    append(tmp_path, Status(requirement="X-1", status="open", reasons=(Reason(code="A", text="x" * 40_000),)))
    with ledger_file(tmp_path).open("ab") as stream:
        stream.write(torn)
    whole, found, real = ledger_file(tmp_path).stat().st_size, [], os.pread
    assert whole > 150_000
    monkeypatch.setattr(os, "pread", lambda *asked: (found.append(asked[1]), real(*asked))[1])
    append(tmp_path, HEAD)
    assert sum(found) < 70_000
    append(tmp_path, HEAD)
    assert [str(each) for each in check(tmp_path)] == []
    assert read(tmp_path).entries[-1].seq == 403 + bool(torn)


def test_damage_before_the_end_is_found_by_who_reads_though_entries_follow(reports):
    """The end is whole, so that an entry is appended; the damaged line is still told."""
    good = lines(reports)
    put(reports, [good[0], good[1].replace(b"RUNNING", b"SAFED  "), *good[2:]])
    append(reports, HEAD)
    assert "the line was changed" in messages(reports)[0][1]
    assert {line for line, _ in messages(reports)} == {2, 3}
