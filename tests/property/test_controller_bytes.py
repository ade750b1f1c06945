"""Whatever reaches the temperature controller, it stays one, and its output stays within its limits."""

from __future__ import annotations

import sweeps
from controller_line import ControllerLine
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.simulation.peers.modbus_rtu import seal

REGISTERS = st.integers(0, 600)
WORDS = st.integers(0, 0xFFFF)
WRITES = st.tuples(REGISTERS, WORDS).map(lambda pair: b"\6" + b"".join(word.to_bytes(2, "big") for word in pair))
PIECES = st.one_of(
    st.binary(max_size=300),
    st.binary(min_size=1, max_size=12).map(lambda body: seal(b"\1" + body)),
    WRITES.map(lambda body: seal(b"\1" + body)),
)


@settings(max_examples=sweeps.examples(60), derandomize=True)
@given(pieces=st.lists(PIECES, max_size=12))
def test_it_survives_any_bytes(pieces):
    """After any bytes and frames it tells its type, and turns of its loop go on."""
    line = ControllerLine()
    for piece in pieces:
        line.frame(piece.hex())
        line.wait(1.5)
    assert line.read(122) == 0x3216
    assert -1.0 <= line.chamber.inputs["tec"] <= 1.0
    line.write(30, 1000)
    line.write(31, 0x10000 - 1000)
    line.write(199, 1)
    line.wait(1.5)
    assert line.chamber.inputs["tec"] == 0.0
