"""The simulated board keeps the rules of the page about the OBC link: sequences, lengths, rings, clocks, resets."""

from __future__ import annotations

import json

import pytest
from obc_page import BoardUnderTest, Sensor

from hil.simulation.peers.obc_link.uart import seal

IDENTIFY, TIME, I2C, ADC, START, STOP, WATCHDOG, HALT, STATUS, SPEED = range(1, 11)
FIFO = bytes.fromhex("01682e010830") + (1024).to_bytes(2, "little")
REGISTER = bytes.fromhex("0068750100")


def u16(number: int) -> bytes:
    """Return two bytes."""
    return number.to_bytes(2, "little")


def u32(number: int) -> bytes:
    """Return four bytes."""
    return number.to_bytes(4, "little")


def by_timer(period_us: int, *transfers: bytes, watermark: int = 0) -> bytes:
    """Return the payload of a STREAM_START by the timer."""
    return bytes([0, 0, 0]) + u32(period_us) + u16(watermark) + bytes([len(transfers)]) + b"".join(transfers)


def by_line(*transfers: bytes, line: int = 0) -> bytes:
    """Return the payload of a STREAM_START by a line."""
    return bytes([0, 0, 1]) + u32(line) + u16(0) + bytes([len(transfers)]) + b"".join(transfers)


def writing(*data: bytes) -> bytes:
    """Return the payload of an I2C request that writes."""
    return bytes([0, len(data)]) + b"".join(bytes([0x68, 0]) + u16(len(item)) + item for item in data)


def numbers(frames) -> list[int]:
    """Return the numbers of stream frames."""
    return [int.from_bytes(frame.payload[2:6], "little") for frame in frames if frame.kind == 0x40]


def stamps(frames) -> list[int]:
    """Return the device times of stream frames."""
    return [int.from_bytes(frame.payload[10:18], "little") for frame in frames if frame.kind == 0x40]


def test_the_same_bytes_again_are_not_executed_twice():
    """The remembered reply comes again, and the device was written once."""
    under = BoardUnderTest()
    first = under.ask(I2C, 9, writing(b"\x4e\x0f"))
    assert under.ask(I2C, 9, writing(b"\x4e\x0f")) == first == bytes([0, 1, 0, 0, 0])
    assert under.sensor.written == [b"\x4e\x0f"]


def test_the_reply_to_a_repetition_follows_a_delimiter():
    """Whatever was cut before it does not cost it too; a first reply has none."""
    under = BoardUnderTest()
    for kind, payload in ((I2C, writing(b"\x4e")), (IDENTIFY, b"")):
        request = seal(kind, 9 + kind, payload)
        first = under.raw(request)
        assert first[0] != 0
        assert under.raw(request) == b"\0" + first


def test_a_repetition_while_the_request_is_executed():
    """The copy waits, and both get the same reply; the device was written once."""
    under = BoardUnderTest()
    frames = under.frames(under.raw(2 * seal(I2C, 9, writing(bytes(100)))))
    assert len(frames) == 2
    assert frames[0] == frames[1]
    assert len(under.sensor.written) == 1


def test_one_sequence_with_other_bytes():
    """Error SEQUENCE; nothing is executed and the memory stays. What only reads is executed all the same."""
    under = BoardUnderTest()
    reply = under.ask(WATCHDOG, 5, u32(60_000))
    assert under.ask(WATCHDOG, 5, u32(50_000)) == bytes([5, 5, 0])
    assert under.ask(HALT, 5) == bytes([5, 5, 0])
    assert under.ask(WATCHDOG, 5, u32(60_000)) == reply
    assert under.ask(STATUS, 5)[2:6] == u32(60_000)
    assert under.ask(HALT, 5) == bytes([5, 5, 0])


def test_an_unknown_type_of_a_sequence_that_was_there():
    """It is told, and the memory stays."""
    under = BoardUnderTest()
    reply = under.ask(WATCHDOG, 5, u32(60_000))
    assert under.ask(0x3E, 5) == bytes([1, 0x3E, 0])
    assert under.ask(WATCHDOG, 5, u32(60_000)) == reply


