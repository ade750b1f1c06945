"""The times of a journal: whole, in order, and those of the supervisor."""

from __future__ import annotations

import pytest
from typed_events import event_of

from hil.clock import wall
from hil.evidence.journal.clocks import clock_doubts, clock_findings
from hil.evidence.journal.reader import JournalLine, read_journal
from hil.evidence.journal.writer import Journal
from hil.evidence.results.eligibility import of_run, reasons_in
from hil.evidence.results.facts import Facts
from hil.evidence.state import fold


def at(second, *, day=0.0, boot_id="one"):
    """Return a stamp: so many seconds after the first, UTC set forward by `day` seconds."""
    moment = 1_700_000_000.0 + second + day
    utc = f"{wall.datetime.fromtimestamp(moment, wall.UTC).replace(tzinfo=None).isoformat()}Z"
    return {"utc": utc, "boot": 50.0 + second, "boot_id": boot_id}


def line(number, stamp, kind="note", supervisor=None, **fields):
    """Return a line of a journal."""
    told = {**stamp, **({"supervisor": supervisor} if supervisor else {})}
    return JournalLine(number=number, event=event_of(kind, **fields), wall=told, raw=b"", rest=b"")


LIVE = {"live": {"speed": 1.0, "served": False}}


def test_clocks_that_agree_are_not_doubted():
    """Those of line and line, and those of run and supervisor, whose stamp is some seconds old."""
    lines = [line(1, at(0), "run", at(-1), **LIVE), line(2, at(5)), line(3, at(70), supervisor=at(69.5))]
    assert (clock_doubts(lines), list(clock_findings(lines))) == ((), [])


PARTED = (
    "CLOCK: from event 1 to 2 of the journal UTC and the time since boot part by -3600 s, and no event says"
    " that the time of day was set"
)
YEARS = -6 * 365 * 86400.0


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        (
            [line(1, at(0, day=YEARS), "run", at(-1), **LIVE), line(2, at(5, day=YEARS))],
            "CLOCK: event 1 of the journal has a UTC that is -189216000 s from that of its supervisor",
        ),
        (
            [line(1, at(0), "run", at(-1), **LIVE), line(2, at(3600, day=-3600.0))],
            PARTED,
        ),
        (
            [line(1, at(0), "run", at(30), **LIVE)],
            "CLOCK: event 1 of the journal is 30 s before its supervisor by the time since boot",
        ),
        (
            [line(1, at(0), "run", at(0, boot_id="other"), **LIVE)],
            "CLOCK: event 1 of the journal has no whole stamp of the supervisor of this machine",
        ),
        ([line(1, at(0), "run", **LIVE)], "no supervisor stamped the times of the run"),
        (
            [line(1, at(0), "run", at(-1), **LIVE), line(2, at(5), "anomaly", text="CLOCK: the ledger is later")],
            "CLOCK: the ledger is later",
        ),
    ],
    ids=["frozen in another year", "stands still", "ahead", "other machine", "nobody", "later than the run"],
)
def test_a_faked_clock_is_named_and_nothing_is_eligible(lines, why):
    """A module that patches time and datetime, as freezegun does, deceives its own process and not its supervisor."""
    assert clock_doubts(lines) == (why,)
    facts = Facts(catalogue={}, clock=clock_doubts(lines))
    assert why in reasons_in(of_run(fold([each.event for each in lines]), facts))


def test_a_time_of_day_that_was_set_is_no_lie():
    """An event says so, and the supervisor of the same machine has seen it."""
    jump = {"kind": "clock-jump", "seconds": -3600.0}
    lines = [
        line(1, at(0), "run", at(-1), **LIVE),
        line(2, at(10, day=-3600.0)),
        line(3, at(11, day=-3600.0), **jump),
        line(4, at(80, day=-3600.0), supervisor=at(79, day=-3600.0)),
    ]
    assert (clock_doubts(lines), list(clock_findings(lines))) == ((), [])
    set_between = [lines[0], line(2, at(10, day=-3600.0), supervisor=at(9.5)), lines[2]]
    assert clock_doubts(set_between) == ()


@pytest.mark.parametrize(
    ("second", "message"),
    [
        ({"boot": 55.0, "boot_id": "one"}, "its wall stamp has no utc"),
        ({"utc": at(5)["utc"]}, "its wall stamp has no boot and no boot_id"),
        ({**at(5), "utc": "yesterday"}, "the UTC of its wall stamp is no moment"),
        ({**at(5), "boot": 49.0}, "its time since boot is 1 s before the line before"),
        (at(5, day=-65.0), "its UTC is 60 s before the line before, and no event says why"),
    ],
)
def test_stamps_that_are_missing_or_go_back_are_found(second, message):
    """Facts of every line: a package without them is not what a run writes."""
    (found,) = clock_findings([line(1, at(0), "run"), line(2, second)])
    assert (found.path, found.line, found.message) == ("data/journal.jsonl", 2, message)


def test_a_run_that_is_resumed_later_may_find_another_time_of_day():
    """Another process goes on, on a machine whose clock was put right meanwhile, or that was started again."""
    lines = [line(1, at(0), "run"), line(2, at(500, day=-900.0), "resumed"), line(3, at(2, boot_id="two"), "reboot")]
    assert list(clock_findings(lines)) == []


def test_the_journal_carries_what_the_supervisor_stamped(tmp_path):
    """At its beginning, once a minute, and at the end of each case; its bodies know nothing of it."""
    seconds = iter([0.0, 1.0, 61.0, 62.0, 63.0])
    said = wall.WallStamp(**at(-1))
    stamps = {"stamp": lambda: wall.WallStamp(**at(next(seconds))), "supervisor": lambda: said}
    with Journal(tmp_path / "journal.jsonl", **stamps) as journal:
        for kind in ("run", "note", "note", "note", "case-end"):
            journal.write(event_of(kind), 0.0)
    lines = read_journal(tmp_path / "journal.jsonl").lines
    assert [line.wall.get("supervisor") == at(-1) for line in lines] == [True, False, True, False, True]
    assert all(b"supervisor" not in line.raw for line in lines)


def test_a_supervisor_stamps_into_a_file_that_its_run_reads(tmp_path):
    """The latest stamp stands there, and half of one is none."""
    with (tmp_path / "stamps").open("w+b") as file:
        try:
            wall.supervise(file.fileno())
            assert wall.supervisor_stamp() is None
            wall.put_stamp(file.fileno())
            wall.put_stamp(file.fileno())
            now, said = wall.stamp(), wall.supervisor_stamp()
            assert said is not None
            assert 0 <= now.boot - said.boot < 60
            assert said.boot_id == now.boot_id
        finally:
            wall.supervise(-1)
    assert wall.supervisor_stamp() is None
