"""The OBC session: repeats, late and damaged replies, resets, and other people's versions."""

from __future__ import annotations

import struct

import pytest
from scripted_obc import ADC, IDENTIFY, ScriptedObc, boot_notice, identity, stream_data

from hil.clock.virtual import VirtualClock
from hil.instruments.obc_link.frames import seal
from hil.instruments.obc_link.messages import Command
from hil.instruments.obc_link.session import BoardRefused, ObcSession
from hil.model.errors import DeviceFault, Garbled, NoReply, WrongIdentity


@pytest.fixture
def port():
    """The line with a board at its end."""
    return ScriptedObc(VirtualClock())


@pytest.fixture
def session(port):
    """A session that has met its board."""
    session = ObcSession("obc", port, port.clock)
    session.identify()
    return session


def test_a_session_begins_with_a_delimiter_and_identify(port):
    """The first bytes end whatever stood on the line, and the first request is IDENTIFY with sequence 1."""
    session = ObcSession("obc", port, port.clock)
    session.request(Command.ADC, b"\0\x01\0")
    assert port.lines[0] == b"\0" + seal(IDENTIFY, 1)
    assert [(request.kind, request.sequence) for request in port.requests] == [(IDENTIFY, 1), (ADC, 2)]


def test_a_lost_reply_is_asked_for_again_with_the_same_bytes(session, port):
    """The second attempt is the first byte by byte, after a delimiter, so that the board executes it once."""
    port.lose = 1
    port.answers[ADC] = lambda _: b"\0abc"
    assert session.request(Command.ADC, b"\0\x01\0").fields == b"abc"
    assert port.requests[-1] == port.requests[-2]
    assert port.lines[-1] == b"\0" + port.lines[-2]
    assert session.repeated == 1


@pytest.mark.parametrize("command", [Command.IDENTIFY, Command.I2C, Command.ADC, Command.STREAM_STOP])
def test_silence_ends_within_half_a_second(session, port, command):
    """A board that is gone is NoReply, and all attempts of one request take 0.5 s at most."""
    port.lose = 1000
    start = port.clock.now()
    with pytest.raises(NoReply, match=f"obc: asked {command.name}, got no reply"):
        session.request(command)
    assert port.clock.now() - start <= 0.5


def test_sequences_leave_out_zero(session, port):
    """After 65535 comes 1."""
    session._sequence = 65534
    for _ in range(2):
        session.request(Command.ADC)
    assert [request.sequence for request in port.requests[-2:]] == [65535, 1]


def test_late_replies_answer_nothing(session, port):
    """A copy of an earlier reply is counted as stray; the right one is taken."""
    port.before = seal(ADC | 0x80, port.requests[-1].sequence, b"\0old") + seal(0x82, 3, b"\0other")
    port.answers[ADC] = lambda _: b"\0new"
    assert session.request(Command.ADC).fields == b"new"
    assert session.arrivals.stray == 2


def test_garbage_before_a_reply_is_counted(session, port):
    """Damaged bytes cost one damaged frame and no reply."""
    port.before = b"\x07garbage\0"
    session.request(Command.ADC)
    assert (session.damaged, session.repeated) == (1, 0)


def test_nothing_but_damage_is_garbled(session, port):
    """Where only damaged frames come, the fault says how many."""
    port.lose = 1000
    for attempt in range(3):
        port.come(b"\x07garbage\0", 0.01 + 0.1 * attempt)
    with pytest.raises(Garbled, match="no reply, but 3 damaged frames"):
        session.request(Command.ADC)


def test_stream_frames_between_request_and_reply_are_kept(session, port):
    """Data of a stream that come before a reply wait in its inbox."""
    inbox = session.arrivals.open_inbox(0)
    port.before = stream_data(0, b"ab") + stream_data(1, b"cd")
    session.request(Command.ADC)
    assert len(inbox.payloads) == 2


