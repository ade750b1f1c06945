"""Payloads of the OBC link: encoding of requests, decoding of replies and unsolicited frames."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from hil.wire.streaming import RegisterRead, StreamFrame, StreamTransfer

__all__ = [
    "BootNotice",
    "Code",
    "Command",
    "Conversions",
    "Event",
    "Identification",
    "MessageStatus",
    "Unsolicited",
    "code_text",
    "conversions",
    "event",
    "identification",
    "program",
    "reason_text",
    "started",
    "statuses",
    "stream_frame",
]

_MICROSECONDS = 1e6
_IDENTIFICATION = struct.Struct("<5B8s12sIB6BHIB")
_CONVERSIONS = struct.Struct("<BHIQHH")
_BOOT = struct.Struct("<BBIB3B")
_EVENT = struct.Struct("<BIQI")
_STREAM_HEAD = struct.Struct("<BBIIQB")
_STATUS = struct.Struct("<BH")
_TIMER, _LINE = 0, 1
_REGISTER, _FIFO = 0, 1
_REASONS = {
    1: "power-on or brown-out",
    2: "reset pin",
    3: "software reset",
    4: "independent watchdog",
    5: "window watchdog",
    6: "low-power management",
    7: "option bytes",
    8: "firewall",
    9: "hard fault",
}


class Command(IntEnum):
    """Request types that this driver sends."""

    IDENTIFY = 0x01
    TIME = 0x02
    I2C = 0x03
    ADC = 0x04
    STREAM_START = 0x05
    STREAM_STOP = 0x06
    WATCHDOG = 0x07
    I2C_SPEED = 0x0A


class Unsolicited(IntEnum):
    """Types of unsolicited frames."""

    STREAM_DATA = 0x40
    BOOT = 0x41
    EVENT = 0x42


class Code(IntEnum):
    """Result code: the first byte of a reply."""

    OK = 0
    UNKNOWN_TYPE = 1
    VERSION = 2
    LENGTH = 3
    PARAMETER = 4
    SEQUENCE = 5
    BUSY = 6
    NOT_RUNNING = 7
    TOO_LONG = 8
    HARDWARE = 9


class MessageStatus(IntEnum):
    """The outcome of one I2C message."""

    OK = 0
    NO_ADDRESS = 1
    NO_DATA = 2
    BUS_ERROR = 3
    TIMEOUT = 4
    NOT_RUN = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Identification:
    """The reply to IDENTIFY: protocol and firmware version, identity, and capabilities."""

    major: int
    minor: int
    firmware: str
    build: str
    unique_id: str
    boots: int
    reason: int
    buses: int
    lines: int
    channels: int
    streams: int
    transfers: int
    messages: int
    largest_frame: int
    ring: int
    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Conversions:
    """The reply to ADC: number of raw conversions, their sum and sum of squares, full scale, reference in mV."""

    channel: int
    taken: int
    total: int
    squares: int
    full_scale: int
    reference_mv: int


@dataclass(frozen=True, slots=True, kw_only=True)
class BootNotice:
    """The board's unsolicited notice after a reset."""

    boots: int
    reason: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """An unsolicited event report: event code and detail."""

    event: int
    detail: int


def code_text(code: int) -> str:
    """Return the name of an error code."""
    return next((known.name for known in Code if known == code), f"code {code}")


def reason_text(reason: int) -> str:
    """Return the text for a reset reason."""
    return _REASONS.get(reason, f"unknown reason {reason}")


def identification(reply: bytes) -> Identification:
    """Decode the reply to IDENTIFY after its code; extra fields of a later minor version are ignored.

    Raises:
        ValueError: it is too short.
    """
    head = _unpacked(_IDENTIFICATION, reply)
    name = reply[_IDENTIFICATION.size :][: head[17]]
    return Identification(
        major=head[0],
        minor=head[1],
        firmware=".".join(map(str, head[2:5])),
        build=head[5].hex(),
        unique_id=head[6].hex(),
        boots=head[7],
        reason=head[8],
        buses=head[9],
        lines=head[10],
        channels=head[11],
        streams=head[12],
        transfers=head[13],
        messages=head[14],
        largest_frame=head[15],
        ring=head[16],
        name=name.decode("ascii", "replace"),
    )


def conversions(reply: bytes) -> Conversions:
    """Decode the reply to ADC after its code; ValueError if it is too short."""
    channel, taken, total, squares, full_scale, reference_mv = _unpacked(_CONVERSIONS, reply)
    return Conversions(
        channel=channel, taken=taken, total=total, squares=squares, full_scale=full_scale, reference_mv=reference_mv
    )


def started(payload: bytes) -> BootNotice:
    """Decode a boot notice; ValueError if it is too short."""
    _major, _minor, boots, reason, *_firmware = _unpacked(_BOOT, payload)
    return BootNotice(boots=boots, reason=reason)


def event(payload: bytes) -> Event:
    """Decode an event; ValueError if it is too short."""
    number, _count, _device_us, detail = _unpacked(_EVENT, payload)
    return Event(event=number, detail=detail)


def program(
    stream: int, bus: int, transfers: Sequence[StreamTransfer], period_us: int | None, line: int | None
) -> bytes:
    """Return the payload of STREAM_START, without watermark.

    Raises:
        struct.error: a number does not fit its field.
    """
    trigger, argument = (_TIMER, period_us) if line is None else (_LINE, line)
    head = struct.pack("<BBBIHB", stream, bus, trigger, argument, 0, len(transfers))
    return head + b"".join(map(_transfer, transfers))


def statuses(payload: bytes, at: int, count: int) -> tuple[tuple[int, bytes], ...]:
    """Decode `count` statuses with their bytes, starting at offset `at`.

    Raises:
        ValueError: the payload is cut short.
    """
    found = []
    for _ in range(count):
        status, length = _unpacked(_STATUS, payload, at)
        at += _STATUS.size
        found.append((status, payload[at : at + length]))
        at += length
    if at > len(payload):
        raise ValueError("bytes of a transfer are missing")
    return tuple(found)


def stream_frame(payload: bytes) -> StreamFrame:
    """Decode a frame of stream data.

    Raises:
        ValueError: the payload is cut short.
    """
    _stream, _reserved, number, lost, device_us, count = _unpacked(_STREAM_HEAD, payload)
    replies = tuple(None if status else data for status, data in statuses(payload, _STREAM_HEAD.size, count))
    return StreamFrame(number=number, lost=lost, device_s=device_us / _MICROSECONDS, replies=replies)


def _unpacked(layout: struct.Struct, payload: bytes, at: int = 0) -> tuple[Any, ...]:
    """Unpack the fields of a layout; ValueError where the payload is too short for it."""
    try:
        return layout.unpack_from(payload, at)
    except struct.error:
        raise ValueError(f"{len(payload)} bytes, {at + layout.size} expected") from None


def _transfer(transfer: StreamTransfer) -> bytes:
    if isinstance(transfer, RegisterRead):
        return struct.pack("<BBBH", _REGISTER, transfer.address, transfer.register, transfer.length)
    return struct.pack(
        "<BBBBBBH",
        _FIFO,
        transfer.address,
        transfer.count_register,
        transfer.unit,
        transfer.record,
        transfer.data_register,
        transfer.most,
    )
