"""`hil ack`: what happened is told, a named person acknowledges it, and only then the bench may be driven again."""

from __future__ import annotations

import json
import os
import shutil

import pytest
from evidence_runs import begin, sealed_run
from tmpfiles import NOBODY, another_user, as_root, folder_for_all
from typed_events import event_of

from hil.bench.lease import Lease, holds_a_lease, latch_bench, latches_of
from hil.cli.main import main
from hil.evidence.events import Reached
from hil.evidence.folder import GUARDIAN, hold
from hil.evidence.inbox import peek
from hil.evidence.ledger.book import read
from hil.evidence.ledger.entries import Acknowledged
from hil.evidence.package.verification import verify
from hil.guardian.latch import Latch

SAFED = "20261121T093100Z-battery-x-cd60b0"
SEALED = "20261120T093100Z-battery-x-ab12cd"
SINCE = "2026-11-21T10:00:09.2Z"
ACTED = '{"event":"acting","utc":"2026-11-21T10:00:09.250000Z","why":"the executive died"}\n'
TRYING = '{"event":"trying","utc":"2026-11-21T10:00:17.250000Z","unproven":["tec"],"pid":71}\n'
PROVEN = '{"event":"done","utc":"2026-11-21T10:00:27.250000Z","unproven":[],"proven":["tec"]}\n'
TEXT = "cell warm, fuse F2 replaced"


@pytest.fixture(scope="module")
def sealed(tmp_path_factory):
    """The folder of a sealed run, which nobody changes."""
    folder = tmp_path_factory.mktemp("sealed") / SEALED
    sealed_run(folder)
    return folder


@pytest.fixture
def reports(tmp_path, monkeypatch, sealed):
    """Be in a workspace with a run that the guardian ended, and one that was sealed with an unsafe end; both latch."""
    monkeypatch.setattr("hil.guardian.latch.PLACES", (tmp_path / "latches",))
    monkeypatch.setattr("hil.bench.lease._FOLDER", tmp_path / "leases")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hil.toml").touch()
    reports = tmp_path / "reports"
    with begin(reports / SAFED) as journal:
        journal.write(event_of("trip", limit="cell", text="cell voltage above 4.25 V"), 1.0)
        journal.write(
            event_of("safe", output="supply.charge", state="off", ok=False, detail="no reply", duration=0.5), 1.0
        )
    (reports / SAFED / "inbox/files").mkdir(parents=True)
    (reports / SAFED / GUARDIAN).write_text(ACTED)
    shutil.copytree(sealed, reports / SEALED)
    for name, key in ((SAFED, "/dev/psu"), (SEALED, "/dev/tec")):
        latch = Latch(bench="battery", run=str(reports / name), why="it died", since=SINCE, outputs=("tec",))
        latch_bench([key], latch)
    return reports


def said(capsys, *arguments):
    """Return exit code, output and errors of one command."""
    with pytest.raises(SystemExit) as left:
        main(arguments)
    told = capsys.readouterr()
    return left.value.code, told.out, told.err


@pytest.mark.usefixtures("reports")
def test_what_happened_is_told_before_anything_is_acknowledged(capsys):
    """Without name and text nothing changes, and the refusal shows the whole command."""
    code, out, err = said(capsys, "ack", "cd60b0")
    assert code == 4
    assert out.splitlines() == [
        "2026-11-21 10:00:07.000 UTC  the run tripped: cell voltage above 4.25 V",
        "2026-11-21 10:00:08.000 UTC  NOT MADE SAFE by the run: supply.charge, which is not off: no reply",
        "2026-11-21 10:00:09.200 UTC  bench battery has been latched since then: it died; not proven safe: tec",
        "2026-11-21 10:00:09.250 UTC  the guardian acted: the executive died",
        f"in full: reports/{SAFED}/data/guardian.jsonl, reports/{SAFED}/data/journal.jsonl",
    ]
    assert "needs --by NAME and --text TEXT" in err
    assert f'hil ack {SAFED} --by NAME --text "what was seen and done"' in err
    assert "needs --text TEXT" in said(capsys, "ack", "cd60b0", "--by", "Ada", "--text", "  ")[2]
    assert latches_of(SAFED)


def test_the_acknowledgement_of_an_open_run_waits_in_its_inbox(reports, capsys):
    """The executive is the journal's only writer; the latches of this run go, and no other's."""
    code, out, _ = said(capsys, "ack", "cd60b0", "--by", "Ada", "--text", TEXT)
    assert code == 0
    assert "it goes into the journal when the run is resumed or sealed" in out
    assert "bench battery is no longer latched" in out
    (message,) = peek(reports / SAFED)
    assert (message.kind, message.by, message.text, len(message.sha256)) == ("ack", "Ada", TEXT, 64)
    assert not latches_of(SAFED)
    assert latches_of(SEALED)
    assert "there is nothing to acknowledge" in said(capsys, "ack", "cd60b0", "--by", "A", "--text", "b")[2]
    assert "there is nothing to acknowledge" in said(capsys, "ack", "cd60b0")[2]