@pytest.mark.parametrize("kind", [0x00, 0x40, 0x7F, 0x81, 0xFF])
def test_types_that_no_host_sends(kind):
    """They are unusable, and so is the sequence 0."""
    under = BoardUnderTest()
    assert under.raw(seal(kind, 1, b"")) == b""
    assert under.raw(seal(IDENTIFY, 0, b"")) == b""
    assert under.board.tally.unusable == 2


def test_resynchronisation_at_the_next_delimiter():
    """Half a frame, noise and an endless piece cost no frame after them; empty pieces are no error."""
    under = BoardUnderTest()
    whole = seal(IDENTIFY, 1, b"")
    assert len(under.frames(under.raw(whole[:3] + b"\0" + whole))) == 1
    assert len(under.frames(under.raw(b"\0\0\0" + bytes([200, 3]) + b"\0" + whole))) == 1
    for _ in range(40):
        under.raw(b"\x55" * 500, 0)
    assert len(under.frames(under.raw(b"\0" + whole))) == 1
    assert (under.board.tally.usable, under.board.tally.unusable) == (3, 3)


def test_bytes_one_by_one():
    """How they are cut does not matter."""
    under = BoardUnderTest()
    for byte in seal(IDENTIFY, 1, b""):
        under.raw(bytes([byte]), 0)
    under.clock.sleep(0.1)
    assert len(under.frames(under.fetch())) == 1


def test_requests_beyond_those_that_can_wait():
    """Two wait, a fourth is lost: EVENT 4 tells it, and STATUS counts it."""
    under = BoardUnderTest()
    frames = under.frames(under.raw(b"".join(seal(I2C, number, writing(b"\x01")) for number in (1, 2, 3, 4))))
    assert [frame.kind for frame in frames] == [0x42, 0x83, 0x83, 0x83]
    assert frames[0].payload[0] == 4
    assert frames[0].payload[-4:] == u32(1)
    assert under.ask(STATUS, 9)[14:18] == u32(1)


REFUSED = [
    (IDENTIFY, b"\0", 3, 1),
    (TIME, bytes(24), 3, 24),
    (I2C, b"", 3, 0),
    (I2C, bytes([1, 1, 0x68, 1, 1, 0]), 4, 0),
    (I2C, bytes([0, 0]), 4, 1),
    (I2C, bytes([0, 9, 0x68]), 4, 1),
    (I2C, bytes([0, 1, 0x80, 1, 1, 0]), 4, 2),
    (I2C, bytes([0, 1, 0x68, 2, 1, 0]), 4, 3),
    (I2C, bytes([0, 1, 0x68, 1, 0, 0]), 4, 4),
    (I2C, bytes([0, 1, 0x68, 1, 1, 0, 0]), 3, 7),
    (I2C, bytes([0, 1, 0x80, 0, 2, 0, 0]), 3, 7),
    (I2C, bytes([0, 1, 0x68, 1, 0, 9]), 8, 2 + 3 + 2304 + 6),
    (I2C, bytes([0, 1, 0x68, 1]) + u16(1111), 8, 0),
    (ADC, bytes([6, 1, 0]), 4, 0),
    (ADC, bytes([0, 0, 0]), 4, 1),
    (ADC, bytes([0, 1, 4]), 4, 1),
    (START, by_timer(999, REGISTER), 4, 3),
    (START, by_line(REGISTER, line=2), 4, 3),
    (START, by_timer(1000, REGISTER, watermark=8), 4, 7),
    (START, by_timer(1000), 4, 9),
    (START, by_timer(1000, b"\x02"), 4, 10),
    (START, by_timer(1000, FIFO[:3] + b"\0" + FIFO[4:]), 4, 13),
    (START, by_timer(1000, FIFO[:6] + u16(7)), 4, 16),
    (START, by_timer(1000, *(2 * [FIFO[:6] + u16(600)])), 8, 0),
    (START, by_timer(1000, *(3 * [FIFO])), 8, 19 + 3 * 1027 + 6),
    (STOP, b"\1", 4, 0),
    (STOP, b"\0", 7, 0),
    (WATCHDOG, u32(99), 4, 0),
    (WATCHDOG, u32(600_001), 4, 0),
    (SPEED, b"\0" + u32(200_000), 4, 1),
]


