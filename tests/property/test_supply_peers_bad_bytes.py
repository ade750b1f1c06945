"""Arbitrary bytes never crash a supply without a frame, and one that got them still works."""

from __future__ import annotations

import sweeps
from hypothesis import given, settings
from hypothesis import strategies as st
from talking import Talk

from hil.simulation.peers import korad_ka3005p, rigol_dp832

WORDS = (
    b":SOUR", b":VOLT", b"CURR", b":OUTP", b":OVP", b":OCP", b":VAL", b"CH", b"1", b"2", b"9" * 400, b"E999", b"?",
    b";", b",", b" ", b"\n", b"ON", b":APPL", b":INST", b":NSEL", b"*IDN", b"*RST", b":MEAS", b":ALL", b"MAX",
    b"\xb2", b"\xff", b"VSET1", b"ISET1", b":31.00", b":04.20", b"STATUS", b"OUT1", b"OVP1", b"OCP0", b"VOUT1",
)  # fmt: skip
BYTES = st.one_of(st.binary(max_size=60), st.lists(st.sampled_from(WORDS), max_size=20).map(b"".join))


@settings(max_examples=sweeps.examples(60), derandomize=True)
@given(pieces=st.lists(BYTES, max_size=5))
def test_rigol_survives_any_bytes(pieces):
    """After any bytes, ended by a line feed and cleared, it names itself and has no error."""
    supply = Talk(rigol_dp832.MODEL)
    for piece in (*pieces, b"\n", b"*CLS\n"):
        supply.bytes(piece)
    assert supply.line("*IDN?").startswith("RIGOL TECHNOLOGIES,DP832,")
    assert supply.line(":SYST:ERR?") == '0,"No error"'


@settings(max_examples=sweeps.examples(60), derandomize=True)
@given(pieces=st.lists(BYTES, max_size=5))
def test_korad_survives_any_bytes(pieces):
    """After any bytes and silence it names itself, and its settings are within its range."""
    supply = Talk(korad_ka3005p.MODEL, baud=9600)
    for piece in pieces:
        supply.bytes(piece)
    assert supply.bytes(b"*IDN?") == b"KORADKA3005PV0.0"
    assert 0 <= float(supply.bytes(b"VSET1?")) <= 31
    assert 0 <= float(supply.bytes(b"ISET1?")) <= 5.1
