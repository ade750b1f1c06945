"""What the board sends unasked: data of streams, notices of a reset, events."""

from __future__ import annotations

from dataclasses import dataclass, field

from hil.instruments.obc_link.frames import Frame
from hil.instruments.obc_link.messages import BootNotice, Unsolicited, event, started
from hil.model.errors import DeviceFault

__all__ = ["Arrivals", "Inbox"]

_WATCHDOG_EXPIRED = 1


@dataclass(slots=True)
class Inbox:
    """Where the frames of one stream wait for whoever reads it; `fault` is why no more will come."""

    payloads: list[bytes] = field(default_factory=list)
    fault: DeviceFault | None = None


class Arrivals:
    """Gives every unsolicited frame its place.

    Args:
        device: the instrument's name, for messages.

    Attributes:
        stray: frames that nobody waits for: late copies of replies, data of streams that are over, unknown types.
        events: reports of the board about itself.
    """

    def __init__(self, device: str) -> None:
        self.stray = 0
        self.events = 0
        self._device = device
        self._inboxes: dict[int, Inbox] = {}
        self._notice: BootNotice | None = None

    def open_inbox(self, stream: int) -> Inbox:
        """Begin to keep the frames of a stream."""
        self._inboxes[stream] = Inbox()
        return self._inboxes[stream]

    def close_inbox(self, stream: int) -> None:
        """Keep no more frames of a stream."""
        self._inboxes.pop(stream, None)

    def break_streams(self, fault: DeviceFault) -> None:
        """Tell every stream why it ends; the first reason stays."""
        for inbox in self._inboxes.values():
            inbox.fault = inbox.fault or fault

    def take_notice(self) -> BootNotice | None:
        """Return the newest boot notice, once."""
        notice, self._notice = self._notice, None
        return notice

    def place(self, frame: Frame) -> None:
        """Take one frame."""
        try:
            self._place(frame)
        except ValueError:
            self.stray += 1

    def _place(self, frame: Frame) -> None:
        if frame.kind == Unsolicited.STREAM_DATA and frame.payload[:1] and frame.payload[0] in self._inboxes:
            self._inboxes[frame.payload[0]].payloads.append(frame.payload)
        elif frame.kind == Unsolicited.BOOT:
            self._notice = started(frame.payload)
        elif frame.kind == Unsolicited.EVENT:
            self._event(frame.payload)
        else:
            self.stray += 1

    def _event(self, payload: bytes) -> None:
        told = event(payload)
        self.events += 1
        if told.event == _WATCHDOG_EXPIRED:
            self.break_streams(
                DeviceFault(
                    self._device,
                    f"the board stopped its streams: it heard nothing for {told.detail} ms",
                    "fetch the frames of a stream more often",
                )
            )
