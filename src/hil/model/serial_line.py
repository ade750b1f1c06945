"""Settings of a serial line: an instrument's `serial_line`, applied by executive and guardian."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from hil.model.notation import Complaint, Flag, Notation, Seconds, one_of, whole

__all__ = ["Rs485", "SerialLine"]

Parity = Literal["none", "even", "odd", "mark", "space"]
StopBits = Literal["1", "1.5", "2"]
Flow = Literal["none", "rts/cts", "xon/xoff"]


def _flow(value: object) -> object:
    """Parse a flow control; one that Linux lacks is refused with a workaround."""
    if value == "dsr/dtr":
        words = "cannot be dsr/dtr, which Linux does not have: wire the instrument's DTR to CTS, and write rts/cts"
        raise Complaint(words, found=False)
    return one_of("none", "rts/cts", "xon/xoff", blank="none").read(value)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rs485:
    """RS-485 direction control by RTS in the kernel; converters with automatic direction control do not need it.

    Attributes:
        rts_on_send: RTS level while transmitting; inverted while receiving.
        before_s: delay from RTS to the first bit [s]; the kernel's resolution is 1 ms.
        after_s: delay from the last bit to RTS [s].
        hears_itself: whether the receiver stays enabled while transmitting.
    """

    rts_on_send: Flag = True
    before_s: Seconds = field(default=0.0, metadata={"alias": "before"})
    after_s: Seconds = field(default=0.0, metadata={"alias": "after"})
    hears_itself: Flag = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SerialLine:
    """Character frame and flow control: 8N1 without flow control by default.

    Attributes:
        parity: parity bit.
        data_bits: number of data bits.
        stop_bits: number of stop bits; UARTs support 1.5 only with 5 data bits.
        flow: flow control.
        rs485: settings of a two-wire line whose direction this computer switches.
    """

    parity: Annotated[Parity, one_of("none", "even", "odd", "mark", "space", blank="none")] = "none"
    data_bits: Annotated[int, whole(5, 8)] = 8
    stop_bits: Annotated[StopBits, one_of("1", "1.5", "2", blank="1")] = "1"
    flow: Annotated[Flow, Notation(_flow, "none")] = "none"
    rs485: Rs485 | None = None
