"""Lines of a cycler are taken in a block as they would be one by one."""

from __future__ import annotations

from binascii import crc_hqx

from hypothesis import given
from hypothesis import strategies as st

from hil.instruments.cycler.numbered import NumberedLines

_WRAP = 1 << 32
_FACTS = ("state", "phase", "cycle", "reading", "recording", "rows", "frames", "lost", "damaged")
_MORE = ("replies", "unsure", "went_back", "nonsense", "number", "_ms", "_wrapped_ms")

steps = st.lists(
    st.tuples(
        st.sampled_from(
            ["data"] * 12 + ["CHARGE END", "TEST ITERATION 2", "TEST TRIPPED VMAX", "IDLE", ":7 OK", "torn"]
        ),
        st.sampled_from("CCCCCCDR"),
        st.sampled_from([1] * 12 + [2, 3, 0, -4]),
        st.sampled_from([5000] * 12 + [5004, 0, -5000, 4_000_000_000]),
    ),
    max_size=30,
)
sizes = st.lists(st.integers(1, 9), min_size=1, max_size=10)


def written(steps, number, ms):
    """Return the lines of a device, from a number and a time on."""
    for what, phase, by, passed in steps:
        number, ms = number + by, (ms + passed) % _WRAP
        body = f"3.7{number % 100:02d};0.700;1.0000;25.1;{number};{ms};{phase}" if what in {"data", "torn"} else what
        body += "" if what in {"data", "torn"} or what[0] == ":" else f";{number};{ms}"
        data = body.encode()
        line = b"%b*%04X" % (data, crc_hqx(data, 0xFFFF))
        yield line[3:] if what == "torn" else line


@given(steps=steps, sizes=sizes, ms=st.sampled_from([20_000, _WRAP - 20_000]))
def test_a_block_is_taken_as_its_lines_one_by_one(steps, sizes, ms):
    """Rows, counts and states are the same, to the last bit, wherever the blocks end."""
    lines = list(written(steps, 10, ms))
    singly, blocks = NumberedLines(0.0), NumberedLines(0.0)
    for told in (singly, blocks):
        told.record()
        told.zero_ms = 1234.567
        told.charging(1.0)
        told.resume(10, ms, "charge", 1.0)
    for line in lines:
        singly.take([line], 1.0)
    place = 0
    while place < len(lines):
        size = sizes[place % len(sizes)]
        blocks.take(lines[place : place + size], 1.0)
        place += size
    assert [getattr(blocks, name) for name in _FACTS] == [getattr(singly, name) for name in _FACTS]
    assert [getattr(blocks, name) for name in _MORE] == [getattr(singly, name) for name in _MORE]