@pytest.mark.parametrize(("kind", "payload", "code", "detail"), REFUSED)
def test_what_is_refused_and_why(kind, payload, code, detail):
    """Length, parameter with its offset, too long for the frame or for the bus, not running."""
    assert BoardUnderTest().ask(kind, 1, payload) == bytes([code]) + u16(detail)


def test_speed_of_a_bus_with_a_stream():
    """It is busy; without the stream it is set, and transfers take less."""
    under = BoardUnderTest()
    under.ask(START, 1, by_line(REGISTER))
    assert under.ask(SPEED, 2, b"\0" + u32(400_000)) == bytes([6, 0, 0])
    under.ask(HALT, 3)
    assert under.ask(SPEED, 4, b"\0" + u32(400_000))[0] == 0
    under.sent.clear()
    before_ns = under.clock.now_ns()
    under.peer.receive(seal(I2C, 5, writing(bytes(99))))
    under.clock.sleep(0.1)
    # 20 us to begin with, and 100 bytes of 9 bits.
    assert under.sent[0][0] - before_ns == 20_000 + 100 * 9 * 2500


@pytest.mark.parametrize("drift", [1e-4, -1e-4])
def test_a_clock_that_is_wrong(drift):
    """An hour of the bench is 0.36 s more or less in TIME's replies; triggers of the timer follow it."""
    under = BoardUnderTest({"clock_drift": f"{drift}", "clock_offset": "3", "command_time": "0"})
    for hours in (0, 1):
        under.clock.wait_until(hours * 3600 * 10**9)
        reply = under.ask(TIME, 1 + hours, bytes(8) + b"\xa5" * 17)
        shown_us = int.from_bytes(reply[9:17], "little")
        assert shown_us == 3_000_000 + round(hours * 3_600_000_000 * (1 + drift))
    start_us = int.from_bytes(under.ask(START, 5, by_timer(1_000_000, REGISTER), 0.1)[2:10], "little")
    under.clock.sleep(10)
    assert stamps(under.frames(b"".join(data for _, data in under.sent))) == [
        start_us + k * 10**6 for k in range(1, 11)
    ]
    instants = [at_ns for at_ns, _ in under.sent]
    assert instants[9] - instants[0] == pytest.approx(9e9 / (1 + drift), abs=2)


def test_receive_stamps_are_of_the_delimiter():
    """Of two requests in one piece the first was complete earlier, by the bytes after it."""
    under = BoardUnderTest(baud=921_600)
    under.clock.sleep(1)
    request = seal(TIME, 1, bytes(8) + b"\xa5" * 17)
    frames = under.frames(under.raw(request + seal(TIME, 2, bytes(8) + b"\xa5" * 17)))
    first, second = (int.from_bytes(frame.payload[9:17], "little") for frame in frames)
    assert second - first == pytest.approx(len(request) * 10.85, abs=1)
    # The second reply leaves after the first.
    sent = [int.from_bytes(frame.payload[17:25], "little") for frame in frames]
    assert sent[1] - sent[0] == pytest.approx(len(request) * 10.85, abs=1)


def test_replies_overtake_frames_that_wait_but_not_one_that_is_sent():
    """A reply comes after the frame on the line and before the next one; its send stamp says so."""
    under = BoardUnderTest({"clock_offset": "1"}, baud=9600)
    under.sensor.fifo = bytes(800)
    under.ask(START, 1, by_line(REGISTER[:3] + u16(200)), 1)
    for _ in range(3):
        under.sensor.pull()
        under.clock.sleep(0.1)
    frames = under.frames(under.raw(seal(TIME, 2, bytes(8) + b"\xa5" * 17), 3))
    assert [frame.kind for frame in frames] == [0x40, 0x40, 0x82, 0x40]
    received, sent = (int.from_bytes(frames[2].payload[place : place + 8], "little") for place in (9, 17))
    assert 50_000 < sent - received < 300_000