def test_the_acknowledgement_of_a_sealed_run_is_in_the_ledger(reports, capsys):
    """Beside the package, which is not changed; nobody's entry is ever in the place of another's."""
    code, out, _ = said(capsys, "ack", SEALED, "--by", "Ada", "--text", TEXT)
    assert code == 0
    (entry,) = read(reports).of(Acknowledged, SEALED)
    assert f"written to line {entry.seq + 1} of reports/.ledger/ledger.jsonl" in out
    assert (entry.by, entry.text, entry.why) == ("Ada", TEXT, ("it died",))
    assert verify(reports / SEALED).ok
    assert not latches_of(SEALED)


def test_a_run_that_is_gone_is_acknowledged_in_the_ledger(reports, capsys):
    """Its latch names it, and would stand for ever."""
    (reports / SAFED).rename(reports.parent / "elsewhere")
    assert said(capsys, "ack", str(reports / SAFED), "--by", "Ada", "--text", TEXT)[0] == 0
    assert len(read(reports).of(Acknowledged)) == 1
    assert said(capsys, "ack", SAFED, "--by", "Ada", "--text", TEXT)[0] == 4


def test_nobody_acknowledges_what_still_goes_on(reports, capsys):
    """Neither while the run is held, nor while its guardian has the leases."""
    wanted = ("ack", SAFED, "--by", "Ada", "--text", TEXT)
    with hold(reports / SAFED):
        assert "the run, or its guardian, is still running" in said(capsys, *wanted)[2]
    lease = Lease(["/dev/psu"], "a run of battery")
    lease.name(SAFED)
    assert f"its guardian (process {os.getpid()}) still holds the bench" in said(capsys, *wanted)[2]
    lease.release()
    assert latches_of(SAFED)
    assert said(capsys, *wanted)[0] == 0


@as_root
@pytest.mark.parametrize("alone", [False, True])
def test_another_user_acknowledges_where_the_bench_allows_it(reports, capsys, monkeypatch, alone):
    """It is written down among that user's own reports; who may not is told whom to ask, and nothing is written."""
    with folder_for_all() as place:
        monkeypatch.setattr("hil.guardian.latch.PLACES", (place / "latches",))
        monkeypatch.setattr("hil.bench.lease._FOLDER", place / "leases")
        theirs = place / "theirs"
        theirs.mkdir()
        (theirs / "hil.toml").touch()
        os.chown(theirs, NOBODY, NOBODY)
        latch = Latch(bench="battery", run=str(reports / SAFED), why="it died", since=SINCE, outputs=("tec",))
        latch_bench(["/dev/psu"], latch, alone=alone)
        monkeypatch.chdir(theirs)
        with another_user():
            code, _, err = said(capsys, "ack", SAFED, "--by", "Bo", "--text", TEXT)
        entries = read(theirs / "reports").of(Acknowledged)
        if alone:
            assert (code, entries) == (4, ())
            assert "bench 'battery' was latched by user root, and its file does not let others acknowledge that" in err
            assert "ask root" in err
            assert latches_of(SAFED)
        else:
            assert (code, err) == (0, "")
            assert [entry.by for entry in entries] == ["Bo"]
            assert not latches_of(SAFED)


def test_a_ledger_that_cannot_be_written_leaves_the_latch(reports, capsys, monkeypatch):
    """What is not evidence has not happened."""

    def full(*_, **__):
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr("hil.evidence.ledger.book.os.fsync", full)
    code, _, err = said(capsys, "ack", SEALED, "--by", "Ada", "--text", TEXT)
    assert code == 4
    assert "the ledger cannot be written: No space left on device" in err
    assert read(reports).of(Acknowledged) == ()
    assert latches_of(SEALED)


@pytest.mark.usefixtures("reports")
def test_a_latched_run_is_told_wherever_runs_are_told(capsys):
    """With its state, until it is acknowledged."""
    assert f"latched until hil ack {SAFED}" in said(capsys, "runs")[1]
    out = said(capsys, "status", SAFED)[1]
    assert "state       INTERRUPTED" in out
    assert "guardian    no proof is on record" in out
    assert f"latch       latched until hil ack {SAFED}" in out
    assert json.loads(said(capsys, "status", SAFED, "--json")[1])["latched"] is True
    said(capsys, "ack", SAFED, "--by", "Ada", "--text", TEXT)
    out = said(capsys, "status", SAFED)[1]
    assert "latch " not in out
    assert json.loads(said(capsys, "status", SAFED, "--json")[1])["latched"] is False


