"""Streams of the board: order, losses, time keeping, and how they end."""

from __future__ import annotations

import struct

import pytest
from scripted_obc import SPEED, START, STOP, TIME, WATCHDOG, ScriptedObc, boot_notice, stream_data

from hil.clock.virtual import VirtualClock
from hil.instruments.obc_link.bus import ObcBus
from hil.instruments.obc_link.frames import seal
from hil.instruments.obc_link.session import ObcSession
from hil.model.errors import DeviceFault, Garbled, NoReply, Refused, Rejected
from hil.wire.streaming import RegisterRead

PROGRAM = [RegisterRead(address=0x68, register=0x1D, length=2)]
STARTED = bytes.fromhex("00 00 01 00000000 0000 01 00 68 1d 0200")


@pytest.fixture
def port():
    """The line with a board at its end."""
    return ScriptedObc(VirtualClock())


@pytest.fixture
def session(port):
    """A session."""
    return ObcSession("obc", port, port.clock)


@pytest.fixture
def bus(session, port):
    """Its bus."""
    return ObcBus(session, port.clock)


def stopped(numbers, lost=0):
    """Return the reply to STREAM_STOP."""
    return lambda _: struct.pack("<BBII", 0, 0, numbers, lost)


def test_a_stream_from_start_to_stop(bus, port):
    """Frames come in order with device time; the summary counts them."""
    stream = bus.start_stream(PROGRAM, line=0)
    assert port.asked()[1:] == [SPEED, TIME, TIME, TIME, TIME, WATCHDOG, START]
    assert port.requests[-1].payload == STARTED
    assert list(stream.frames()) == []
    port.come(stream_data(0, b"ab", device_us=7_000_001) + stream_data(1, None, device_us=8_000_000))
    first, second = stream.frames()
    assert (first.number, first.device_s, first.replies) == (0, 7.000001, (b"ab",))
    assert second.replies == (None,)
    port.answers[STOP] = stopped(2)
    summary = stream.stop()
    assert (summary.frames, summary.lost) == (2, 0)
    assert port.requests[-1].kind == WATCHDOG
    assert port.requests[-1].payload == bytes(4)


def test_a_timer_has_its_period_in_microseconds(bus, port):
    """A period goes to the board as a timer."""
    bus.start_stream(PROGRAM, period_s=0.5)
    assert port.requests[-1].payload[2:7] == struct.pack("<BI", 0, 500_000)


@pytest.mark.parametrize("trigger", [{}, {"period_s": 1.0, "line": 0}, {"line": -1}, {"period_s": 1e9}])
def test_triggers_that_make_no_sense_are_refused(bus, port, trigger):
    """A stream has a period or a line, and its numbers fit."""
    with pytest.raises(Refused):
        bus.start_stream(PROGRAM, **trigger)
    assert START not in port.asked()


def test_a_refused_program_is_rejected(bus, port):
    """What the board cannot run is Rejected with its code."""
    port.answers[START] = lambda _: struct.pack("<BH", 8, 3000)
    with pytest.raises(Rejected, match="TOO_LONG, detail 0x0bb8"):
        bus.start_stream(PROGRAM, line=0)


def test_a_stream_left_behind_is_stopped_first(bus, port):
    """Where an earlier session left the stream running, it is stopped, and its frames are not ours."""
    answers = [struct.pack("<BH", 6, 0), b"\0"]
    port.answers[START] = lambda _: answers.pop(0)
    port.before = b""

    def stop(_):
        port.come(stream_data(900, b"old"), 0.0)
        return struct.pack("<BBII", 0, 0, 901, 0)

    port.answers[STOP] = stop
    stream = bus.start_stream(PROGRAM, line=0)
    assert port.asked()[-3:] == [START, STOP, START]
    port.come(stream_data(0, b"ab"))
    assert [frame.number for frame in stream.frames()] == [0]


def test_lost_frames_are_counted(bus, port):
    """Numbers that never came are lost, whether the board dropped them, the line damaged them, or none followed."""
    stream = bus.start_stream(PROGRAM, line=0)
    damaged = bytearray(stream_data(2, b"zz"))
    damaged[5] ^= 1
    port.come(stream_data(0, b"ab") + bytes(damaged) + stream_data(5, b"cd", lost=2) + stream_data(5, b"cd", lost=2))
    assert [(frame.number, frame.lost) for frame in stream.frames()] == [(0, 0), (5, 2)]
    port.answers[STOP] = stopped(8, 4)
    summary = stream.stop()
    assert (summary.frames, summary.lost) == (2, 6)


def test_frames_before_the_stop_can_still_be_fetched(bus, port):
    """What came before the reply to STREAM_STOP is not lost."""
    stream = bus.start_stream(PROGRAM, line=0)
    port.before = stream_data(0, b"ab")
    port.answers[STOP] = stopped(1)
    assert stream.stop().frames == 1
    assert [frame.number for frame in stream.frames()] == [0]
    assert list(stream.frames()) == []
    assert stream.stop().frames == 1


