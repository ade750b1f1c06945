"""How an output of a SCPI supply is made safe by bytes alone.

A killed program may have left half a line, and a line feed would let the instrument execute it: `OUTP ON` without the
channels that were to follow switches whichever is selected. So the first thing sent is `*IDN?`: behind half a line it
makes nonsense of it, which is refused whole; behind nothing it is a question that changes nothing. The error queue is
not emptied: what stands there tells the next program what happened.

Instruments answer in order. The proof begins with `*IDN?` too: when its reply has come, no older one is owed.
"""

from __future__ import annotations

from hil.instruments.safing import LONGEST_REPLY_S
from hil.model.safing import Exchange, SafeBytes

__all__ = ["switched_off"]

_GAP_S = 0.02
_IDENTIFY = "*IDN?"
_IDENTIFICATION = rb"[^,;\n]+(?:,[^,;\n]*){3}"


def switched_off(
    off: str,
    questions: tuple[tuple[str, bytes, tuple[float, float] | None], ...],
    *,
    framed: bool,
    pause_s: float,
) -> SafeBytes:
    """Return the bytes of one output.

    Args:
        off: the command.
        questions: what is asked, what the reply must be, and the bounds of the number in it, if there is one.
        framed: whether a question may stand in a line with `*IDN?`; see `hil.instruments.scpi.ScpiSession`.
        pause_s: what the instrument needs between lines [s].
    """
    quiet_s = _GAP_S + pause_s
    asked = [
        Exchange(
            send=_line(f"{_IDENTIFY};{'' if question.startswith(':') else ':'}{question}" if framed else question),
            expect=rb"\A" + (_IDENTIFICATION + rb";" if framed else b"") + reply + rb"\r?\n",
            within_s=LONGEST_REPLY_S,
            quiet_s=quiet_s,
            between=bounds,
        )
        for question, reply, bounds in questions
    ]
    nothing_owed = Exchange(
        send=_line(_IDENTIFY),
        expect=rb"(?:\A|\n)" + _IDENTIFICATION + rb"\r?\n",
        within_s=LONGEST_REPLY_S,
        quiet_s=quiet_s,
    )
    return SafeBytes(
        resync=(Exchange(send=_line(_IDENTIFY), quiet_s=quiet_s),),
        off=(Exchange(send=_line(off), quiet_s=quiet_s),),
        proof=(nothing_owed, *asked),
    )


def _line(text: str) -> bytes:
    return text.encode("ascii") + b"\n"
