"""How a rotation table is stopped by bytes alone, and shown to stand still.

A killed program may have left half a line, and a carriage return would let the controller execute it: `1MV+` begins a
movement. So the first thing sent is `VE?`: behind half a line it makes nonsense of it, behind nothing it changes
nothing. The error buffer is left as it is.

The driver cuts the motor's power when the encoder stands still. Here nobody waits for that: power goes right behind the
stop, as at an emergency stop, and what still turns runs out by friction. So a controller that does not obey its stop is
stopped too.

Whether the table stands is asked of its encoder: two angles that agree, with as many questions between them that some
hundredths of a second pass. All leave at once, because only replies to one question can be compared with each other.
"""

from __future__ import annotations

from hil.instruments.safing import LONGEST_REPLY_S, NUMBER
from hil.model.safing import Exchange, SafeBytes

__all__ = ["stopped"]

_GAP_S = 0.03
_BETWEEN = 16
_VERSION = rb"(?:\A|\n)ESP\d+ +Version [^\r\n]*\r\n"
_END = rb" *\r\n"


def stopped(axis: int, rate: tuple[float, float] | None) -> SafeBytes:
    """Return the bytes of one axis.

    Args:
        axis: its number.
        rate: bounds of the velocity that the controller tells [deg/s], None where it is not to be asked.
    """
    asked = [_asked("VE?", _VERSION), _asked(f"{axis}MD?", rb"\A *1" + _END), _asked(*_standing(axis))]
    if rate is not None:
        asked.append(_asked(f"{axis}TV?", rb"\A *" + NUMBER + _END, rate))
    return SafeBytes(
        resync=(Exchange(send=b"VE?\r", quiet_s=_GAP_S),),
        off=(Exchange(send=b"%dST\r" % axis), Exchange(send=b"%dMF\r" % axis)),
        proof=tuple(asked),
    )


def _standing(axis: int) -> tuple[str, bytes]:
    """Return questions and replies of a motor without power, and of a table within 0.001 deg before and after them."""
    angle, powered = f"{axis}TP?", f"{axis}MO?"
    questions = "\r".join((angle, *[powered] * _BETWEEN, angle))
    replies = rb"\A *([+-]?\d+\.\d{3})\d*" + _END + rb"(?: *0" + _END + rb"){%d} *\1\d*" % _BETWEEN + _END
    return questions, replies


def _asked(question: str, reply: bytes, between: tuple[float, float] | None = None) -> Exchange:
    return Exchange(
        send=question.encode("ascii") + b"\r",
        expect=reply,
        within_s=LONGEST_REPLY_S,
        quiet_s=_GAP_S,
        between=between,
    )
