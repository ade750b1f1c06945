"""The supply's peer against lines as the instrument's guide and captures show them."""

from __future__ import annotations

import re

import pytest
from twin import Twin

_NR3 = r"[+-]\d\.\d{8}E[+-]\d{2}"


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("*IDN?", r"Keysight Technologies,E36312A,SIM-MY59002391,2\.1\.0-1\.0\.4-1\.12"),
        ("SYST:ERR?", r'\+0,"No error"'),
        ("OUTP? (@1)", "0"),
        ("OUTP? (@1,2)", "0,0"),
        ("VOLT? (@1)", _NR3),
        ("CURR? (@1:3)", f"{_NR3},{_NR3},{_NR3}"),
        ("MEAS:VOLT? (@1)", _NR3),
        ("MEAS:CURR? (@2)", _NR3),
        ("VOLT:PROT:TRIP? (@2)", "0"),
        ("CURR:PROT:STAT? (@2)", "0"),
        ("STAT:QUES:INST:ISUM1:COND?", "0"),
        ("*OPC?", "1"),
        ("VOLT 4.2,(@1)", ""),
        ("CURR 0.7,(@1)", ""),
        ("OUTP ON,(@1)", ""),
        ("VOLT:PROT 4.25,(@1)", ""),
        ("CURR:PROT:STAT ON,(@1)", ""),
        ("OUTP:PROT:CLE (@1)", ""),
        ("OUTP OFF,(@1)", ""),
    ],
)
def test_line_and_answer(line, answer):
    """A line of the dialect gets an answer of the published form, and leaves no error."""
    twin = Twin(truths={"psu": {"serial": "MY59002391"}})
    assert re.fullmatch(answer, twin.scpi(line))
    assert twin.scpi("SYST:ERR?") == '+0,"No error"'


def test_unknown_header():
    """An unknown header gets no answer, and the published error."""
    twin = Twin()
    assert twin.scpi("FOO:BAR?") == ""
    assert twin.scpi("SYST:ERR?") == '-113,"Undefined header"'


def test_not_a_number():
    """A measurement without a number is SCPI's 9.91E+37."""
    twin = Twin(faults={"psu": [{"kind": "not-a-number"}]})
    assert twin.scpi("MEAS:VOLT? (@1)") == "+9.91000000E+37"
