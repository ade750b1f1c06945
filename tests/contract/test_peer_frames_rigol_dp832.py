"""The DP832's peer against lines as its programming guide and captures show them."""

from __future__ import annotations

import re

import pytest
from talking import Talk

from hil.simulation.peers.rigol_dp832 import MODEL

EXACT = {"voltage_noise": "0", "current_noise": "0", "load": "10"}


def talk(*faults, **truth):
    """Return a dialogue with a supply that reads without noise."""
    return Talk(MODEL, truth={**EXACT, **truth}, faults=faults)


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("*IDN?", r"RIGOL TECHNOLOGIES,DP832,SIM-DP8C000000001,00\.01\.16"),
        (":SYST:ERR?", '0,"No error"'),
        (":INST:NSEL?", "1"),
        (":SOUR1:VOLT?", r"0\.000"),
        (":SOUR1:CURR?", r"3\.0000"),
        (":OUTP? CH1", "OFF"),
        (":OUTP:MODE? CH1", "UR"),
        (":OUTP:CVCC? CH1", "UR"),
        (":OUTP:OVP? CH1", "OFF"),
        (":OUTP:OVP:VAL? CH1", r"33\.000"),
        (":OUTP:OVP:QUES? CH1", "NO"),
        (":OUTP:OCP? CH3", "OFF"),
        (":OUTP:OCP:VAL? CH3", r"3\.3000"),
        (":OUTP:OCP:QUES? CH3", "NO"),
        (":MEAS:VOLT? CH1", r"0\.0000"),
        (":MEAS:CURR? CH1", r"0\.0000"),
        (":MEAS:ALL? CH1", r"0\.0000,0\.0000,0\.000"),
        (":SOUR1:VOLT 4.2", ""),
        (":INST:NSEL 1;:SOUR:VOLT 4.2", ""),
        (":APPL CH1,5,0.1", ""),
        (":OUTP CH1,ON", ""),
        (":OUTP:OVP:VAL CH1,4.25", ""),
        (":OUTP:OVP CH1,ON", ""),
        (":OUTP:OVP:CLEAR CH1", ""),
        (":OUTP:OCP:VAL CH1,1", ""),
    ],
)
def test_line_and_answer(line, answer):
    """A line of the dialect gets an answer of the published form, and leaves no error."""
    supply = talk()
    assert re.fullmatch(answer, supply.line(line))
    assert supply.line(":SYST:ERR?") == '0,"No error"'


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("FOO:BAR?", -113),
        (":SOUR4:VOLT 1", -113),
        (":SOUR1:VOLT 32.1", -222),
        (":SOUR3:VOLT 5.4", -222),
        (":SOUR1:VOLT", -109),
        (":SOUR1:VOLT? 1", -108),
        (":SOUR1:VOLT high", -104),
        (":APPL CH1,5", -109),
        (":APPL CH1,5,1,1", -108),
        (":OUTP CH9,ON", -224),
        (":OUTP CH1,MAYBE", -224),
        (":OUTP CH1,ON,ON", -108),
        (":OUTP? CH1,ON", -108),
        (":OUTP:OVP:CLEAR CH1,1", -108),
        (":OUTP:OVP:VAL CH1,34", -222),
        (":INST:NSEL 4", -224),
        (":INST:NSEL", -109),
        ("*RST 1", -108),
    ],
)
def test_errors_go_to_the_queue_without_an_answer(line, code):
    """A line that cannot be executed answers nothing and leaves one error."""
    supply = talk()
    assert supply.line(line) == ""
    assert supply.line(":SYST:ERR?").startswith(f"{code},")
    assert supply.line(":SYST:ERR?") == '0,"No error"'


def test_the_selected_channel_is_state():
    """A command without a channel goes to the one that was selected last."""
    supply = talk()
    for line in (":INST CH2", ":SOUR:VOLT 3.3", ":VOLT 3.4", ":OUTP ON"):
        assert supply.line(line) == ""
    assert supply.line(":SOUR2:VOLT?") == "3.400"
    assert (supply.line(":OUTP? CH2"), supply.line(":OUTP? CH1"), supply.line(":OUTP?")) == ("ON", "OFF", "ON")


def test_it_measures_what_hangs_on_it():
    """5 V on 10 ohms, first regulated by voltage, then by current; one bound by name."""
    supply = talk()
    supply.line(":APPL CH1,5,MAX")
    supply.line(":OUTP CH1,ON")
    assert supply.line(":MEAS:ALL? CH1") == "5.0000,0.5000,2.500"
    assert (supply.line(":MEAS:POWE? CH1"), supply.line(":OUTP:MODE? CH1")) == ("2.500", "CV")
    supply.line(":SOUR1:CURR 0.2")
    assert (supply.line(":MEAS:VOLT? CH1"), supply.line(":OUTP:MODE? CH1")) == ("2.0000", "CC")
    supply.line("*RST")
    assert (supply.line(":OUTP? CH1"), supply.line(":SOUR1:VOLT?")) == ("OFF", "0.000")


@pytest.mark.parametrize(("protection", "level"), [("OVP", "4"), ("OCP", "0.4")])
def test_a_protection_acts_only_while_it_is_on(protection, level):
    """Its level alone does nothing; switched on it trips, and keeps the output off until it is cleared."""
    supply = talk()
    supply.line(":SOUR1:VOLT 5")
    supply.line(f":OUTP:{protection}:VAL CH1,{level}")
    supply.line(":OUTP CH1,ON")
    assert supply.line(":OUTP? CH1") == "ON"
    supply.line(f":OUTP:{protection} CH1,ON")
    assert supply.line(":OUTP? CH1") == "OFF"
    assert (supply.line(f":OUTP:{protection}:QUES? CH1"), supply.line(f":OUTP:{protection}? CH1")) == ("YES", "ON")
    supply.line(":OUTP CH1,ON")
    assert supply.line(":SYST:ERR?").startswith("-221,")
    supply.line(f":OUTP:{protection}:CLEAR CH1")
    assert supply.line(f":OUTP:{protection}:ALAR? CH1") == "NO"


def test_a_line_that_comes_too_early_is_lost():
    """The pause between lines is ten milliseconds."""
    supply = talk()
    assert supply.bytes(b"*IDN?\n:OUTP? CH1\n") == b"RIGOL TECHNOLOGIES,DP832,SIM-DP8C000000001,00.01.16\n"
    supply.bytes(b":SOUR1:VOLT 5\n", 0.012)
    assert supply.bytes(b":SOUR1:VOLT?\n") == b""
    assert supply.line(":SOUR1:VOLT?") == "5.000"


def test_it_goes_on_after_a_restore():
    """Settings, selection, errors, and the line that is being worked on come back."""
    first, second = talk(), talk()
    for line in (":INST CH3", ":SOUR:VOLT 5", ":OUTP:OVP CH3,ON", ":OUTP CH3,ON", "FOO"):
        first.line(line)
    first.bytes(b":MEAS:VOLT? CH3\n:", 0.002)
    second.clock.wait_until(first.clock.now_ns())
    second.peer.restore(first.peer.state())
    assert second.bytes(b"") == b"5.0000\n"
    assert second.peer.state()["channels"] == first.peer.state()["channels"]
    assert second.bytes(b"SYST:ERR?\n").startswith(b"-113,")


def test_another_identity():
    """Somebody else answers."""
    assert talk({"kind": "identity", "value": "RIGOL TECHNOLOGIES,DP811,X,1"}).line("*IDN?").split(",")[1] == "DP811"