def test_stream_frames_that_nobody_opened_are_stray(session, port):
    """Data of a stream from an earlier session are counted and dropped."""
    port.before = stream_data(0, b"ab")
    session.request(Command.ADC)
    assert session.arrivals.stray == 1


@pytest.mark.parametrize("frame", [seal(0x55, 0, b"??"), seal(0x41, 0, b"short"), seal(0x40, 0)])
def test_unknown_and_short_unsolicited_frames_are_stray(session, port, frame):
    """What a later version may send, or is cut short, is counted and otherwise ignored."""
    port.before = frame
    session.request(Command.ADC)
    assert session.arrivals.stray == 1


def test_a_reset_within_a_session_names_its_reason(session, port):
    """A boot notice is a fault of the board that names the boot and the reason; then the board is met again."""
    port.before = boot_notice(42, 4)
    with pytest.raises(DeviceFault, match=r"obc: the board has restarted \(boot 42, independent watchdog\)"):
        session.request(Command.ADC)
    port.answers[IDENTIFY] = lambda _: identity(boots=42)
    session.request(Command.ADC)
    assert port.asked()[-2:] == [IDENTIFY, ADC]
    assert session.starts == 2


def test_a_reset_is_found_while_polling(session, port):
    """A boot notice that comes between requests is told at the next look."""
    port.come(boot_notice(42, 9))
    with pytest.raises(DeviceFault, match="boot 42, hard fault"):
        session.poll()


def test_a_boot_notice_before_the_first_meeting_is_nothing_to_tell(port):
    """A board that was just switched on is no fault."""
    session = ObcSession("obc", port, port.clock)
    port.come(boot_notice(41, 1))
    assert session.board().boots == 41


def test_a_lost_boot_notice_is_found_by_the_boot_counter(session, port):
    """After a silence the board is asked who it is, and another boot counter is a reset."""
    port.lose = 1000
    with pytest.raises(NoReply):
        session.request(Command.ADC)
    port.lose = 0
    port.answers[IDENTIFY] = lambda _: identity(boots=43, reason=99)
    with pytest.raises(DeviceFault, match=r"restarted \(boot 43, unknown reason 99\)"):
        session.request(Command.ADC)
    session.request(Command.ADC)


def test_refusals_name_code_and_detail(session, port):
    """An error reply is Rejected with the code's name."""
    port.answers[ADC] = lambda _: struct.pack("<BH", 4, 0)
    with pytest.raises(BoardRefused, match="refused ADC: PARAMETER, detail 0x0000") as caught:
        session.request(Command.ADC)
    assert caught.value.code == 4
    port.answers[ADC] = lambda _: struct.pack("<BH", 77, 0)
    with pytest.raises(BoardRefused, match="refused ADC: code 77"):
        session.request(Command.ADC)


def test_an_empty_reply_is_garbled(session, port):
    """A reply without a code is nonsense."""
    port.answers[ADC] = lambda _: b""
    with pytest.raises(Garbled, match="an empty reply to ADC"):
        session.request(Command.ADC)


def test_another_major_version_is_another_device(port):
    """A board of another major version is refused, whether IDENTIFY or the frame tells it."""
    session = ObcSession("obc", port, port.clock)
    port.answers[IDENTIFY] = lambda _: identity(major=2)
    with pytest.raises(WrongIdentity, match="speaks version 2 of the protocol, this driver version 1"):
        session.identify()


def test_a_later_minor_version_may_say_more(port):
    """Surplus bytes of a longer reply are ignored."""
    session = ObcSession("obc", port, port.clock)
    port.answers[IDENTIFY] = lambda _: identity(more=b"later fields")
    assert session.identify().name == "hil-obc"


def test_a_cut_identification_is_garbled(port):
    """A reply to IDENTIFY that is too short is told as such."""
    port.answers[IDENTIFY] = lambda _: identity()[:20]
    with pytest.raises(Garbled, match="the reply to IDENTIFY is nonsense: 19 bytes, 43 expected"):
        ObcSession("obc", port, port.clock).identify()
