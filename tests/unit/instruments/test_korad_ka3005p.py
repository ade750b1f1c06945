"""Korad KA3005P: bytes of its protocol, and what is done about bytes that nobody had asked for."""

from __future__ import annotations

import pytest
from scripted import ScriptedPort, late

from hil.clock.virtual import VirtualClock
from hil.instruments.driver import Clamps, Connection
from hil.instruments.korad_ka3005p import KoradKa3005p
from hil.model.bench import Wire
from hil.model.errors import Garbled, NoReply, Refused, Rejected

IDN = (b"*IDN?", late(0.03, b"KORADKA3005PV2.0"))
OFF, ON = (b"STATUS?", late(0.03, b"\x11")), (b"STATUS?", late(0.03, b"\x51"))


def driver(*script):
    """Return a driver on a port that plays this script, its output, and the port."""
    port = ScriptedPort(VirtualClock(), script)
    korad = KoradKa3005p(Connection(device="psu1", clock=port.clock, clamps=Clamps(), port=port))
    return korad, korad.role(Wire(role="supply", instance="charge", instrument="psu1", channel=1)), port


def test_the_constructor_sends_nothing_and_needs_a_port():
    """A driver that was only made has not touched the bench."""
    assert driver()[2].written == []
    with pytest.raises(Refused, match="needs a port"):
        KoradKa3005p(Connection(device="psu1", clock=VirtualClock(), clamps=Clamps()))


def test_settings_are_written_in_their_width_and_read_back():
    """Five characters each, the current first; at least 50 ms lie between any two commands."""
    closed = (b"ISET1?", late(0.03, b"0.700K")), IDN, (b"VSET1:04.20", b""), (b"VSET1?", late(0.03, b"04.20")), IDN
    _, output, port = driver((b"ISET1:0.700", b""), *closed)
    output.configure(4.2, 0.7)
    assert port.done
    assert port.clock.now() > 6 * 0.05


def test_a_state_is_proven_by_two_equal_replies_and_the_identification():
    """Two replies that differ are none; bits that are not reliable may differ."""
    _, output, port = driver(ON, (b"STATUS?", late(0.03, b"\xc5")), IDN)
    assert output.enabled()
    assert port.done
    _, output, _ = driver(ON, OFF, IDN, ON, ON, IDN)
    assert output.enabled()


@pytest.mark.parametrize(
    "first",
    [
        late(0.03, b"04.2"),
        late(0.03, b"04.200"),
        late(0.03, b"4.200"),
        late(0.03, b"04,20"),
        ((0.01, b"0"), (0.03, b"04.20")),
        ((0.03, b"04.20"), (0.07, b"\t")),
    ],
)
def test_a_reply_of_another_width_or_form_is_none(first):
    """It is asked again, after silence and the identification."""
    _, output, port = driver((b"VOUT1?", first), IDN, (b"VOUT1?", late(0.03, b"04.18")), IDN)
    assert output.voltage().value == 4.18
    assert port.done


def test_an_end_that_the_identification_lacks_is_no_end():
    """A reply was asked for before the identification was known; both are asked again."""
    _, output, port = driver((b"VOUT1?", late(0.03, b"04.20\n")), IDN, IDN, (b"VOUT1?", late(0.03, b"04.18")), IDN)
    assert output.voltage().value == 4.18
    assert port.done


@pytest.mark.parametrize("first", [b"04.20\r\n", b"04.20\0", b"04.20\n\n", b"\n04.20"])
def test_another_end_than_that_of_the_identification_is_none(first):
    """It was learnt; the reply may lack it, but not have another."""
    idn = (b"*IDN?", late(0.03, b"KORADKA3005PV2.0\n"))
    replies = ((b"VOUT1?", late(0.03, first)), idn, (b"VOUT1?", late(0.03, b"04.18\n")), idn)
    korad, output, port = driver(idn, *replies, (b"VOUT1?", late(0.03, b"04.19")), idn)
    assert korad.identify().model == "KA3005P"
    assert output.voltage().value == 4.18
    assert output.voltage().value == 4.19
    assert port.done


def test_the_end_of_a_reply_is_no_status():
    """NUL would be a supply that is off; where replies end with it, it is none alone."""
    idn = (b"*IDN?", late(0.03, b"KORADKA3005PV2.0\0"))
    status = (b"STATUS?", late(0.03, b"\x51\0"))
    korad, output, port = driver(idn, (b"STATUS?", late(0.03, b"\0")), idn, status, status, idn)
    assert korad.identify().model == "KA3005P"
    assert output.enabled()
    assert port.done


def test_a_reply_that_took_the_place_of_another_is_found():
    """What should be the identification is the reply that the question should have got."""
    displaced = (b"*IDN?", ((0.02, b"04.20"), (0.03, b"KORADKA3005PV2.0")))
    _, output, port = driver((b"VOUT1?", b"00.00"), displaced, IDN, (b"VOUT1?", late(0.03, b"04.20")), IDN)
    assert output.voltage().value == 4.2
    assert port.done


def test_switching_off_leaves_before_anything_is_said():
    """Bytes that wait are told after the command has left; out of step it is sent all the same."""
    _, output, port = driver((b"OUT0", b""))
    port.come(b"0")
    with pytest.raises(Garbled, match="arrived unsolicited"):
        output.disable()
    assert port.written == [b"OUT0"]
    port.script = [(b"OUT0", b""), IDN, OFF, OFF, IDN]
    output.disable()
    assert port.done


def test_a_setting_waits_until_the_line_is_understood():
    """Unasked bytes before it, and it is not sent; bytes after it are told."""
    _, output, port = driver((b"ISET1:0.700", b"?"))
    port.come(b"0")
    with pytest.raises(Garbled, match="b'0' arrived"):
        output.configure(4.2, 0.7)
    assert port.written == []
    _, output, port = driver((b"ISET1:0.700", b"?"))
    with pytest.raises(Garbled, match=r"b'\?' arrived"):
        output.configure(4.2, 0.7)


def test_a_line_that_is_never_silent_is_a_fault_in_bounded_time():
    """Half a minute of bytes is not read to its end."""
    _, output, port = driver((b"VOUT1?", tuple((0.01 * n, b"0") for n in range(3000))), *[(b"*IDN?", b"")] * 3)
    with pytest.raises((Garbled, NoReply)):
        output.voltage()
    assert port.clock.now() < 29


def test_a_dead_port_is_told():
    """Cable and power are what to look at."""
    _, output, _ = driver(*[(b"VOUT1?", OSError("gone"))], *[(b"*IDN?", OSError("gone"))] * 2)
    with pytest.raises(NoReply, match="the port failed: gone"):
        output.voltage()


def test_off_that_was_lost_is_said_once_more():
    """A supply that says it is still on hears it again, and is believed the second time."""
    off = (b"OUT0", b"")
    _, output, port = driver(off, ON, ON, IDN, off, OFF, OFF, IDN)
    output.disable()
    assert port.done
    _, output, port = driver(off, ON, ON, IDN, off, ON, ON, IDN)
    with pytest.raises(Rejected, match="switched off and is on"):
        output.disable()
    assert port.done