def test_a_guardian_that_has_just_begun_is_told(reports, capsys):
    """It has not had the time to prove anything, which is not the same as having no proof; later, what it proved."""
    lease = Lease(["/dev/psu"], "a run of battery")
    lease.name(SAFED)
    begun = "making the bench safe since 2026-11-21 10:00:09.250 UTC; nothing is proven yet"
    assert f"guardian    {begun}" in said(capsys, "status", SAFED)[1]
    assert json.loads(said(capsys, "status", SAFED, "--json")[1])["guardian"]["unproven"] is None
    lease.release()
    assert "guardian    no proof is on record" in said(capsys, "status", SAFED)[1]
    proof = {"event": "proof", "output": "supply.coil", "ok": True, "detail": "safe"}
    with (reports / SAFED / GUARDIAN).open("a") as journal:
        journal.write(f"{json.dumps(proof)}\n")
    assert "it ended before it was done; proven safe: supply.coil" in said(capsys, "status", SAFED)[1]
    lease = Lease(["/dev/psu"], "a run of battery")
    lease.name(SAFED)
    assert f"{begun.partition(';')[0]}; proven safe: supply.coil" in said(capsys, "status", SAFED)[1]
    lease.release()


def test_a_guardian_that_keeps_trying_is_told_and_can_be_acknowledged(reports, capsys, monkeypatch):
    """With its outputs, since when, and its process; the bench is free once it has left."""
    monkeypatch.setattr("hil.executive.ending.acknowledging.wall.pause", lambda _: lease.release())
    journal = reports / SAFED / GUARDIAN
    journal.write_text(ACTED + TRYING)
    lease = Lease(["/dev/psu"], "a run of battery")
    lease.name(SAFED)
    told = {"since": "2026-11-21T10:00:09.250000Z", "safe": False, "unproven": ["tec"], "at_work": True}
    assert json.loads(said(capsys, "status", SAFED, "--json")[1])["guardian"] == told
    out = said(capsys, "status", SAFED)[1]
    assert "state       INTERRUPTED" in out
    assert "guardian    trying since 2026-11-21 10:00:09.250 UTC (process 71); NOT PROVEN SAFE: tec" in out
    out = said(capsys, "ack", SAFED, "--by", "Ada", "--text", TEXT)[1]
    assert "NOT PROVEN SAFE: tec; the guardian kept trying" in out
    assert "proven safe\n" not in out
    assert not latches_of(SAFED)
    assert not holds_a_lease(SAFED)
    assert "guardian    NOT PROVEN SAFE: tec" in said(capsys, "status", SAFED)[1]
    journal.write_text(ACTED + TRYING + PROVEN)
    out = said(capsys, "status", SAFED)[1]
    assert "state       SAFED" in out
    assert "guardian " not in out


def test_a_safed_run_is_not_resumed_before_it_is_acknowledged(reports):
    """Whoever resumes it would drive the bench that nobody has looked at."""
    from hil.executive.ending.acknowledging import acknowledge, require_acknowledged  # noqa: PLC0415
    from hil.model.errors import Refused  # noqa: PLC0415

    with pytest.raises(Refused, match="that has not been acknowledged") as refused:
        require_acknowledged(reports / SAFED)
    assert f"hil ack {SAFED}" in refused.value.hint
    acknowledge(reports / SAFED, reports, by="Ada", text=TEXT)
    require_acknowledged(reports / SAFED)


@pytest.mark.parametrize(
    ("answer", "code", "told"),
    [
        (Reached(by="Ada", ok=True), 0, "the code is right; the run now arms the bench"),
        (Reached(by="Ada", ok=False), 1, "refused: this is not the code that the run is waiting for"),
        (None, 0, "the run has not read the code yet"),
    ],
)
def test_the_run_answers_whether_the_code_is_right(reports, capsys, monkeypatch, answer, code, told):
    """It is asked through its inbox, by name."""
    monkeypatch.setattr("hil.cli.commands.ack.answer_of", lambda _, kind: answer if kind is Reached else None)
    with hold(reports / SAFED):
        ended = said(capsys, "ack", SAFED, "--code", " K7 ", "--by", "Ada")
    assert ended[0] == code
    assert told in ended[1] + ended[2]
    (message,) = peek(reports / SAFED)
    assert (message.kind, message.by, message.text) == ("reached", "Ada", "K7")


@pytest.mark.usefixtures("reports")
def test_being_reached_needs_a_name_and_a_run_that_waits(capsys):
    """Nobody is reached by a run that is not going on."""
    assert "--code needs the name" in said(capsys, "ack", SAFED, "--code", "K7")[2]
    assert "it was interrupted" in said(capsys, "ack", SAFED, "--code", "K7", "--by", "Ada")[2]


def test_the_time_that_is_left_is_told_once(capsys, reports):
    """The words say that it is left, and the label does not say it again."""
    with hold(reports / SAFED):
        lines = said(capsys, "status", SAFED)[1].splitlines()
    assert [line for line in lines if "left" in line] == ["estimate    at most 1 min left"]
