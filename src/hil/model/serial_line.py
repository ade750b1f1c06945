"""How a serial line is set: what `serial_line` of an instrument says, as the executive and the guardian apply it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from hil.model.notation import Complaint, Flag, Notation, Seconds, one_of, whole

__all__ = ["Rs485", "SerialLine"]

Parity = Literal["none", "even", "odd", "mark", "space"]
StopBits = Literal["1", "1.5", "2"]
Flow = Literal["none", "rts/cts", "xon/xoff"]


def _flow(value: object) -> object:
    """Read a flow control; the one that Linux does not have is refused with the way around it."""
    if value == "dsr/dtr":
        words = "cannot be dsr/dtr, which Linux does not have: wire the instrument's DTR to CTS, and write rts/cts"
        raise Complaint(words, found=False)
    return one_of("none", "rts/cts", "xon/xoff", blank="none").read(value)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rs485:
    """How the kernel switches an RS-485 driver by RTS; a converter that finds the direction itself needs none of this.

    Attributes:
        rts_on_send: the level of RTS while the computer sends; the other one while it listens.
        before_s: from RTS to the first bit [s]; the kernel counts in milliseconds.
        after_s: from the last bit to RTS [s].
        hears_itself: whether the receiver stays on while the computer sends.
    """

    rts_on_send: Flag = True
    before_s: Seconds = field(default=0.0, metadata={"alias": "before"})
    after_s: Seconds = field(default=0.0, metadata={"alias": "after"})
    hears_itself: Flag = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SerialLine:
    """The frame of a character, and who may send when: 8N1 without flow control where nothing else is said.

    Attributes:
        parity: of a character.
        data_bits: of a character.
        stop_bits: of a character; UARTs have 1.5 with 5 data bits only.
        flow: what holds the other side back.
        rs485: of a line with two wires, whose direction this computer switches.
    """

    parity: Annotated[Parity, one_of("none", "even", "odd", "mark", "space", blank="none")] = "none"
    data_bits: Annotated[int, whole(5, 8)] = 8
    stop_bits: Annotated[StopBits, one_of("1", "1.5", "2", blank="1")] = "1"
    flow: Annotated[Flow, Notation(_flow, "none")] = "none"
    rs485: Rs485 | None = None
