"""Arbitrary bytes never crash the simulated ESP301, and it still works after them."""

from __future__ import annotations

import sweeps
from hypothesis import given, settings
from hypothesis import strategies as st
from rotation import Controller

WORDS = (
    b"1", b"2", b"9" * 20, b"VA", b"MV", b"MO", b"MF", b"ST", b"TP", b"TB", b"SN", b"SL", b"AC", b"+", b"-", b"?", b";",
    b" ", b"\r", b"\r\n", b"\n", b"1e5", b"1E99", b".", b"\xb2", b"\xff", b"1MO;1MV+", b"x" * 90,
)  # fmt: skip
BYTES = st.one_of(st.binary(max_size=60), st.lists(st.sampled_from(WORDS), max_size=20).map(b"".join))


@settings(max_examples=sweeps.examples(60), derandomize=True)
@given(pieces=st.lists(BYTES, max_size=5))
def test_controller_survives_any_bytes(pieces):
    """After any bytes, a carriage return and a stop, it tells its version, and its errors come to an end."""
    controller = Controller()
    for piece in (*pieces, b"\rST\r"):
        controller.exchange(piece, 0.3)
    assert controller.ask("VE?") == ["ESP301 Version SIM.1 6/1/99"]
    errors = [controller.ask("TE?") for _ in range(11)]
    assert errors[-1] == ["0"]
