"""SCPI sessions: strict replies, bounded exchanges, and no reply taken for another's."""

from __future__ import annotations

import math

import pytest
from scripted import ScriptedPort, late

from hil.clock.virtual import VirtualClock
from hil.instruments.scpi_session import (
    ScpiSession,
    as_identification,
    as_number,
    as_register,
    as_switch,
    as_text,
)
from hil.model.errors import Garbled, NoReply, Rejected

IDN = b"Keysight Technologies,E36312A,MY59002391,2.1.0-1.0.4-1.12\n"
NONE = b'+0,"No error"\n'


def session(*script, **options):
    """Return a session on a port that plays this script, and the port."""
    port = ScriptedPort(VirtualClock(), script)
    return ScpiSession("psu1", port, **options), port


@pytest.mark.parametrize(
    ("reply", "value"),
    [("+4.20000000E+00", 4.2), ("-1.5e-3", -0.0015), ("0", 0.0), (".5", 0.5), ("5.", 5.0), ("+7E1", 70.0)],
)
def test_numbers_are_read_as_the_instrument_writes_them(reply, value):
    """Every SCPI form of a decimal number is accepted."""
    assert as_number(reply) == value


@pytest.mark.parametrize("reply", ["9.91E37", "+9.91000000E+37", "9.9E37", "-9.90000000E+37"])
def test_what_scpi_calls_no_number_is_nan(reply):
    """SCPI's not-a-number and both infinities are NaN, which passes no check."""
    assert math.isnan(as_number(reply))


@pytest.mark.parametrize("reply", ["", "4,2", "4.2 V", "nan", "inf", "0x10", "1_000", " 4.2", "4.2\r", "+", "٣"])
def test_what_is_no_decimal_number_is_refused(reply):
    """Python's float accepts more than the protocol allows; the session does not."""
    with pytest.raises(ValueError, match="a number"):
        as_number(reply)


@pytest.mark.parametrize(
    ("parse", "reply"),
    [
        (as_switch, "ON"),
        (as_switch, "01"),
        (as_register, "-1"),
        (as_register, "2.0"),
        (as_text, ""),
        (as_text, "a\x00b"),
        (as_text, "\\xff"),
        (as_identification, "Keysight Technologies,E36312A,MY59002391"),
        (as_identification, "a,b,c,d,e"),
        (as_identification, ",,,"),
        (as_identification, "a,b,c,d;0"),
    ],
)
def test_replies_of_the_wrong_form_are_refused(parse, reply):
    """Each parser accepts its own form only."""
    with pytest.raises(ValueError, match=r"\w"):
        parse(reply)


def test_a_query_returns_what_was_answered():
    """One line out, one line in."""
    scpi, port = session((b"VOLT? (@1)\n", b"+4.20000000E+00\n"))
    assert scpi.query("VOLT? (@1)", as_number) == 4.2
    assert port.done


def test_another_terminator_ends_lines_both_ways():
    """The terminator is explicit, and never guessed."""
    scpi, _ = session((b"VOLT?\r\n", b"1.0\r\n"), terminator=b"\r\n")
    assert scpi.query("VOLT?", as_number) == 1.0


def test_a_dead_instrument_is_no_reply_after_bounded_exchanges():
    """Each exchange ends within half a second, and the message names the question."""
    scpi, port = session((b"VOLT? (@1)\n", b""), (b"*IDN?\n", b""), (b"*IDN?\n", b""))
    with pytest.raises(NoReply, match=r"psu1: asked `VOLT\? \(@1\)`, nothing came within 0.5 s; check"):
        scpi.query("VOLT? (@1)", as_number)
    assert port.done
    assert port.longest_wait == 0.5
    assert port.clock.now() == 1.5


def test_a_timeout_over_half_a_second_is_cut():
    """Nobody can make an exchange longer than the house allows."""
    scpi, port = session((b"VOLT?\n", b"1\n"), timeout=60.0)
    scpi.query("VOLT?", as_number)
    assert port.longest_wait == 0.5


