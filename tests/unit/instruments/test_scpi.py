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
    as_quantity,
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


@pytest.mark.parametrize("reply", ["4.200V", "4.2 V", "+4.2", "0004.2V"])
def test_a_quantity_may_carry_its_unit(reply):
    """What it carries is the unit that was asked for."""
    assert as_quantity("V")(reply) == 4.2


@pytest.mark.parametrize("reply", ["4200mV", "4.2A", "V", "4.2VV", "4.2v", ""])
def test_another_unit_is_no_quantity(reply):
    """A prefix is a thousand times too much, and amperes are no volts."""
    with pytest.raises(ValueError, match="a number"):
        as_quantity("V")(reply)


@pytest.mark.parametrize(("reply", "on"), [("1", True), ("+1", True), ("ON", True), ("on", True), ("+0", False)])
def test_a_switch_is_a_digit_or_a_word(reply, on):
    """Each firmware has its own."""
    assert as_switch(reply) is on
    assert as_switch({"1": "0", "+1": "0", "ON": "OFF", "on": "off", "+0": "1"}[reply]) is not on


@pytest.mark.parametrize(
    ("parse", "reply"),
    [
        (as_switch, "YES"),
        (as_switch, "01"),
        (as_switch, "ONOFF"),
        (as_switch, "-0"),
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


@pytest.mark.parametrize("text", ['+0,"No error"', '0,"No error"', "0 No Error", "0  No Error", "+0, No error"])
def test_an_empty_error_queue_is_known_in_any_spelling(text):
    """With quotes or without, with a comma or a blank."""
    scpi, port = session((b"SYST:ERR?\n", text.encode() + b"\r\n"))
    assert scpi.errors() == ()
    assert port.done


@pytest.mark.parametrize("text", ["0", "No error", '0"No error"', "0,", '0,"No error', "0No error"])
def test_what_does_not_say_that_there_is_no_error_is_nonsense(text):
    """A number alone may be any other reply."""
    scpi, _ = session(*[(b"SYST:ERR?\n", text.encode() + b"\n"), (b"*IDN?\n", IDN)] * 3)
    with pytest.raises(Garbled, match="a number and a text"):
        scpi.errors()


def test_an_error_without_quotes_is_told():
    """Its number counts, not how its text stands."""
    scpi, _ = session(
        (b"SYST:ERR?\n", NONE),
        (b"VOLT 99\n", b""),
        (b"SYST:ERR?\n", b"11 Value out of range\n"),
        (b"SYST:ERR?\n", NONE),
    )
    with pytest.raises(Rejected, match='`VOLT 99` was answered with \\+11 "Value out of range"'):
        scpi.setting("VOLT 99")


def test_a_banner_before_the_first_identification_is_no_fault():
    """It is thrown away; the same line after that is one."""
    scpi, port = session((b"*IDN?\n", IDN))
    port.come(b"Welcome to E36312A\r\n")
    assert scpi.identification()[1] == "E36312A"
    assert scpi.discarded == 20
    port.come(b"Welcome to E36312A\r\n")
    with pytest.raises(Garbled, match="arrived unsolicited"):
        scpi.identification()


def test_what_echoes_is_asked_and_told_as_anything_else():
    """Lines come back before their replies; those of settings are taken, too."""
    none = b"SYST:ERR?\r\n" + NONE
    scpi, port = session(
        (b"VOLT?\n", b"VOLT?\r\n+4.2\r\n"),
        (b"SYST:ERR?\n", none),
        (b"OUTP ON\n", b"OUTP ON\r\n"),
        (b"SYST:ERR?\n", none),
    )
    assert scpi.query("VOLT?", as_number) == 4.2
    scpi.setting("OUTP ON")
    assert port.done


def test_a_setting_that_comes_back_otherwise_is_garbled():
    """What the instrument took is not what was sent."""
    none = b"SYST:ERR?\r\n" + NONE
    scpi, _ = session((b"SYST:ERR?\n", none), (b"OUTP OFF\n", b"OUTP ON\r\n"))
    with pytest.raises(Garbled, match="asked `OUTP OFF`, expected its echo, got 'OUTP ON'"):
        scpi.setting("OUTP OFF")


def test_a_fifth_field_belongs_to_the_firmware_where_the_dialect_has_one():
    """Four are the standard's."""
    reply = (b"*IDN?\n", b"Siglent Technologies,SPD3303X-E,SPD3XIDQ5R4761,1.01.01.02.07R2,V3.0\n")
    scpi, _ = session(reply, fields=5)
    assert scpi.identification()[3] == "1.01.01.02.07R2 V3.0"
    scpi, _ = session(*[reply] * 13)
    with pytest.raises(Garbled, match="manufacturer, model"):
        scpi.identification()


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
