"""Peers of supplies against lines as programming guides and public captures show them, one table for each."""

from __future__ import annotations

import re

import pytest
from talking import Talk

from hil.simulation.peers.keysight_single import E3632A, E36103B
from hil.simulation.peers.rohde_schwarz_hmp import HMP as ROHDE_SCHWARZ
from hil.simulation.peers.rohde_schwarz_hmp import NGE100
from hil.simulation.peers.siglent_spd3303x import MODEL as SIGLENT

NR3 = r"[+-]\d\.\d{8}E[+-]\d{2}"
E36100 = {
    "*IDN?": r"Keysight Technologies,E36103B,SIM-MY61000001,1\.0\.2-1\.02",
    "SYST:ERR?": r'\+0,"No error"',
    "OUTP?": "0",
    "VOLT?": NR3,
    "VOLT 4.2": "",
    "VOLT:PROT 4.25": "",
    "VOLT:PROT?": r"\+4\.25000000E\+00",
    "VOLT:PROT:TRIP?": "0",
    "STAT:OPER:COND?": "0",
    "STAT:QUES:COND?": "0",
    "OUTP ON;:OUTP?;:STAT:OPER:COND?": "1;256",
    "CURR 0.1;:STAT:OPER:COND?": "1024",
    "MEAS:CURR?": NR3,
    "OUTP OFF": "",
}
E3632 = {
    "*IDN?": r"HEWLETT-PACKARD,E3632A,SIM-0,1\.1-5\.0-1\.0",
    "VOLT:PROT:STAT?": "1",
    "VOLT 4.2;:CURR 1;:OUTP ON;:STAT:QUES:COND?": "2",
    "CURR 0.1;:STAT:QUES:COND?": "1",
    "VOLT:PROT:STAT ON": "",
    "VOLT:PROT:TRIP?": "0",
    "OUTP OFF;:STAT:QUES:COND?": "0",
}
SPD3303X = {
    "*IDN?": r"Siglent Technologies,SPD3303X-E,SIM-SPD3X000000001,1\.01\.01\.02\.07R2,V3\.0",
    "SYST:ERR?": "0 No Error",
    "SYST:STAT?": "0x4",
    "INST?": "CH1",
    "CH1:VOLT 5": "",
    "CH1:CURR 1": "",
    "CH1:VOLT?": r"5\.000",
    "OUTP CH1,ON": "",
    "OUTPUT CH2,ON": "",
    "SYSTEM:STATUS?": "0x34",
    "MEAS:VOLT? CH1": r"5\.000",
    "MEASure:CURRent? CH1": r"0\.500",
    "MEASure:POWEr? CH1": r"2\.500",
    "CH1:CURR 0.1": "",
    "SYST:STAT?;:OUTP CH1,OFF": "0x35",
    "OUTPut:TRACK 1;:SYST:STAT?": "0x2c",
}
HMP4040 = {
    "*IDN?": "ROHDE&SCHWARZ,HMP4040,SIM-102416,HW50020003/SW2.62",
    "SYST:ERR?": '0,"No error"',
    "INST OUT2": "",
    "INST?": "OUTP2",
    "INST:NSEL 1": "",
    "INST:NSEL?": "1",
    "VOLT 5": "",
    "VOLT?": r"5\.000",
    "CURR 1": "",
    "CURR?": r"1\.0000",
    "OUTP:SEL 1": "",
    "OUTP:SEL?": "1",
    "OUTP:GEN?": "0",
    "MEAS:VOLT?": r"0\.000",
    "OUTP:GEN 1": "",
    "MEAS:CURR?": r"0\.5000",
    "STAT:QUES:INST:ISUM1:COND?": "2",
    "FUSE ON;FUSE?": "1",
    "INST OUT2;VOLT?": r"0\.000",
    "INST OUT1;FUSE:TRIP?": "0",
    "OUTP:SEL 0;GEN?": "1",
}
NGE103B = {
    "*IDN?": r"Rohde&Schwarz,NGE103B,SIM-5601\.3800k03/101863,1\.54",
    "INST OUT1;VOLT:PROT:LEV 4.25": "",
    "VOLT:PROT:LEV?": r"4\.250",
    "VOLT:PROT?": "0",
    "VOLT 5;OUTP:GEN ON;SEL ON;SEL?": "1",
    "VOLT:PROT:STAT ON": "",
    "VOLT:PROT:TRIP?;:OUTP:SEL?": "1;0",
    "VOLT:PROT:CLE": "",
}
GUIDES = {"E36103B": (E36103B, E36100), "E3632A": (E3632A, E3632), "SPD3303X": (SIGLENT, SPD3303X)} | {
    "HMP4040": (ROHDE_SCHWARZ, HMP4040),
    "NGE103B": (NGE100, NGE103B),
}
NO_ERROR = {"SPD3303X": "0 No Error", "HMP4040": '0,"No error"', "NGE103B": '0,"No error"'}


