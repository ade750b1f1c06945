"""A transcript replays to the same bytes, strictly in order."""

from __future__ import annotations

from io import FileIO

import pytest
from echo import EchoPeer, MemoryPeer
from smbus2 import i2c_msg

from hil.clock.virtual import VirtualClock
from hil.model.errors import Diverged, EvidenceError
from hil.wire.exchange import publish_bus, publish_stream, withdraw
from hil.wire.opening import open_bus, open_port
from hil.wire.replay import DISTRESS, HOLD, MONITOR, OVERDUE, Place, Playback, ReplayedBus, ReplayedStream
from hil.wire.simulated_bus import SimulatedBus
from hil.wire.simulated_line import SimulatedLine
from hil.wire.transcript import Transcript, read_transcript


def converse(port, bus):
    """Use every operation of port and bus once and return what came."""
    port.write(b"ask\n")
    got = [port.read_line(), port.in_waiting]
    got.append(port.exchange(b"again\n"))
    port.write(b"xy")
    port.reset_input_buffer()
    port.pulse_dtr()
    bus.write_byte_data(0x50, 3, 99)
    bus.write_word_data(0x50, 8, 0x1234)
    bus.write_i2c_block_data(0x50, 10, [1, 2, 3])
    bus.write_byte(0x50, 3)
    got += [bus.read_byte(0x50), bus.read_byte_data(0x50, 4), bus.read_word_data(0x50, 8)]
    got += [bus.read_i2c_block_data(0x50, 10, 3)]
    reply = i2c_msg.read(0x50, 4)
    bus.i2c_rdwr(i2c_msg.write(0x50, [200]), reply)
    got.append(bytes(reply))
    with pytest.raises(OSError, match="121"):
        bus.read_byte(0x51)
    return got


@pytest.fixture
def recorded(tmp_path):
    """A conversation, its transcript, and the clock's end."""
    clock = VirtualClock()
    peer = EchoPeer(delay_ns=1_000_000)
    line = SimulatedLine("psu1", peer, clock)
    peer.attach(line, clock)
    publish_stream("sim://replay-test/psu1", line)
    publish_bus("sim://replay-test/i2c1", SimulatedBus(clock, 100_000, [MemoryPeer()]))
    path = tmp_path / "transcript.tsv"
    with path.open("wb", buffering=0) as sink:
        transcript = Transcript(sink)
        port = open_port("psu1", "sim://replay-test/psu1", clock, transcript)
        bus = open_bus("mem1", "sim://replay-test/i2c1", clock, transcript)
        got = converse(port, bus)
        transcript.flush()
    withdraw("sim://replay-test/")
    return path, got, clock.now_ns()


@pytest.fixture
def replayed(recorded):
    """Port and bus on the transcript of `recorded`."""
    path, got, end_ns = recorded
    clock = VirtualClock()
    playback = Playback(path, clock, where=lambda: "step 1.2")
    publish_stream("replay://replay-test/psu1", ReplayedStream("psu1", playback))
    publish_bus("replay://replay-test/mem1", ReplayedBus("mem1", playback))
    port = open_port("psu1", "replay://replay-test/psu1", clock, Transcript(None))
    bus = open_bus("mem1", "replay://replay-test/mem1", clock, Transcript(None))
    yield port, bus, playback, clock, got, end_ns
    withdraw("replay://replay-test/")


def test_the_same_conversation_gets_the_same_bytes_at_the_same_times(replayed):
    """Replay gives every byte, every error and every instant again."""
    port, bus, playback, clock, got, end_ns = replayed
    assert converse(port, bus) == got
    assert playback.exhausted
    assert clock.now_ns() == end_ns


def test_other_bytes_diverge_with_port_offset_and_step(replayed):
    """The first differing byte is named, with the step that asked."""
    port, *_ = replayed
    with pytest.raises(Diverged, match=r"psu1: write 61736b21 at step 1.2.*operation 0, byte 3"):
        port.write(b"ask!")


def test_another_order_diverges(replayed):
    """The order over all devices counts, not only the order on one."""
    _, bus, *_ = replayed
    with pytest.raises(Diverged, match="the record holds psu1: write"):
        bus.read_byte(0x50)


def test_asking_beyond_the_record_diverges(replayed):
    """A record that has ended answers nothing."""
    port, bus, *_ = replayed
    converse(port, bus)
    with pytest.raises(Diverged, match="the record has ended"):
        port.write(b"more")


def test_every_operation_is_in_the_transcript_once_and_in_order(recorded):
    """Sequence numbers have no holes, and times never go back."""
    operations = list(read_transcript(recorded[0]))
    assert [operation.sequence for operation in operations] == list(range(len(operations)))
    assert all(operation.start_ns <= operation.end_ns for operation in operations)
    assert operations[0].sent == b"ask\n"
    assert operations[-1].error == "121"


