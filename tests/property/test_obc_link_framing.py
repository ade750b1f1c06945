"""Properties of the OBC link's framing: round trip, no zero inside, resynchronisation at the next zero."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.instruments.obc_link.frames import FrameReader, seal, stuff, unseal, unstuff

# Long runs without a zero reach the full blocks of 254 bytes.
DATA = st.one_of(
    st.binary(max_size=600),
    st.lists(st.sampled_from([b"\0", b"\x01" * 253, b"\x02" * 254, b"\x03" * 255]), max_size=6).map(b"".join),
)


@given(DATA)
def test_what_is_stuffed_comes_back(data):
    """Decoding what was encoded gives the same bytes, and no zero stands in between."""
    stuffed = stuff(data)
    assert 0 not in stuffed
    assert unstuff(stuffed) == data
    assert len(stuffed) <= len(data) + len(data) // 254 + 1


@given(st.builds(lambda times, byte: bytes((byte,)) * 254 * times, st.integers(1, 4), st.integers(1, 255)))
def test_a_final_code_after_a_full_block_is_allowed(data):
    """A receiver takes a frame that ends with a full block with or without a final 01."""
    assert unstuff(stuff(data) + b"\x01") == data


@given(st.binary(max_size=300))
def test_any_bytes_decode_or_are_refused(block):
    """Whatever stands between delimiters is decoded or a ValueError, never another error."""
    try:
        decoded = unstuff(block)
    except ValueError:
        return
    assert 0 not in block
    assert len(decoded) < len(block)


@given(st.integers(0, 255), st.integers(0, 65535), st.binary(max_size=2042))
def test_frames_come_back(kind, sequence, payload):
    """A frame keeps its type, sequence and payload on the line."""
    frame = unseal(seal(kind, sequence, payload)[:-1])
    assert (frame.version, frame.kind, frame.sequence, frame.payload) == (1, kind, sequence, payload)


@given(st.binary(max_size=3000), st.lists(st.integers(1, 500), min_size=1))
def test_garbage_costs_no_frame_after_its_delimiter(garbage, sizes):
    """After any garbage the next zero brings the reader back, in whatever pieces the bytes come."""
    line = garbage + b"\0" + seal(0x40, 0, b"whole") + seal(0x41, 7, b"")
    reader = FrameReader()
    frames = []
    while line:
        for size in sizes:
            frames += reader.feed(line[:size])
            line = line[size:]
    assert [(frame.kind, frame.payload) for frame in frames[-2:]] == [(0x40, b"whole"), (0x41, b"")]


@settings(derandomize=True)  # a CRC of 16 bits misses one change in 65,536
@given(st.binary(min_size=1, max_size=200), st.integers(0, 10_000), st.integers(1, 255))
def test_a_changed_byte_is_never_a_frame(payload, place, change):
    """One changed byte makes a frame damaged, or two pieces of which none is a frame."""
    line = bytearray(seal(0x40, 3, payload))
    line[place % (len(line) - 1)] ^= change
    reader = FrameReader()
    assert reader.feed(bytes(line)) == []
    assert reader.damaged >= 1


def test_an_endless_line_is_one_damaged_frame():
    """Bytes without a zero are not kept for ever, and count once at their delimiter."""
    reader = FrameReader()
    for _ in range(100):
        assert reader.feed(b"\x11" * 1000) == []
    assert reader.damaged == 0
    assert len(reader.feed(b"\0" + seal(1, 1))) == 1
    assert reader.damaged == 1


@pytest.mark.parametrize("payload", [b"", b"x" * 2042])
def test_shortest_and_longest_frames_pass(payload):
    """Frames of 6 and of 2048 bytes are taken."""
    assert unseal(seal(1, 1, payload)[:-1]).payload == payload


def test_frames_beyond_the_limits_are_refused():
    """Shorter than 6 and longer than 2048 bytes is no frame."""
    with pytest.raises(ValueError, match="no frame"):
        unseal(seal(1, 1, b"x" * 2043)[:-1])
    with pytest.raises(ValueError, match="no frame"):
        unseal(stuff(b"\x01\x02"))
