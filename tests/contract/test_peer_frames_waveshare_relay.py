"""The relay board's peer against frames that its maker publishes."""

from __future__ import annotations

import pytest
from twin import Twin

PUBLISHED = [
    ("01 05 00 00 FF 00 8C 3A", "01 05 00 00 FF 00 8C 3A"),
    ("01 05 00 00 00 00 CD CA", "01 05 00 00 00 00 CD CA"),
    ("01 05 00 00 55 00 F2 9A", "01 05 00 00 55 00 F2 9A"),
    ("01 05 00 01 FF 00 DD FA", "01 05 00 01 FF 00 DD FA"),
    ("01 05 00 FF FF 00 BC 0A", "01 05 00 FF FF 00 BC 0A"),
    ("01 05 00 FF 00 00 FD FA", "01 05 00 FF 00 00 FD FA"),
    ("01 01 00 00 00 08 3D CC", "01 01 01 00 51 88"),
    ("01 0F 00 00 00 08 01 FF BE D5", "01 0F 00 00 00 08 54 0D"),
    ("01 05 02 00 00 07 8D B0", "01 05 02 00 00 07 8D B0"),
    ("01 05 02 01 00 08 9C 74", "01 05 02 01 00 08 9C 74"),
    ("01 05 04 00 00 05 0C F9", "01 05 04 00 00 05 0C F9"),
    ("00 03 40 00 00 01 90 1B", "01 03 02 00 01 79 84"),
    ("00 03 80 00 00 01 AC 1B", "01 03 02 53 49 45 42"),
    ("00 06 40 00 00 01 5C 1B", "00 06 40 00 00 01 5C 1B"),
    ("00 06 20 00 00 05 43 D8", "00 06 20 00 00 05 43 D8"),
]


@pytest.mark.parametrize(("request_frame", "reply"), PUBLISHED)
def test_published_exchange(request_frame, reply):
    """A published request gets its published reply, bit by bit, checksum included."""
    assert Twin().modbus(request_frame) == reply


def test_published_status_frame():
    """With relays 1 and 7 on, the status is the published frame."""
    twin = Twin()
    twin.modbus("01 05 00 00 FF 00 8C 3A")
    twin.modbus("01 05 00 06 FF 00 6C 3B")
    assert twin.modbus("01 01 00 00 00 08 3D CC") == "01 01 01 41 91 B8"