def test_a_torn_last_line_is_left_out_and_a_damaged_one_is_named(recorded):
    """What a kill left half written is not an operation; damage inside is an error with its line."""
    path = recorded[0]
    text = path.read_text()
    path.write_text(text + "99\tpsu1\twr")
    assert len(list(read_transcript(path))) == text.count("\n") - 1
    lines = text.splitlines(keepends=True)
    lines[2] = "garbage\n"
    path.write_text("".join(lines))
    with pytest.raises(EvidenceError, match="transcript.tsv:3"):
        list(read_transcript(path))


def test_the_header_has_a_field_for_every_column(recorded):
    """A table reader finds as many names as values."""
    path, *_ = recorded
    header, *lines = path.read_text(encoding="utf-8").splitlines()
    assert header.split("\t")[0] == "hil/transcript/10 sequence"
    assert {line.count("\t") for line in lines} == {header.count("\t")}


@pytest.mark.parametrize(
    "header",
    [
        "hil/transcript/1\t",
        "hil/transcript/2 ",
        "hil/transcript/3 ",
        "hil/transcript/4 ",
        "hil/transcript/5 ",
        "hil/transcript/6 ",
        "hil/transcript/8 ",
        "hil/transcript/7 ",
    ],
)
def test_transcripts_of_earlier_formats_are_read_as_ever(recorded, header):
    """The first had a field of its own for the format; their lines are the same."""
    path, *_ = recorded
    operations = list(read_transcript(path))
    path.write_text(path.read_text(encoding="utf-8").replace("hil/transcript/10 ", header), encoding="utf-8")
    assert list(read_transcript(path)) == operations


@pytest.mark.parametrize(
    ("header", "found"),
    [("hil/transcript/2 ", ["v", ""]), *((f"hil/transcript/{later} ", ["", "v"]) for later in (3, 4, 5, 6, 7, 8))],
)
def test_a_monitor_at_a_point_is_told_from_one_in_a_wait(tmp_path, header, found):
    """Up to format 2 both had one name; since then a turn in a wait is left for it. Rows wait since 4."""
    sink = FileIO(tmp_path / "t.tsv", "w")
    transcript = Transcript(sink)
    transcript.note("v", MONITOR, 5, 5)
    transcript.flush()
    sink.close()
    path = tmp_path / "t.tsv"
    path.write_text(path.read_text(encoding="utf-8").replace("hil/transcript/10 ", header), encoding="utf-8")
    playback = Playback(path, VirtualClock(), lambda: "here")
    assert [playback.take_monitor(5, name, Place(0, 1)) for name in (OVERDUE, MONITOR)] == found
    assert playback.rows_wait is (header > "hil/transcript/3 ")
    assert playback.shared is (header > "hil/transcript/5 ")
    assert playback.all_share is (header > "hil/transcript/6 ")
    assert playback.names_asked is (header > "hil/transcript/7 ")
    assert not playback.sparing


def test_a_question_is_one_operation(recorded):
    """Question and reply stand in one line."""
    (exchange,) = [operation for operation in read_transcript(recorded[0]) if operation.name == "exchange"]
    assert (exchange.sent, exchange.received) == (b"again\n", b"again\n")
    assert exchange.end_ns > exchange.start_ns


@pytest.mark.parametrize("looked", [[], ["waiting"], ["waiting", "discard"]])
def test_a_question_in_parts_is_answered(tmp_path, looked):
    """Up to format 4 a look at the buffer, the question and the parts of its reply were operations of their own."""
    told = {"waiting": b"\0\0\0\2"}
    with FileIO(tmp_path / "t.tsv", "w") as sink:
        transcript = Transcript(sink)
        for name in looked:
            transcript.note("tec1", name, 0, 0, received=told.get(name, b""))
        transcript.note("tec1", "write", 0, 4, sent=b"ask")
        for name, received in (("read", b"a"), ("waiting", b"\0\0\0\2"), ("read", b"ns")):
            transcript.note("tec1", name, 9, 9, received=received)
        transcript.flush()
    path = tmp_path / "t.tsv"
    path.write_text(path.read_text(encoding="utf-8").replace("transcript/10 ", "transcript/4 "), encoding="utf-8")
    playback = Playback(path, VirtualClock(), lambda: "here")
    assert ReplayedStream("tec1", playback).exchange(b"ask", 0.5) == b"ans"
    assert playback.exhausted


@pytest.mark.parametrize("name", [HOLD, DISTRESS])
def test_a_wait_looks_up_where_something_came_upon_it(tmp_path, name):
    """A hold begins, and a bench is lost, during a wait, not at its end; anything else is left to its end."""
    path = tmp_path / "transcript.tsv"
    with path.open("wb", buffering=0) as sink:
        transcript = Transcript(sink)
        transcript.note("bench", name, 40, 40, sent=b"7")
        transcript.note("psu1", "write", 60, 60, sent=b"x")
        transcript.flush()
    clock = VirtualClock()
    playback = Playback(path, clock, lambda: "here")
    assert [playback.look_up_ns(when_ns) for when_ns in (30, 40, 100)] == [30, 40, 40]
    clock.wait_until(playback.look_up_ns(100))
    assert playback.look_up_ns(100) == 100
    playback.take("bench", name, b"7")
    assert playback.look_up_ns(100) == 100
