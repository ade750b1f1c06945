"""How a cycler of level 2 is stopped by bytes alone, in the midst of its lines.

Tag 0 is for whoever does not know what was said before. A killed program may have left a whole START but for its end,
which a line feed would let begin a battery's charge. So what is sent first is a question without a line feed before it:
behind half a line the seal of both together is wrong, and the device throws them away.
"""

from __future__ import annotations

from hil.instruments.cycler.lines import seal
from hil.instruments.safing import NUMBER, own_bounds
from hil.model.bench import Proof
from hil.model.safing import Exchange, SafeBytes

__all__ = ["stopped"]

_WITHIN_S = 0.6  # a reply's last byte within 0.3 s, and two long lines of 140 bytes that may leave first
_OVER = rb"(?:IDLE|ENDED|STOPPED|TRIPPED)"
_SEAL = rb"\*[0-9A-F]{4}\r\n"
_FIELDS = {"voltage": b"v", "current": b"i", "temperature": b"t"}


def stopped(name: str, proof: Proof | None) -> SafeBytes:
    """Return the bytes that open both relays and end a test, and ask for state, relays and what is measured.

    Args:
        name: of the role instance.
        proof: how the bench file proves it; voltage, current and temperature of this cycler are asked for.
    """
    question, command = seal(":0 STATE"), seal(":0 STOP")
    fields = dict.fromkeys((b"v", b"i", b"e", b"t"), rb"\S+")
    between = None
    for quantity, field in _FIELDS.items():
        if bounds := own_bounds(name, proof, quantity):
            fields[field], between = NUMBER, bounds
    measured = b" ".join(field + b"=" + form for field, form in fields.items())
    told = rb"(?:\A|\n):0 OK state=" + _OVER + rb" run=\S+ cycle=\d+ relays=- lines=\d+ ms=\d+ " + measured + _SEAL
    done = rb"(?:\A|\n):0 OK state=" + _OVER + _SEAL
    return SafeBytes(
        resync=(Exchange(send=question),),
        off=(Exchange(send=b"\n" + command, expect=done, within_s=_WITHIN_S),),
        proof=(Exchange(send=b"\n" + question, expect=told, within_s=_WITHIN_S, between=between),),
    )
