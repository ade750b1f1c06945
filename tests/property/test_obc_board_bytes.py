"""Arbitrary bytes never break the simulated board, and whatever is framed comes back as it was."""

from __future__ import annotations

import json

import sweeps
from hypothesis import given, settings
from hypothesis import strategies as st
from obc_page import BoardUnderTest

from hil.simulation.peers.obc_link.uart import FrameReader, seal

REQUESTS = st.builds(
    seal,
    st.one_of(st.integers(0, 12), st.integers(0, 255)),
    st.integers(0, 3),
    st.one_of(
        st.binary(max_size=40),
        st.sampled_from(
            [bytes.fromhex(text) for text in (
                "00", "", "000168010100", "00010000000000000001006875020000", "64000000", "00801a0600",
                "000000e803000000000101682e0108300004", "0000000c300000080001682e010830",
            )]
        ),
    ),
)  # fmt: skip


@settings(max_examples=sweeps.examples(100), derandomize=True)
@given(pieces=st.lists(st.one_of(st.binary(max_size=300), REQUESTS), max_size=8), pause_ms=st.integers(0, 30))
def test_the_board_survives_any_bytes(pieces, pause_ms):
    """After any bytes and requests every frame it sends is whole, its state is JSON, and it says who it is."""
    under = BoardUnderTest()
    under.sensor.fifo = bytes(range(256))
    for piece in pieces:
        under.frames(under.raw(piece, pause_ms / 1000))
        json.dumps(under.peer.state())
    under.frames(under.raw(b"\0", 1))
    under.raw(seal(0x08, 60_000, b"") + seal(0x08, 60_001, b""), 1)
    assert under.ask(0x01, 60_002)[-7:] == b"hil-obc"


@settings(max_examples=sweeps.examples(200), derandomize=True)
@given(
    kind=st.integers(0, 255),
    sequence=st.integers(0, 65_535),
    payload=st.one_of(st.binary(max_size=2042), st.integers(0, 2042).map(lambda size: b"\x07" * size)),
    cuts=st.lists(st.integers(1, 400), max_size=6),
)
def test_what_is_framed_comes_back(kind, sequence, payload, cuts):
    """Whatever it holds and however it is cut; no zero stands in it, and its length is as the page says."""
    data = seal(kind, sequence, payload)
    assert data.find(0) == len(data) - 1 <= 2057
    reader, found, rest = FrameReader(), [], data
    for cut in (*cuts, len(data)):
        found += [frame for _, frame in reader.take(rest[:cut])]
        rest = rest[cut:]
    (frame,) = found
    assert (frame.kind, frame.sequence, frame.payload) == (kind, sequence, payload)


@settings(max_examples=sweeps.examples(200), derandomize=True)
@given(payload=st.binary(max_size=300), place=st.integers(min_value=0), bit=st.integers(0, 7))
def test_no_flipped_bit_is_taken_for_a_frame(payload, place, bit):
    """One flipped bit anywhere, delimiters included, leaves no frame."""
    data = bytearray(seal(0x03, 7, payload))
    data[place % len(data)] ^= 1 << bit
    assert not any(frame for _, frame in FrameReader().take(bytes(data) + b"\0"))
