"""Rigol DP832: bytes of the programming guide, and replies that the identification closes."""

from __future__ import annotations

import pytest
from scripted import ScriptedPort, late

from hil.clock.virtual import VirtualClock
from hil.instruments.driver import Clamps, Connection
from hil.instruments.rigol_dp832 import RigolDp832
from hil.model.bench import Wire
from hil.model.errors import Garbled, NoReply, Refused, Rejected

IDN = (b"*IDN?\n", b"RIGOL TECHNOLOGIES,DP832,DP8C1,00.01.16\n")
NONE = (b":SYST:ERR?\n", b'0,"No error"\n')


def closed(*pairs):
    """Return a script in which the identification follows each question."""
    return [part for pair in pairs for part in ((pair, IDN) if b"?" in pair[0] else (pair,))]


def driver(script, **settings):
    """Return the output of channel 1 on a port that plays this script, and the port."""
    port = ScriptedPort(VirtualClock(), script)
    rigol = RigolDp832(Connection(device="psu1", clock=port.clock, clamps=Clamps(), port=port))
    wire = Wire(role="supply", instance="charge", instrument="psu1", channel=1, settings=settings)
    return rigol.role(wire), port


def test_the_constructor_sends_nothing_and_needs_a_port():
    """A driver that was only made has not touched the bench."""
    assert driver([])[1].written == []
    with pytest.raises(Refused, match="needs a port"):
        RigolDp832(Connection(device="psu1", clock=VirtualClock(), clamps=Clamps()))


def test_protections_come_first_and_each_command_names_its_channel():
    """Level, read-back, switch, read-back; then current and voltage; 15 ms between any two lines."""
    script = closed(
        NONE,
        (b":OUTP:OVP:VAL CH1,4.250\n", b""),
        NONE,
        (b":OUTP:OVP:VAL? CH1\n", b"4.250\n"),
        (b":OUTP:OVP CH1,ON\n", b""),
        NONE,
        (b":OUTP:OVP? CH1\n", b"ON\n"),
        (b":SOUR1:CURR 0.700\n", b""),
        NONE,
        (b":SOUR1:CURR?\n", b"0.7000\n"),
        (b":SOUR1:VOLT 4.200\n", b""),
        NONE,
        (b":SOUR1:VOLT?\n", b"4.200\n"),
    )
    output, port = driver(script, over_voltage="4.25 V")
    output.configure(4.2, 0.7)
    assert port.done
    assert port.clock.now() == pytest.approx(0.015 * (len(script) - 1))


def test_a_protection_that_stays_off_is_rejected():
    """Switched on, it says OFF."""
    script = closed(
        NONE,
        (b":OUTP:OVP:VAL CH1,4.250\n", b""),
        NONE,
        (b":OUTP:OVP:VAL? CH1\n", b"4.250\n"),
        (b":OUTP:OVP CH1,ON\n", b""),
        NONE,
        (b":OUTP:OVP? CH1\n", b"OFF\n"),
    )
    output, _ = driver(script, over_voltage="4.25 V")
    with pytest.raises(Rejected, match="over-voltage protection was switched on and is off"):
        output.configure(4.2, 0.7)


@pytest.mark.parametrize("reply", [b"2\n", b"O\n", b"YES\n", b"\n"])
def test_a_state_is_on_or_off_and_nothing_else(reply):
    """What says neither is asked again."""
    output, port = driver([(b":OUTP? CH1\n", reply), IDN, *closed((b":OUTP? CH1\n", b"ON\n"))])
    assert output.enabled()
    assert port.done


@pytest.mark.parametrize(("reply", "on"), [(b"1\r\n", True), (b"on\n", True), (b" OFF \n", False), (b"+0\n", False)])
def test_a_state_is_spelled_as_the_firmware_does(reply, on):
    """A digit or a word, with blanks and a carriage return or without."""
    output, port = driver(closed((b":OUTP? CH1\n", reply)))
    assert output.enabled() is on
    assert port.done


@pytest.mark.parametrize(("reply", "mode"), [(b"CV\n", "CV"), (b"CC\n", "CC"), (b"UR\n", "unregulated")])
def test_modes(reply, mode):
    """Three words."""
    output, _ = driver(closed((b":OUTP? CH1\n", b"ON\n"), (b":OUTP:MODE? CH1\n", reply)))
    assert output.mode() == mode


@pytest.mark.parametrize(("question", "reply"), [(b":OUTP:MODE? CH1\n", b"2\n"), (b":OUTP? CH1\n", b"2\n")])
def test_nonsense_each_time_is_told(question, reply):
    """After three attempts it is a fault."""
    script = closed((b":OUTP? CH1\n", b"ON\n")) if b"MODE" in question else []
    output, _ = driver([*script, (question, reply), IDN, (question, reply), IDN, (question, reply)])
    with pytest.raises(Garbled, match="expected "):
        output.mode()


def test_a_line_that_took_the_place_of_a_reply_is_found():
    """The true reply stands where the identification should be; after silence it is asked again."""
    displaced = (b"*IDN?\n", ((0.0, b"ON\n"), (0.001, IDN[1])))
    output, port = driver([(b":OUTP? CH1\n", b"OFF\n"), displaced, IDN, *closed((b":OUTP? CH1\n", b"ON\n"))])
    assert output.enabled()
    assert port.done


def test_a_line_that_is_never_silent_is_a_fault_in_bounded_time():
    """Bytes without an end are not read to their end."""
    output, port = driver([(b":OUTP? CH1\n", tuple((0.01 * n, b"?\n") for n in range(3000)))])
    with pytest.raises(Garbled):
        output.enabled()
    assert port.clock.now() < 10


def test_a_port_that_fails_while_it_is_listened_to_is_told():
    """Cable and power are what to look at."""
    output, port = driver([(b":OUTP? CH1\n", late(0.01, b"?\n")), *[IDN] * 3])

    def gone(size=1):
        raise OSError(f"gone before {size} bytes")

    port.read = gone
    with pytest.raises((Garbled, NoReply)):
        output.enabled()
