"""Arbitrary bytes never crash a peer, and a peer that got them still works."""

from __future__ import annotations

import sweeps
from hypothesis import given, settings
from hypothesis import strategies as st
from twin import MAGNETOMETER, Twin

from hil.simulation.peers.modbus_rtu import checked, seal

WORDS = (
    b"VOLT", b":", b";", b"?", b" ", b",", b"(@", b")", b"1", b"2:3", b"MEAS", b"CURR", b"OUTP", b"ON", b"*IDN",
    b"PROT", b"\n", b"\r\n", b"'", b'"', b"INST", b"9" * 400, b"E999", b"ISUM", b"STAT:QUES:INST:ISUM", b":COND",
    b"\xb2", b"\xff",
)  # fmt: skip
SCPI_BYTES = st.one_of(st.binary(max_size=60), st.lists(st.sampled_from(WORDS), max_size=20).map(b"".join))


@settings(max_examples=sweeps.examples(60), derandomize=True)
@given(pieces=st.lists(SCPI_BYTES, max_size=5))
def test_supply_survives_any_bytes(pieces):
    """After any bytes, ended by a line feed and cleared, the supply names itself."""
    twin = Twin()
    for piece in (*pieces, b"\n*CLS\n"):
        twin.exchange("psu", piece, 0.3)
    assert twin.scpi("*IDN?").startswith("Keysight Technologies,E36312A,")
    assert twin.scpi("SYST:ERR?") == '+0,"No error"'


@settings(max_examples=sweeps.examples(60), derandomize=True)
@given(pieces=st.lists(st.one_of(st.binary(max_size=300), st.binary(max_size=12).map(lambda body: seal(b"\1" + body)))))
def test_relay_board_survives_any_bytes(pieces):
    """After any bytes and frames the board answers, under whatever address they may have given it."""
    twin = Twin()
    for piece in pieces:
        twin.exchange("relays", piece, 0.05)
    assert checked(twin.exchange("relays", seal(bytes.fromhex("000340000001")))) is not None


@settings(max_examples=sweeps.examples(60), derandomize=True)
@given(
    writes=st.lists(st.binary(min_size=1, max_size=8), max_size=8),
    reads=st.lists(st.integers(min_value=0, max_value=32), max_size=4),
)
def test_magnetometer_survives_any_messages(writes, reads):
    """Any register may be written with anything and read; the identity stays."""
    twin = Twin()
    twin.power_sensor()
    for data in writes:
        twin.bus.transfer([(MAGNETOMETER, data)])
        twin.clock.sleep(0.01)
        for count in reads:
            assert len(twin.bus.transfer([(MAGNETOMETER, count)])[0]) == count
    assert twin.register(0x0F) == 0x3D


@settings(max_examples=sweeps.examples(200), derandomize=True)
@given(body=st.binary(min_size=2, max_size=250), place=st.integers(min_value=0), bit=st.integers(0, 7))
def test_checksum_finds_every_flipped_bit(body, place, bit):
    """A sealed frame is accepted, with any one bit flipped it is not."""
    frame = bytearray(seal(body))
    assert checked(bytes(frame)) == body
    frame[place % len(frame)] ^= 1 << bit
    assert checked(bytes(frame)) is None