def test_half_a_line_is_no_reply_and_is_shown():
    """A reply without its terminator never becomes a value."""
    scpi, _ = session((b"VOLT?\n", b"+4.2"), (b"*IDN?\n", b""), (b"*IDN?\n", b""))
    with pytest.raises(NoReply, match="only b'\\+4.2' came"):
        scpi.query("VOLT?", as_number)


def test_a_late_reply_answers_no_later_question():
    """A voltage that comes 0.6 s late is thrown away, and is not taken for the current."""
    scpi, port = session(
        (b"VOLT?\n", late(0.6, b"+4.2\n")),
        (b"*IDN?\n", late(0.2, IDN)),
        (b"VOLT?\n", b"+4.3\n"),
        (b"CURR?\n", b"+0.7\n"),
    )
    assert scpi.query("VOLT?", as_number) == 4.3
    assert scpi.query("CURR?", as_number) == 0.7
    assert scpi.discarded == len(b"+4.2\n")
    assert port.done


def test_a_reply_that_is_always_late_is_no_reply():
    """An instrument that needs longer than the timeout each time never gets a value through."""
    voltage, identity = (b"VOLT?\n", late(0.6, b"+4.2\n")), (b"*IDN?\n", late(0.6, IDN))
    scpi, _ = session(voltage, identity, voltage, identity, voltage)
    with pytest.raises(NoReply):
        scpi.query("VOLT?", as_number)


def test_nonsense_is_garbled_after_three_attempts():
    """What was asked, what was expected and what came is in the message."""
    scpi, port = session(
        (b"VOLT?\n", b"+4.x\n"), (b"*IDN?\n", IDN), (b"VOLT?\n", b"\xff\xfe\n"), (b"*IDN?\n", IDN), (b"VOLT?\n", b"\n")
    )
    with pytest.raises(Garbled, match=r"asked `VOLT\?`, expected a number, got '\+4.x'"):
        scpi.query("VOLT?", as_number)
    assert port.done


def test_nonsense_once_is_asked_again():
    """One disturbed reply does not end a run."""
    scpi, _ = session((b"VOLT?\n", b"+4#2\n"), (b"*IDN?\n", IDN), (b"VOLT?\n", b"+4.2\n"))
    assert scpi.query("VOLT?", as_number) == 4.2


def test_what_came_before_the_question_is_a_fault_and_no_answer():
    """It may be the reply that another question should have got; nothing is asked, and then all is well again."""
    scpi, port = session((b"*IDN?\n", IDN), (b"VOLT?\n", b"+4.2\n"))
    port.come(b"+9.9\n")
    with pytest.raises(Garbled, match=r"psu1: b'\+9.9\\n' arrived unsolicited; check what else"):
        scpi.query("VOLT?", as_number)
    assert port.written == []
    assert scpi.discarded == 5
    assert scpi.query("VOLT?", as_number) == 4.2


def test_an_urgent_setting_leaves_before_stray_input_is_told():
    """Switching off comes first, whatever waits."""
    scpi, port = session((b"OUTP OFF\n", b""))
    port.come(b"0\n")
    with pytest.raises(Garbled, match="arrived unsolicited"):
        scpi.setting("OUTP OFF", urgent=True)
    assert port.written == [b"OUTP OFF\n"]


def test_a_framed_reply_begins_with_the_identification():
    """One line asks both; a line without the identification is no reply, and neither is another instrument's."""
    ours, other = IDN.strip(), IDN.strip().replace(b"MY5", b"MY6")
    ask = b"*IDN?;:VOLT?\n"
    for wrong in (b"+9.9\n", other + b";+9.9\n", ours + b"\n"):
        scpi, port = session((b"*IDN?\n", IDN), (ask, wrong), (b"*IDN?\n", IDN), (ask, ours + b";+4.2\n"), framed=True)
        assert scpi.identification()[1] == "E36312A"
        assert scpi.query("VOLT?", as_number) == 4.2
        assert port.done