def talk(model, **truth):
    """Return a dialogue with a supply that reads without noise."""
    return Talk(model, truth={"voltage_noise": "0", "current_noise": "0", "load": "10", **truth})


def line(supply, text):
    """Send one line after a pause, and return the answer without its end."""
    supply.clock.sleep(0.02)
    return supply.bytes(text.encode() + b"\n").decode().removesuffix("\n").removesuffix("\r")


@pytest.mark.parametrize("name", GUIDES)
def test_lines_and_answers_in_turn(name):
    """Every line of the table gets an answer of the published form, and leaves no error."""
    model, guide = GUIDES[name]
    supply = talk(model)
    for text, answer in guide.items():
        said = line(supply, text)
        assert re.fullmatch(answer, said), (text, said)
        assert line(supply, "SYST:ERR?") == NO_ERROR.get(name, '+0,"No error"'), text


@pytest.mark.parametrize(
    ("name", "text", "code"),
    [
        ("E36103B", "OUTP ON,(@1)", "-108"),
        ("E36103B", "VOLT 21", "-222"),
        ("E3632A", "INST:NSEL 1", "-113"),
        ("SPD3303X", "OUTP? CH1", "-113"),
        ("SPD3303X", "OUTP CH3,ON", "-224"),
        ("SPD3303X", "CH1:VOLT 33", "-222"),
        ("SPD3303X", "CH1:VOLT:PROT 4.25", "-113"),
        ("HMP4040", "INST OUT5", "-224"),
        ("HMP4040", "VOLT 33", "-222"),
        ("HMP4040", "OUTP:SEL MAYBE", "-224"),
    ],
)
def test_what_it_does_not_know_is_an_error(name, text, code):
    """It answers nothing, and changes nothing."""
    supply = talk(GUIDES[name][0])
    assert line(supply, text) == ""
    assert line(supply, "SYST:ERR?").startswith(code)


def test_lines_of_the_older_series_end_with_a_carriage_return():
    """As they were captured from an E3631A."""
    assert talk(E3632A).bytes(b"*IDN?\n").endswith(b"1.0\r\n")


def test_the_master_switch_brings_every_selected_channel_on():
    """Also one that was selected long before."""
    supply = talk(ROHDE_SCHWARZ)
    for text in ("INST OUT2;VOLT 5;OUTP:SEL ON", "INST OUT1;VOLT 5;OUTP:GEN ON"):
        assert line(supply, text) == ""
    outputs = supply.peer.state()["channels"]
    assert [number for number, output in outputs.items() if output["on"]] == ["2"]


def test_a_fuse_that_tripped_deselects_its_channel():
    """It cannot be selected again, and the others stay on."""
    supply = talk(ROHDE_SCHWARZ)
    for channel in (1, 2):
        line(supply, f"INST OUT{channel};VOLT 5;OUTP:SEL ON;:OUTP:GEN ON")
    assert line(supply, "INST OUT1;CURR 0.1;FUSE ON") == ""
    assert line(supply, "FUSE:TRIP?;:OUTP:SEL?;:INST OUT2;OUTP:SEL?") == "1;0;1"
    line(supply, "INST OUT1;OUTP:SEL ON")
    assert line(supply, "SYST:ERR?").startswith("-221,")


@pytest.mark.parametrize(
    ("model", "lines"),
    [
        (ROHDE_SCHWARZ, ("INST OUT2;VOLT 5;CURR 0.2;FUSE ON;OUTP:SEL ON;:OUTP:GEN ON", "INST OUT3;OUTP:SEL ON", "FOO")),
        (SIGLENT, ("CH2:VOLT 5", "OUTP CH2,ON", "OUTP:TRACK 2", "INST CH2", "FOO")),
    ],
)
def test_it_goes_on_after_a_restore(model, lines):
    """Selection, switches, coupling, fuses and errors come back."""
    first, second = talk(model), talk(model)
    for text in lines:
        line(first, text)
    second.clock.wait_until(first.clock.now_ns())
    second.peer.restore(first.peer.state())
    assert second.peer.state() == first.peer.state()
    for text in ("INST?", "SYST:ERR?", "SYST:STAT?", "INST:NSEL 1;:OUTP:SEL?;:OUTP:GEN?", "MEAS:VOLT? CH2"):
        assert line(second, text) == line(first, text)