def test_the_newest_frame_is_dropped_when_the_ring_is_full():
    """While frames wait the ring overflows; the numbers go on, and the loss counter explains the hole."""
    under = BoardUnderTest({"ring": "4096"}, faults=[{"kind": "stall", "from": "1 s", "until": "3 s"}])
    under.ask(START, 1, by_timer(100_000, REGISTER[:3] + u16(500)), 0.01)
    under.clock.wait_until(4 * 10**9)
    frames = under.frames(under.fetch())
    found = numbers(frames)
    lost = [int.from_bytes(frame.payload[6:10], "little") for frame in frames]
    assert found[:9] == list(range(9))
    missing = sorted(set(range(found[-1])) - set(found))
    # Seven frames of 529 bytes fit into 4096.
    assert missing == list(range(16, 29))
    assert lost[-1] == len(missing)
    under.ask(HALT, 2, seconds=0.01)
    assert under.ask(STATUS, 3)[18:22] == u32(len(missing))


def test_frames_lost_on_the_line():
    """The board does not know of them: its loss counter stays 0."""
    under = BoardUnderTest(faults=[{"kind": "lose-frames", "from": "1 s", "frames": "3"}])
    under.ask(START, 1, by_timer(100_000, REGISTER), 0.01)
    under.clock.wait_until(2_050_000_000)
    frames = under.frames(under.fetch())
    assert sorted(set(range(20)) - set(numbers(frames))) == [9, 10, 11]
    assert under.ask(STOP, 2, b"\0") == bytes([0, 0]) + u32(20) + u32(0)


def test_stop_sends_what_waits_before_its_reply():
    """Turn, waiting trigger and ring come first; the numbers are all there."""
    under = BoardUnderTest(faults=[{"kind": "stall", "from": "0 s", "until": "1 s"}])
    under.ask(START, 1, by_line(REGISTER), 0.01)
    for _ in range(2):
        under.sensor.pull()
    assert under.raw(seal(STOP, 2, b"\0"), 0.5) == b""
    under.sensor.pull()
    frames = under.frames(under.raw(b"", 1))
    assert [frame.kind for frame in frames] == [0x40, 0x40, 0x86]
    assert frames[-1].payload == bytes([0, 0]) + u32(2) + u32(0)


def test_a_turn_waits_for_a_request_and_a_request_for_a_turn():
    """Messages of both never mix, and the trigger keeps its time."""
    under = BoardUnderTest({"clock_offset": "1"})
    under.ask(START, 1, by_line(REGISTER), 0.01)
    under.peer.receive(seal(I2C, 2, writing(bytes(100))))
    under.clock.sleep(0.001)
    under.sensor.pull()
    at_us = under.board._board_clock.at(under.clock.now_ns())
    under.peer.receive(seal(I2C, 3, writing(bytes(100))))
    under.clock.sleep(0.1)
    frames = under.frames(under.fetch())
    assert [frame.kind for frame in frames] == [0x83, 0x40, 0x83]
    assert stamps(frames) == [at_us]


def test_watermark_polls_without_numbers_for_nothing():
    """Only a turn that has enough takes a number; a counter that nobody acknowledges is told."""
    under = BoardUnderTest()
    under.ask(START, 1, by_timer(1000, FIFO, watermark=16), 0.02)
    assert under.fetch() == b""
    under.sensor.fifo = bytes(19)
    frames = under.frames(under.raw(b"", 0.05))
    assert numbers(frames) == [0]
    assert frames[0].payload[18:] == bytes([1, 0, 16, 0]) + bytes(16)
    assert len(under.sensor.fifo) == 3
    under.sensor.refused = {0x2E}
    frames = under.frames(under.raw(b"", 0.0105))
    assert numbers(frames)[:10] == list(range(1, 11))
    assert frames[0].payload[18:] == bytes([1, 1, 0, 0])


def test_watchdog_stops_the_stream_and_can_be_kept_quiet():
    """Every usable frame starts its time again; in the end there is one event and silence."""
    under = BoardUnderTest()
    under.ask(START, 1, by_timer(50_000, REGISTER), 0.01)
    under.ask(WATCHDOG, 2, u32(200), 0.01)
    for number in range(3, 13):
        assert 0x42 not in [frame.kind for frame in under.frames(under.raw(seal(STATUS, number, b""), 0.15))]
    assert [frame.kind for frame in under.frames(under.raw(b"", 0.2))][-1] == 0x42
    assert under.raw(b"", 1) == b""
    assert under.ask(STATUS, 20)[1:6] == bytes(5)


