"""A run read from another process while it is written."""

from __future__ import annotations

import json
import struct

import pytest
from evidence_runs import begin
from typed_events import body_of, event_of

from hil.clock import wall
from hil.evidence.folder import JOURNAL, RECORDINGS
from hil.evidence.recordings.rows import Rows
from hil.report.live.following import Follower
from hil.report.live.lines import facts, reading_lines
from hil.report.live.outlook import Outlook

LIMITS = """\
envelope:
- {id: coil-current, output: supply.coil, quantity: current, unit: A, min: 0, max: "0.2", period: 1 s, max_age: 5 s}
"""


def recording(identifier, name, case, *channels):
    """Return the fields of the event with which a recording begins."""
    told = [{"name": channel, "unit": unit, "instrument": "i"} for channel, unit in channels]
    return {"recording": identifier, "name": name, "case": case, "duration": None, "channels": told}


def store(folder, identifier, *rows):
    """Write a row file."""
    names = [("v", "V")] * (len(rows[0]) - 1)
    (folder / RECORDINGS).mkdir(parents=True, exist_ok=True)
    file = Rows(folder / RECORDINGS / f"{identifier}.rows", recording="r", channels=names, on_block=lambda *_: None)
    for row in rows:
        file.append(row)
    file.finish()


def test_new_events_are_read_once_and_half_a_line_later(tmp_path):
    """What the writer has not ended is left; the rest is read where the last look ended."""
    follower = Follower(tmp_path)
    assert follower.read() == []
    with begin(tmp_path) as journal:
        first = len(follower.read())
        journal.write(event_of("case", case="test_rest", attempt=1), 1.0)
        whole = (tmp_path / JOURNAL).read_bytes()
        (tmp_path / JOURNAL).write_bytes(whole[:-5])
        assert first > 0
        assert follower.read() == []
        (tmp_path / JOURNAL).write_bytes(whole)
        assert [line.event.kind() for line in follower.read()] == ["case"]
    assert follower.read() == []
    assert (follower.outlook.case, follower.goes_on(), follower.sealed()) == ("test_rest", False, False)
    assert follower.age is None  # of another boot
    assert follower.last_utc.endswith("Z")


def test_what_is_no_event_is_passed_over(tmp_path):
    """A damaged journal is followed as far as it can be understood."""
    (tmp_path / "data").mkdir()
    lines = [
        b"\xff",
        b"[1]",
        b'{"body":{"cases":[],"kind":"planned","t":1},"prev":"","wall":{}}',
        b'{"body":{"kind":7},"wall":1}',
    ]
    (tmp_path / JOURNAL).write_bytes(b"\n".join([*lines, b""]))
    assert [line.event.kind() for line in Follower(tmp_path).read()] == ["planned"]


@pytest.fixture
def recorded(tmp_path):
    """Return the folder of a run with an open recording of a case and one of the envelope, as it grows."""
    with begin(tmp_path) as journal:
        journal.write(event_of("recording", **recording("envelope-c", "coil-current", None, ("current", "A"))), 1.0)
        journal.write(
            event_of("recording", **recording("001-rest", "rest", "test_rest", ("x", "deg/s"), ("y", "deg/s"))), 2.0
        )
    (tmp_path / "data/bench").mkdir(exist_ok=True)
    (tmp_path / "data/bench/bench.yaml").write_text(LIMITS)
    store(tmp_path, "001-rest", (3.0, 1.0, 2.0), (9.0, 4.0, float("nan")))
    store(tmp_path, "envelope-c", (8.0, 0.1))
    return tmp_path


def test_the_newest_value_of_every_channel_is_read(recorded):
    """Of the envelope with its limits; bench time is as far as the newest row."""
    follower = Follower(recorded)
    follower.read()
    readings = follower.readings()
    assert [(reading.channel, str(reading), reading.limits) for reading in readings] == [
        ("x", "4 deg/s", ""),
        ("y", "not a number", ""),
        ("current", "0.1 A", "0 to 0.2 A"),
    ]
    assert follower.outlook.t == 9.0
    assert reading_lines(readings, 9.0)[2].split() == [
        "coil-current",
        "current",
        "0.1",
        "A",
        "0",
        "to",
        "0.2",
        "A,",
        "1",
        "s",
        "ago",
    ]
    told = facts(follower.outlook, readings)["readings"]
    assert [(item["value"], item["max"], item["envelope"]) for item in told] == [
        (4.0, None, False),
        (None, None, False),
        (0.1, 0.2, True),
    ]


def test_half_a_row_is_not_read(recorded):
    """A row that is being written, or was torn, hides not the one before; a file that is gone hides nothing else."""
    with (recorded / RECORDINGS / "001-rest.rows").open("ab") as stream:
        stream.write(struct.pack("<d", 99.0) + b"\0\0\0")
    (recorded / RECORDINGS / "envelope-c.rows").unlink()
    follower = Follower(recorded)
    follower.read()
    assert [reading.t for reading in follower.readings()] == [9.0, 9.0]


@pytest.fixture
def fed(tmp_path):
    """Return a run whose recording feeds a limit on what it holds, and one on what is computed from it."""
    with begin(tmp_path) as journal:
        journal.write(event_of("recording", **recording("envelope-c", "coil-current", None, ("current", "A"))), 1.0)
        journal.write(event_of("recording", **recording("envelope-w", "warming", None, ("slope", "K/min"))), 1.0)
        journal.write(
            event_of("recording", **recording("001-rest", "rest", "test_rest", ("x", "V"), ("current", "A"))), 2.0
        )
        journal.write(event_of("fed", limit="coil-current", recording="001-rest"), 2.0)
        journal.write(event_of("fed", limit="warming", recording="001-rest"), 2.0)
    (tmp_path / "data/bench").mkdir(exist_ok=True)
    computed = "- {id: warming, output: cell, quantity: slope, of: temperature, over: 60 s, unit: K/min, max: 2}\n"
    (tmp_path / "data/bench/bench.yaml").write_text(LIMITS + computed)
    store(tmp_path, "envelope-c", (1.5, 0.1))
    store(tmp_path, "envelope-w", (1.5, 0.7))
    return tmp_path


