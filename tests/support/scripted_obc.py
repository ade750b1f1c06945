"""A port at whose end a scripted OBC answers request by request, on the virtual clock."""

from __future__ import annotations

import struct
from collections.abc import Callable

from scripted import ScriptedPort

from hil.clock.virtual import VirtualClock
from hil.instruments.obc_link.frames import Frame, FrameReader, seal

__all__ = ["IDENTIFY", "ScriptedObc", "boot_notice", "identity", "stream_data"]

IDENTIFY, TIME, I2C, ADC, START, STOP, WATCHDOG, SPEED = 1, 2, 3, 4, 5, 6, 7, 0x0A

Answer = Callable[[Frame], bytes]


def identity(boots: int = 41, reason: int = 1, major: int = 1, more: bytes = b"") -> bytes:
    """Return the payload of a reply to IDENTIFY."""
    head = struct.pack("<B5B8s12sIB", 0, major, 0, 1, 0, 0, b"\x9f" * 8, bytes(range(12)), boots, reason)
    return head + struct.pack("<6BHIB", 1, 2, 6, 1, 8, 8, 2048, 16384, 7) + b"hil-obc" + more


def boot_notice(boots: int = 42, reason: int = 4) -> bytes:
    """Return a boot notice as it stands on the line."""
    return b"\0" + seal(0x41, 0, struct.pack("<BBIB3B", 1, 0, boots, reason, 1, 0, 0))


def stream_data(number: int, *replies: bytes | None, lost: int = 0, device_us: int = 0) -> bytes:
    """Return a frame of stream 0 as it stands on the line; None is a transfer without acknowledge."""
    head = struct.pack("<BBIIQB", 0, 0, number, lost, device_us, len(replies))
    parts = [struct.pack("<BH", reply is None, len(reply or b"")) + (reply or b"") for reply in replies]
    return seal(0x40, 0, head + b"".join(parts))


class ScriptedObc(ScriptedPort):
    """Answers every request after `delay`, and keeps what came in `requests`.

    Attributes:
        answers: payload of the reply by the request's type; what is not there is answered with code 0 alone.
        lose: how many of the next replies are lost.
        before: bytes that come right before the next reply.
    """

    def __init__(self, clock: VirtualClock, *, drift: float = 0.0, delay: float = 0.001) -> None:
        super().__init__(clock)
        self.requests: list[Frame] = []
        self.lines: list[bytes] = []
        self.answers: dict[int, Answer] = {
            IDENTIFY: lambda _: identity(),
            TIME: self._time,
            STOP: lambda _: struct.pack("<BBII", 0, 0, 0, 0),
        }
        self.lose = 0
        self.before = b""
        self.delay = delay
        self.drift = drift
        self.device_offset_us = 5_000_000
        self._reader = FrameReader()

    def asked(self) -> list[int]:
        """Return the types of all requests so far."""
        return [request.kind for request in self.requests]

    def write(self, data: bytes) -> int:
        """Answer every whole request."""
        self.lines.append(data)
        for request in self._reader.feed(data):
            self.requests.append(request)
            reply = self.answers.get(request.kind, lambda _: b"\0")(request)
            before, self.before = self.before, b""
            if before:
                self.come(before, self.delay / 2)
            if self.lose:
                self.lose -= 1
            else:
                self.come(seal(request.kind | 0x80, request.sequence, reply), self.delay)
        return len(data)

    def _time(self, request: Frame) -> bytes:
        middle = self.clock.now() + self.delay / 2
        device_us = self.device_offset_us + round(middle * (1.0 + self.drift) * 1e6)
        return b"\0" + request.payload[:8] + struct.pack("<QQ", device_us, device_us)
