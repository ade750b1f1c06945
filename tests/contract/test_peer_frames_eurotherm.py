"""The temperature controller's peer against whole frames.

The loop-back's data are those of the Modbus specification (V1.1b3, section 6.8); addresses and meanings are those of
HA028651, section 15.5; checksums come from pymodbus, whose code the peer does not share.
"""

from __future__ import annotations

import pytest
from controller_line import ControllerLine

EXCHANGES = [
    ("01 08 00 00 A5 37 DA 8D", "01 08 00 00 A5 37 DA 8D"),
    ("01 03 00 7A 00 01 A5 D3", "01 03 02 32 16 2C EA"),
    ("01 03 00 6B 00 01 F5 D6", "01 03 02 53 49 45 42"),
    ("01 06 00 02 00 19 E9 C0", "01 06 00 02 00 19 E9 C0"),
    ("01 06 00 C7 00 01 F9 F7", "01 06 00 C7 00 01 F9 F7"),
    ("01 10 00 18 00 01 02 00 64 A4 63", "01 10 00 18 00 01 81 CE"),
]


@pytest.mark.parametrize(("request_frame", "reply"), EXCHANGES)
def test_whole_frames(request_frame, reply):
    """A sealed request gets its sealed reply, bit by bit."""
    assert ControllerLine().frame(request_frame) == reply


@pytest.mark.parametrize(
    "frame",
    ["01 03 00 7A 00 01 A5 D2", "02 03 00 01 00 01 D5 F9", "01 03 00 7A 00", "01"],
)
def test_what_is_not_for_it_gets_no_answer(frame):
    """A wrong checksum, another unit and half a frame are silence."""
    assert ControllerLine().frame(frame) == ""