def test_a_limit_that_is_fed_shows_the_newest_row(fed):
    """Not its own last reading from before the recording; what is computed from rows has no value to show."""
    store(fed, "001-rest", (3.0, 5.0, 0.11), (99.0, 6.0, 0.15))
    follower = Follower(fed)
    follower.read()
    readings = follower.readings()
    lines = [line.split() for line in reading_lines(readings, follower.outlook.t)]
    assert " ".join(lines[2]) == "coil-current current 0.15 A 0 to 0.2 A, fed by recording 001-rest"
    assert " ".join(lines[3]) == "warming slope - ≤ 2 K/min, fed by recording 001-rest"
    told = facts(follower.outlook, readings)["readings"]
    assert [(item["value"], item["t"], item["fed"]) for item in told] == [
        (6.0, 99.0, None),
        (0.15, 99.0, None),
        (0.15, 99.0, "001-rest"),
        (None, 99.0, "001-rest"),
    ]


@pytest.mark.parametrize(
    ("current", "flow", "told", "counts"),
    [
        (-0.3, "charging", "≤ 2 K/min while charging, does not count now", False),
        (0.3, "charging", "≤ 2 K/min while charging", True),
        (-0.3, "discharging", "≤ 2 K/min while discharging", True),
        (-0.3, "flowing", "≤ 2 K/min while flowing", True),
        (0.01, "flowing", "≤ 2 K/min while flowing, does not count now", False),
    ],
)
def test_a_limit_that_does_not_count_now_says_so(fed, current, flow, told, counts):
    """The newest current of its instrument decides, at its own threshold."""
    file = fed / "data/bench/bench.yaml"
    file.write_text(file.read_text().replace("max: 2}", f'max: 2, while: {flow}, threshold: "0.02"}}'))
    store(fed, "001-rest", (3.0, 5.0, 0.3), (99.0, 6.0, current))
    follower = Follower(fed)
    follower.read()
    readings = follower.readings()
    assert (readings[3].limits, readings[2].limits) == (told, "0 to 0.2 A")
    assert [item["counts"] for item in facts(follower.outlook, readings)["readings"][2:]] == [True, counts]


def test_of_a_limit_whose_current_is_unknown_only_the_condition_is_told(fed):
    """Nobody knows whether it counts where no current is recorded."""
    file = fed / "data/bench/bench.yaml"
    file.write_text(file.read_text().replace("max: 2}", 'max: 2, while: charging, threshold: "0.02"}'))
    store(fed, "001-rest", (99.0, 6.0, float("nan")))
    (fed / RECORDINGS / "envelope-c.rows").unlink()
    follower = Follower(fed)
    follower.read()
    assert [(each.limits, each.counts) for each in follower.readings()[2:]] == [("≤ 2 K/min while charging", None)]


def test_bench_time_that_passes_faster_is_told_by_the_clock(fed):
    """A simulated bench may pass 60 days in minutes: what a person waits is told as well."""
    now = wall.stamp()
    beside = {"boot_id": now.boot_id, "boot": now.boot - 10.0}
    cases = [{"case": "a", "max_duration": 60 * 86400.0}]
    with (fed / JOURNAL).open("a") as stream:
        for body in (body_of("planned", t=0.0, cases=cases), body_of("case", t=0.0, case="a")):
            stream.write(json.dumps({"body": body, "wall": beside}) + "\n")
    follower = Follower(fed)
    follower.read()
    follower.outlook.at(86400.0)
    follower.readings()
    assert follower.outlook.pace == pytest.approx(8640, rel=0.05)
    assert str(follower.outlook.left()).startswith("at most 59 d left of bench time (at most 9 min")


def test_a_limit_shows_its_own_reading_where_that_is_newer(fed):
    """Where no row has come, or comes any more, the envelope takes readings again; so it does after the recording."""
    follower = Follower(fed)
    follower.read()
    assert [str(reading) for reading in follower.readings()] == ["0.1 A", "0.7 K/min"]
    store(fed, "001-rest", (1.0, 5.0, 0.11))
    assert [str(reading) for reading in follower.readings() if reading.watched] == ["0.1 A", "0.7 K/min"]
    follower.outlook.take(event_of(kind="recording-end", t=120.0, recording="001-rest"))
    assert follower.outlook.fed == {}


def test_a_recording_that_is_void_is_read_no_more():
    """A run that was entered again in front of it does not go on with it, nor is a limit fed by it."""
    outlook = Outlook()
    for number, identifier in enumerate(("001-a", "002-b"), 5):
        fields = recording(identifier, "rest", "test_rest", ("x", "V"))
        outlook.take(event_of(**{"kind": "recording", "t": 2.0, "seq": 2 * number, **fields}))
        outlook.take(event_of(kind="fed", t=2.0, seq=2 * number + 1, limit=identifier, recording=identifier))
    outlook.take(event_of(kind="resumed", t=9.0, seq=20, entry={"boundary": 11}))
    assert (list(outlook.recordings), outlook.fed) == (["001-a"], {"001-a": "001-a"})
