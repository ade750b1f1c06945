"""The KA3005P's peer against bytes as its published protocol and captures show them."""

from __future__ import annotations

import pytest
from talking import Talk

from hil.simulation.peers.korad_ka3005p import MODEL

EXACT = {"voltage_noise": "0", "current_noise": "0", "load": "10"}


def talk(*faults, **truth):
    """Return a dialogue with a supply that reads without noise."""
    return Talk(MODEL, truth={**EXACT, **truth}, faults=faults, baud=9600)


def said(supply, *commands):
    """Send commands and return what came after each."""
    return [supply.bytes(command) for command in commands]


def test_questions_of_a_supply_at_rest():
    """No reply has an end; widths are five, and one byte for the status."""
    questions = (b"*IDN?", b"VSET1?", b"ISET1?", b"VOUT1?", b"IOUT1?", b"STATUS?")
    assert said(talk(), *questions) == [b"KORADKA3005PV0.0", b"00.00", b"5.000", b"00.00", b"0.000", b"\x11"]


def test_settings_say_nothing():
    """What was set is asked for; the status byte shows the output and how it regulates."""
    supply = talk()
    assert said(supply, b"VSET1:04.20", b"ISET1:0.700", b"OUT1") == [b"", b"", b""]
    assert said(supply, b"VSET1?", b"ISET1?", b"VOUT1?", b"IOUT1?") == [b"04.20", b"0.700", b"04.20", b"0.420"]
    assert supply.bytes(b"STATUS?")[0] & 0x41 == 0x41
    said(supply, b"ISET1:0.200")
    assert supply.bytes(b"STATUS?")[0] & 0x41 == 0x40
    said(supply, b"OUT0")
    assert supply.bytes(b"STATUS?")[0] & 0x40 == 0


@pytest.mark.parametrize(
    "command", [b"VSET1:31.01", b"ISET1:5.101", b"VSET2:01.00", b"VSET1:-1.00", b"out1", b"OUT1\x00?"]
)
def test_nonsense_is_passed_over_in_silence(command):
    """There is no error to ask for."""
    supply = talk()
    assert supply.bytes(command) == b""
    assert said(supply, b"VSET1?", b"ISET1?", b"STATUS?") == [b"00.00", b"5.000", b"\x11"]


def test_a_command_that_comes_too_early_is_lost():
    """Two commands in one breath are none; while one is executed the next is not heard."""
    supply = talk()
    assert supply.bytes(b"VSET1:04.20OUT1") == b""
    assert said(supply, b"VSET1?", b"STATUS?") == [b"00.00", b"\x11"]
    supply.bytes(b"VSET1:04.20", 0.01)
    supply.bytes(b"OUT1")
    assert said(supply, b"VSET1?", b"STATUS?") == [b"04.20", b"\x11"]


def test_a_command_may_come_in_pieces():
    """Until there is silence it is one command."""
    supply = talk()
    assert supply.bytes(b"VSE", 0.001) == b""
    assert supply.bytes(b"T1?") == b"00.00"


def test_a_protection_trips_at_the_voltage_that_is_set():
    """An output half a volt too high goes off, silently, and nothing keeps it from being switched on again."""
    supply = talk(output_voltage_offset="0.5")
    said(supply, b"VSET1:04.20", b"OUT1")
    assert supply.bytes(b"STATUS?")[0] & 0x60 == 0x40
    said(supply, b"OVP1")
    assert supply.bytes(b"STATUS?")[0] & 0x60 == 0x20
    said(supply, b"OVP0", b"OUT1")
    assert supply.bytes(b"STATUS?")[0] & 0x60 == 0x40


def test_a_protection_trips_when_the_current_is_limited():
    """OCP1 makes a fuse of the current limit."""
    supply = talk()
    said(supply, b"VSET1:04.20", b"ISET1:0.200", b"OCP1", b"OUT1")
    assert supply.bytes(b"STATUS?")[0] & 0x60 == 0x20
    said(supply, b"OCP0")
    assert supply.bytes(b"STATUS?")[0] & 0x60 == 0


def test_the_stray_sixth_byte():
    """Some firmware sends one byte more after ISET1?, and after nothing else."""
    supply = talk({"kind": "stray-byte"})
    assert said(supply, b"ISET1?", b"VSET1?") == [b"5.000K", b"00.00"]


def test_an_output_that_refuses_to_go_off():
    """It stays on, and says so or not."""
    for says, bit in (("on", 0x40), ("off", 0)):
        supply = talk({"kind": "refuse-off", "says": says})
        said(supply, b"VSET1:04.20", b"OUT1", b"OUT0")
        assert supply.bytes(b"STATUS?")[0] & 0x40 == bit
        assert supply.bytes(b"VOUT1?") == b"04.20"


def test_another_identity():
    """A unit of another name, by its truth or by a fault, is as simulated as before."""
    assert talk(identity="TENMA 72-2540 V2.0").bytes(b"*IDN?") == b"TENMA 72-2540 V0.0"
    assert talk({"kind": "identity", "value": "TENMA 72-2535 V2.0"}).bytes(b"*IDN?") == b"TENMA 72-2535 V0.0"


def test_it_goes_on_after_a_restore():
    """Settings, half a command, and one that is being executed come back."""
    for half, rest in ((b"VSE", b"T1?"), (b"VSET1?", b"")):
        first, second = talk(), talk()
        said(first, b"VSET1:04.20", b"OVP1", b"OUT1")
        first.bytes(half, 0.001 if rest else 0.008)
        second.clock.wait_until(first.clock.now_ns())
        second.peer.restore(first.peer.state())
        assert second.bytes(rest) == b"04.20"
        assert second.bytes(b"STATUS?")[0] & 0x60 == 0x60
