"""The simulated board against the page about the OBC link: every golden frame, and every rule."""

from __future__ import annotations

import binascii

import pytest
from obc_page import GOLDEN, BoardUnderTest, Even, golden

from hil.simulation.peers.obc_link.commands import Tally
from hil.simulation.peers.obc_link.uart import FrameReader, seal


def opened(data: bytes):
    """Return the one frame in some bytes."""
    ((_, frame),) = FrameReader().take(data)
    return frame


def test_the_page_has_its_golden_frames():
    """All thirty of them are found, in order."""
    assert list(GOLDEN) == list(range(1, 31))
    assert {sender for sender, _, _ in GOLDEN.values()} == {"host", "device"}


@pytest.mark.parametrize("number", [number for number in GOLDEN if number != 30])
def test_golden_frames_are_taken_and_made(number):
    """Each is understood, and making it again gives the same bytes."""
    frame = opened(golden(number))
    assert frame is not None
    assert seal(frame.kind, frame.sequence, frame.payload) == golden(number)


def test_identify():
    """Frames 1 and 2; a simulated board says that it is one in the place of its firmware's commit."""
    said, page = opened(BoardUnderTest().raw(golden(1))), opened(golden(2))
    assert (said.kind, said.sequence) == (page.kind, page.sequence)
    assert said.payload == page.payload.replace(bytes.fromhex("9f3c21d07be45a18"), b"SIMULATE")


def test_time():
    """Frames 3 and 4: the stamps are those of the delimiter and of the reply's first byte."""
    under = BoardUnderTest({"clock_offset": "7.25", "command_time": "0.000021"})
    under.until_us(7_250_431)
    assert under.raw(golden(3)) == golden(4)


def test_transfers():
    """Frames 5 to 7: a register is read; where nobody acknowledges, the second message is not run."""
    under = BoardUnderTest()
    assert under.raw(golden(5)) == golden(6)
    under.sensor.address = 0x69
    under.peer.serve([under.sensor])
    request = opened(golden(5))
    assert under.raw(seal(request.kind, 4, request.payload)) == golden(7)


def test_conversions():
    """Frames 8 and 9: sums of conversions around half the scale."""
    under = BoardUnderTest({"analog_noise": "1"})
    under.board._commands._noise = Even([1, -1, 0, 0])

    class Half:
        def observe(self):
            return 2048 / 4095 * 3.3

    under.board._commands._inputs = {2: Half()}
    assert under.raw(golden(8)) == golden(9)


def run_stream(under):
    """Start the stream of frame 10, and bring it to number 6 with two lost triggers."""
    under.until_us(8_000_000 - 20)
    assert under.raw(golden(10), 0.001) == golden(11)
    under.until_us(8_020_113)
    first = opened(golden(12)).payload
    under.sensor.registers[0x1D] = first[22:24]
    under.sensor.fifo = first[27:]
    under.sensor.pull()
    under.until_us(8_100_000)
    assert under.fetch() == golden(12)
    for start_us in (8_110_000, 8_120_000):
        for delay_us in (0, 100, 200):
            under.until_us(start_us + delay_us)
            under.sensor.pull()
    under.until_us(8_150_000)
    assert [int.from_bytes(frame.payload[2:6], "little") for frame in under.frames(under.fetch())] == [1, 2, 4, 5]


def test_streams():
    """Frames 10 to 16: start, data, lost triggers, a sensor that does not acknowledge, a long FIFO, stop."""
    under = BoardUnderTest({"clock_offset": "7"})
    run_stream(under)
    under.sensor.refused = {0x1D}
    under.until_us(8_160_120)
    under.sensor.pull()
    under.until_us(8_170_000)
    assert under.fetch() == golden(13)
    under.sensor.refused = set()
    under.sensor.registers[0x1D] = bytes.fromhex("0106")
    under.sensor.fifo = bytes(1 + 7 * index % 255 for index in range(400))
    under.until_us(8_180_121)
    under.sensor.pull()
    under.until_us(8_250_000)
    assert under.fetch() == golden(14)
    assert under.raw(golden(15)) == golden(16)


def test_watchdog_and_halt():
    """Frames 17 to 20, and 29: armed, run out in silence; a running stream is halted."""
    under = BoardUnderTest({"clock_offset": "10"})
    under.raw(golden(10))
    assert under.raw(golden(19)) == golden(20)
    assert under.raw(golden(17)) == golden(18)
    under = BoardUnderTest({"clock_offset": "10"})
    under.until_us(10_345_678 - 20)
    assert under.raw(golden(17), 3) == golden(18) + golden(29)


def test_status():
    """Frames 21 and 22."""
    under = BoardUnderTest()
    under.board.tally = Tally(boots=41, reason=1, usable=56, unusable=1, events=1)
    under.board._stream.lost_since_reset = 3
    assert under.raw(golden(21)) == golden(22)


def test_speed():
    """Frames 23 and 24."""
    assert BoardUnderTest().raw(golden(23)) == golden(24)


def test_refusals():
    """Frames 25 to 27: unknown type, stream busy, another major version."""
    under = BoardUnderTest()
    assert under.raw(seal(0x3E, 0x0C, b"")) == golden(25)
    under.raw(golden(10))
    assert under.raw(seal(0x05, 0x0D, opened(golden(10)).payload)) == golden(26)
    assert under.raw(of_version(2, 0x01, 0x0E)) == golden(27)


def of_version(version: int, kind: int, sequence: int) -> bytes:
    """Return a request of another major version, without zeros in it but the sequence's high byte."""
    body = bytes([version, kind]) + sequence.to_bytes(2, "little")
    body += binascii.crc_hqx(body, 0xFFFF).to_bytes(2, "little")
    low, high = body.split(b"\0")
    return bytes([len(low) + 1]) + low + bytes([len(high) + 1]) + high + b"\0"


def test_boot():
    """Frame 28: a reset tells itself within 100 ms, after a delimiter."""
    under = BoardUnderTest(faults=[{"kind": "reset", "from": "2 s"}])
    under.clock.sleep(2.1)
    assert under.fetch() == b"\0" + golden(28)


def test_bad_checksum():
    """Frame 30: silence, and it is counted."""
    under = BoardUnderTest()
    assert under.raw(golden(30)) == b""
    assert under.board.tally.unusable == 1