def test_reset_in_the_middle_of_a_stream():
    """Stream, speed, memory and counters are gone, the clock begins at 0, and the boot notice says so first."""
    under = BoardUnderTest({"clock_offset": "100", "boots": "7"}, faults=[{"kind": "reset", "from": "2 s"}])
    under.ask(SPEED, 1, b"\0" + u32(400_000))
    under.ask(START, 2, by_timer(10_000, REGISTER), 0.001)
    under.clock.wait_until(2 * 10**9)
    under.sent.clear()
    assert under.raw(seal(IDENTIFY, 3, b""), 0.02) == b""
    data = under.raw(b"", 1)
    (boot,) = under.frames(data)
    assert data[0] == 0
    assert (boot.kind, boot.payload) == (0x41, bytes([1, 0]) + u32(8) + bytes([4, 1, 0, 0]))
    assert under.ask(IDENTIFY, 1)[26:31] == u32(8) + bytes([4])
    assert under.ask(STOP, 2, b"\0") == bytes([7, 0, 0])
    assert int.from_bytes(under.ask(TIME, 3, bytes(25))[9:17], "little") == pytest.approx(2_020_000, abs=100)
    assert under.board._bus.frequency_hz == 100_000


def test_an_address_that_does_not_acknowledge_for_a_while():
    """Status 1 within the interval, and afterwards all is well; another device is not concerned."""
    fault = {"kind": "nack", "address": "0x68", "from": "1 s", "until": "2 s"}
    other = Sensor(address=0x1C)
    under = BoardUnderTest(faults=[fault], sensors=None)
    under.sensors.append(other)
    other.attach(under.clock)
    under.peer.serve(under.sensors)
    ask = bytes([0, 1, 0x68, 1, 1, 0])
    under.clock.wait_until(1_200_000_000)
    assert under.ask(I2C, 1, ask)[2] == 1
    assert under.ask(I2C, 2, bytes([0, 1, 0x1C, 1, 1, 0]), 0.1)[2] == 0
    under.clock.wait_until(2_000_000_000)
    assert under.ask(I2C, 3, ask)[2] == 0


def test_analogue_inputs_follow_their_noise_not_the_host():
    """Equal instants give equal conversions; the scatter is what the truth says; an open input is 0 V."""
    replies = []
    for _ in range(2):
        under = BoardUnderTest({"analog_noise": "2"})
        replies.append(under.ask(ADC, 1, bytes([3]) + u16(1024)))
    assert replies[0] == replies[1]
    total = int.from_bytes(replies[0][4:8], "little") / 1024
    squares = int.from_bytes(replies[0][8:16], "little") / 1024
    assert total == pytest.approx(0.8, abs=0.1)
    assert squares == pytest.approx(2.0, abs=0.6)


@pytest.mark.parametrize("after_ms", [0, 1, 2, 5, 11, 20, 40, 190, 320])
def test_restored_in_the_middle_of_everything(after_ms):
    """A fresh board given the state as JSON sends what the one that went on sends."""
    faults = [{"kind": "reset", "from": "270 ms"}, {"kind": "lose-frames", "frames": "4"}]

    def exercise():
        under = BoardUnderTest({"clock_drift": "0.0001"}, faults=faults, baud=115_200)
        under.raw(seal(START, 1, by_timer(5000, REGISTER, FIFO)), 0.002)
        under.sensor.fifo = bytes(range(256)) * 8
        under.raw(seal(WATCHDOG, 2, u32(150)), 0.01)
        under.raw(seal(I2C, 3, writing(bytes(200))) + seal(STOP, 4, b"\0") + seal(ADC, 5, b"\0\1\0")[:5], 0)
        under.clock.sleep(after_ms / 1000)
        under.fetch()
        return under

    under, other = exercise(), BoardUnderTest({"clock_drift": "0.0001"}, faults=faults, baud=115_200)
    other.clock.wait_until(under.clock.now_ns())
    other.fetch()
    state = json.loads(json.dumps(under.peer.state()))
    other.peer.restore(state)
    assert json.loads(json.dumps(other.peer.state())) == state
    other.sensor.fifo, other.sensor.pointer = under.sensor.fifo, under.sensor.pointer
    for item in (under, other):
        item.raw(seal(ADC, 5, b"\0\1\0")[5:], 0.5)
    assert other.sent == under.sent
    assert other.peer.state() == under.peer.state()