def test_a_late_framed_reply_does_not_bring_the_session_into_step():
    """It begins with the identification, but it is no reply to `*IDN?`."""
    ask, reply = b"*IDN?;:VOLT?\n", IDN.strip()
    scpi, port = session(
        (ask, late(0.6, reply + b";+9.9\n")), (b"*IDN?\n", late(0.2, IDN)), (ask, reply + b";+4.2\n"), framed=True
    )
    assert scpi.query("VOLT?", as_number) == 4.2
    assert port.done


def test_a_line_that_never_falls_silent_is_garbled():
    """An instrument that chatters cannot be brought into step."""
    chatter = b"tick\n" * 8
    scpi, _ = session((b"VOLT?\n", chatter), (b"*IDN?\n", chatter), (b"*IDN?\n", chatter))
    with pytest.raises(Garbled, match="expected a number, got 'tick'"):
        scpi.query("VOLT?", as_number)


def test_a_setting_is_sent_once_and_asks_the_error_queue():
    """The queue is emptied before the first setting, and after each."""
    scpi, port = session(
        (b"SYST:ERR?\n", b'-113,"Undefined header"\n'),
        (b"SYST:ERR?\n", NONE),
        (b"VOLT 4.2\n", b""),
        (b"SYST:ERR?\n", NONE),
        (b"CURR 0.7\n", b""),
        (b"SYST:ERR?\n", NONE),
    )
    scpi.setting("VOLT 4.2")
    scpi.setting("CURR 0.7")
    assert port.done


def test_every_queued_error_is_in_the_rejection():
    """All entries are taken out, so that the next setting starts with an empty queue."""
    scpi, port = session(
        (b"SYST:ERR?\n", NONE),
        (b"VOLT 99\n", b""),
        (b"SYST:ERR?\n", b'-222,"Data out of range"\n'),
        (b"SYST:ERR?\n", b'-221,"Settings conflict"\n'),
        (b"SYST:ERR?\n", NONE),
    )
    with pytest.raises(
        Rejected, match='`VOLT 99` was answered with -222 "Data out of range"; -221 "Settings conflict"'
    ):
        scpi.setting("VOLT 99")
    assert port.done


def test_a_setting_without_an_answer_from_the_queue_is_not_repeated():
    """When the queue does not answer, nobody knows what became of the setting: NoReply, sent once."""
    scpi, port = session(
        (b"SYST:ERR?\n", NONE), (b"OUTP ON\n", b""), (b"SYST:ERR?\n", b""), (b"*IDN?\n", b""), (b"*IDN?\n", b"")
    )
    with pytest.raises(NoReply):
        scpi.setting("OUTP ON")
    assert port.written.count(b"OUTP ON\n") == 1


def test_an_urgent_setting_leaves_before_anything_is_asked():
    """Switching off does not wait for a dialogue that is out of step."""
    scpi, port = session(
        (b"VOLT?\n", b""),
        (b"*IDN?\n", b""),
        (b"*IDN?\n", b""),
        (b"OUTP OFF\n", b""),
        (b"*IDN?\n", IDN),
        (b"SYST:ERR?\n", b'-410,"Query INTERRUPTED"\n'),
        (b"SYST:ERR?\n", NONE),
    )
    with pytest.raises(NoReply):
        scpi.query("VOLT?", as_number)
    scpi.setting("OUTP OFF", urgent=True)
    assert port.done


def test_an_error_queue_without_an_end_is_garbled():
    """A queue that never empties does not hang the bench."""
    scpi, _ = session(*[(b"SYST:ERR?\n", b'-350,"Queue overflow"\n')] * 32)
    with pytest.raises(Garbled, match="32 errors without an end"):
        scpi.errors()


def test_a_port_that_fails_is_no_reply():
    """An unplugged cable is a fault of the bench, not a traceback."""
    gone = OSError(5, "Input/output error")
    scpi, _ = session((b"VOLT?\n", gone), (b"*IDN?\n", gone), (b"*IDN?\n", gone))
    with pytest.raises(NoReply, match="the port failed at `VOLT\\?`"):
        scpi.query("VOLT?", as_number)
