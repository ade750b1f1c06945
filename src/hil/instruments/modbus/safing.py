"""Exchanges of Modbus RTU as bytes alone: frames between silences, and replies that are known to the last bit.

A silence of 3.5 characters ends whatever frame was begun (Modbus over Serial Line V1.02, 2.5.1.1), and a unit throws
half a frame away. The reply is compared whole, checksum included, and from the first byte on. So a number in a reply
cannot be held to bounds, only to a value.
"""

from __future__ import annotations

import re

from hil.instruments.safing import LONGEST_REPLY_S
from hil.model.safing import Exchange

__all__ = ["SILENCE", "exchange"]

_SILENCE_S = 0.05  # 3.5 characters of 11 bits take 32 ms at 1200 baud, and an adapter may hold bytes for 16 ms

SILENCE = Exchange(send=b"", quiet_s=_SILENCE_S)
"""What ends half a frame."""


def exchange(request: bytes, reply: bytes) -> Exchange:
    """Return the exchange of a request and the one reply to it that is right."""
    return Exchange(send=request, expect=rb"\A" + re.escape(reply), within_s=LONGEST_REPLY_S, quiet_s=_SILENCE_S)