def test_frames_that_are_cut_short_are_stray(bus, port, session):
    """Data with a right CRC and missing bytes are not a frame of the stream."""
    stream = bus.start_stream(PROGRAM, line=0)
    port.come(seal(0x40, 0, b"\0\0\0"))
    assert list(stream.frames()) == []
    assert session.arrivals.stray == 1


def test_a_reset_breaks_the_stream_after_its_last_frame(bus, port):
    """Frames before the boot notice are given, then the reset is told, and stop tells it as well."""
    stream = bus.start_stream(PROGRAM, line=0)
    port.come(stream_data(0, b"ab") + boot_notice(42, 3))
    assert [frame.number for frame in stream.frames()] == [0]
    with pytest.raises(DeviceFault, match="boot 42, software reset"):
        stream.frames()
    with pytest.raises(DeviceFault, match="boot 42, software reset"):
        stream.stop()
    assert STOP not in port.asked()
    assert (stream.stop().frames, stream.stop().lost) == (1, 0)


def test_an_expired_watchdog_breaks_the_stream(bus, port, session):
    """The board's event says why no frame comes any more."""
    stream = bus.start_stream(PROGRAM, line=0)
    port.come(seal(0x42, 0, struct.pack("<BIQI", 1, 1, 12_345_678, 60_000)))
    with pytest.raises(DeviceFault, match="stopped its streams: it heard nothing for 60000 ms"):
        stream.frames()
    assert session.arrivals.events == 1


def test_other_events_break_nothing(bus, port, session):
    """A bus that was freed is counted only."""
    stream = bus.start_stream(PROGRAM, line=0)
    port.come(seal(0x42, 0, struct.pack("<BIQI", 2, 1, 12_345_678, 0)))
    assert list(stream.frames()) == []
    assert session.arrivals.events == 1


def test_time_is_exchanged_every_ten_seconds(bus, port):
    """While frames are fetched each second, TIME is asked every 10 s."""
    stream = bus.start_stream(PROGRAM, line=0)
    before = port.asked().count(TIME)
    for number in range(41):
        port.clock.sleep(1.0)
        port.come(stream_data(number, b"ab"))
        stream.frames()
    assert port.asked().count(TIME) - before == 4


def test_a_silent_link_is_found(bus, port):
    """Where no frame comes for 2 s, TIME tells whether the board is still there."""
    stream = bus.start_stream(PROGRAM, line=0)
    port.clock.sleep(2.5)
    assert list(stream.frames()) == []
    port.lose = 1000
    port.clock.sleep(2.5)
    start = port.clock.now()
    with pytest.raises(NoReply, match="obc: asked"):
        stream.frames()
    assert port.clock.now() - start < 0.5


def test_a_lost_reply_to_time_is_no_fault(bus, port):
    """TIME is asked again, with new stamps, where its reply was lost."""
    stream = bus.start_stream(PROGRAM, line=0)
    port.clock.sleep(11.0)
    port.lose = 1
    assert list(stream.frames()) == []
    first, second = [request for request in port.requests if request.kind == TIME][-2:]
    assert first.payload != second.payload


def test_a_foreign_host_value_is_garbled(bus, port):
    """A reply to TIME that repeats another host value is nonsense."""
    port.answers[TIME] = lambda _: b"\0" + struct.pack("<QQQ", 77, 1, 1)
    with pytest.raises(Garbled, match="another host value"):
        bus.start_stream(PROGRAM, line=0)


def test_what_is_sent_does_not_depend_on_the_time():
    """Two streams at different times send the same bytes, so that a replay can follow a hardware run."""
    lines = []
    for pause in (0.0, 1.5):
        obc = ScriptedObc(VirtualClock())
        obc.clock.sleep(pause)
        stream = ObcBus(ObcSession("obc", obc, obc.clock), obc.clock).start_stream(PROGRAM, line=0)
        obc.clock.sleep(pause)
        stream.stop()
        lines.append(obc.lines)
    assert lines[0] == lines[1]


def test_a_clock_that_went_back_is_a_reset(bus, port):
    """Device time that runs backwards is a reset without a notice."""
    stream = bus.start_stream(PROGRAM, line=0)
    port.device_offset_us = -11_000_000
    port.clock.sleep(11.0)
    with pytest.raises(DeviceFault, match="the board's clock went back"):
        stream.frames()


def test_the_drift_is_reported(bus, port):
    """A device clock that is 20 ppm fast is found within its uncertainty."""
    port.drift = 20e-6
    stream = bus.start_stream(PROGRAM, period_s=1.0)
    for number in range(600):
        port.come(stream_data(number, b"ab"), 1.0)
        port.clock.sleep(1.0)
        stream.frames()
    port.answers[STOP] = stopped(600)
    summary = stream.stop()
    assert summary.drift_uncertainty < 2e-9
    assert abs(summary.drift - 20e-6) < 4 * summary.drift_uncertainty
    assert summary.offset_s == pytest.approx(-5.0 - 20e-6 * port.clock.now(), abs=2e-6)
