"""Session with the OBC: one request at a time, with unsolicited frames dispatched in between."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

from hil.clock.port import NANOSECONDS, Clock
from hil.instruments.obc_link.frames import DELIMITER, MAJOR, Frame, FrameReader, seal
from hil.instruments.obc_link.messages import (
    BootNotice,
    Code,
    Command,
    Identification,
    Unsolicited,
    code_text,
    event,
    identification,
    reason_text,
    started,
)
from hil.model.errors import DeviceFault, Garbled, NoReply, Rejected, WrongIdentity
from hil.wire.port import Port

__all__ = ["Arrivals", "BoardRefused", "Inbox", "ObcSession", "Reply"]

_WATCHDOG_EXPIRED = 1
_LONGEST_NS = NANOSECONDS // 2
_ATTEMPTS = 4
_MARGIN_MS = 30  # the reply's time on the line, and USB latency at both ends
_WAIT_MS = 40
_WAITS_MS = {Command.ADC: 80, Command.I2C: 200, Command.STREAM_STOP: 420}
_IS_REPLY = 0x80
_LAST_SEQUENCE = 0xFFFF
_LOOK = "check the board's power, and what its firmware did before"

_T = TypeVar("_T")


@dataclass(slots=True)
class Inbox:
    """Queue of one stream's frames; `fault` is why the stream ended."""

    payloads: list[bytes] = field(default_factory=list)
    fault: DeviceFault | None = None


class Arrivals:
    """Dispatches every frame that is not the awaited reply.

    Args:
        device: the instrument's name, for messages.

    Attributes:
        stray: number of unexpected frames: late duplicates of replies, data of ended streams, unknown types.
        events: the board's event reports.
    """

    def __init__(self, device: str) -> None:
        self.stray = 0
        self.events = 0
        self._device = device
        self._inboxes: dict[int, Inbox] = {}
        self._notice: BootNotice | None = None

    def open_inbox(self, stream: int) -> Inbox:
        """Start queueing the frames of a stream."""
        self._inboxes[stream] = Inbox()
        return self._inboxes[stream]

    def expects(self, stream: int) -> bool:
        """Return whether a stream's frames are queued."""
        return stream in self._inboxes

    def close_inbox(self, stream: int) -> None:
        """Stop queueing the frames of a stream."""
        self._inboxes.pop(stream, None)

    def break_streams(self, fault: DeviceFault) -> None:
        """End every stream with a fault; the first fault is kept."""
        for inbox in self._inboxes.values():
            inbox.fault = inbox.fault or fault

    def take_notice(self) -> BootNotice | None:
        """Return the newest boot notice and clear it."""
        notice, self._notice = self._notice, None
        return notice

    def place(self, frame: Frame) -> None:
        """Dispatch one frame."""
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


@dataclass(frozen=True, slots=True)
class Reply:
    """The fields of a reply after its code, and the bench times of request and reply in ns."""

    fields: bytes
    sent_ns: int
    received_ns: int


class BoardRefused(Rejected):
    """The board answered with an error code; nothing was executed, unless the code is HARDWARE."""

    def __init__(self, device: str, command: Command, code: int, detail: int) -> None:
        super().__init__(
            device,
            f"the board refused {command.name}: {code_text(code)}, detail {detail:#06x}",
            "compare the request with the page about the OBC link",
        )
        self.code = code


class ObcSession:
    """The host's end of the link.

    IDENTIFY precedes the first request, and the first after a reset or a silence. A request without a
    reply is resent byte for byte, so that the board does not execute it twice; all attempts together
    take 0.5 s at most.

    Args:
        device: the instrument's name in the bench file, for messages.
        port: the open byte stream.
        clock: the bench's clock.

    Attributes:
        arrivals: dispatcher of unsolicited frames.
        repeated: number of requests resent.
        starts: number of times the board was re-identified; a change means that earlier settings are lost.
    """

    def __init__(self, device: str, port: Port, clock: Clock) -> None:
        self.device = device
        self.arrivals = Arrivals(device)
        self.repeated = 0
        self.starts = 0
        self._port = port
        self._clock = clock
        self._reader = FrameReader()
        self._sequence = 0
        self._board: Identification | None = None
        self._met = False

    @property
    def damaged(self) -> int:
        """Number of blocks between delimiters that were not frames."""
        return self._reader.damaged

    def board(self) -> Identification:
        """Return the board's identification, querying it if necessary."""
        return self._board if self._board and self._met else self.identify()

    def identify(self) -> Identification:
        """Query the board's identity.

        Raises:
            WrongIdentity: the board speaks another major version.
            DeviceFault: it has restarted since it was last identified.
        """
        self._met = False
        found = self.read("IDENTIFY", identification, self._exchange(Command.IDENTIFY, b"").fields)
        if found.major != MAJOR:
            raise self._foreign(found.major)
        before, self._board, self._met = self._board, found, True
        if before is None:
            self.starts += 1
        elif before.boots != found.boots:
            self.starts += 1
            raise self._restarted(found.boots, found.reason)
        return found

    def request(self, command: Command, payload: bytes = b"", *, once: bool = False) -> Reply:
        """Send a request and return its reply; `once` disables retries.

        Raises:
            NoReply: no reply came in time.
            Garbled: only damaged frames came.
            BoardRefused: the board answered with an error.
            WrongIdentity: the board speaks another major version.
            DeviceFault: the board has restarted.
        """
        self.board()
        return self._exchange(command, payload, once=once)

    def read(self, asked: str, parse: Callable[[bytes], _T], fields: bytes) -> _T:
        """Parse a reply's fields; Garbled where `parse` raises ValueError."""
        try:
            return parse(fields)
        except ValueError as error:
            raise Garbled(
                self.device, f"the reply to {asked} is nonsense: {error}", "compare the firmware with the protocol"
            ) from None

    def poll(self) -> None:
        """Take what has arrived, without waiting.

        Raises:
            DeviceFault: the board has restarted.
        """
        if waiting := self._port.in_waiting:
            for frame in self._reader.feed(self._port.read(waiting)):
                self.arrivals.place(frame)
            self._must_not_have_restarted()

    def went_back(self) -> DeviceFault:
        """Return the fault for a board whose clock went back; the next request identifies it again."""
        self._met, self._board = False, None
        fault = DeviceFault(self.device, "the board's clock went back: it has restarted without a notice", _LOOK)
        self.arrivals.break_streams(fault)
        return fault

    def _exchange(self, command: Command, payload: bytes, *, once: bool = False) -> Reply:
        self._sequence = self._sequence % _LAST_SEQUENCE + 1
        wire = seal(command, self._sequence, payload)
        damaged = self.damaged
        wait_ns = (_WAITS_MS.get(command, _WAIT_MS) + _MARGIN_MS) * 1_000_000
        deadline_ns = self._clock.now_ns() + _LONGEST_NS
        prefix = b"" if self._met else DELIMITER
        for attempt in range(1 if once else _ATTEMPTS):
            if attempt and deadline_ns - self._clock.now_ns() < wait_ns:
                break
            self.repeated += attempt > 0
            sent_ns = self._clock.now_ns()
            self._port.write(prefix + wire)
            if frame := self._await(command, min(self._clock.now_ns() + wait_ns, deadline_ns)):
                return Reply(self._judged(command, frame), sent_ns, self._clock.now_ns())
            prefix = DELIMITER
        self._met = False
        raise self._silence(command, self.damaged - damaged)

    def _await(self, command: Command, until_ns: int) -> Frame | None:
        """Return the reply to the outstanding request, or None; other frames are dispatched."""
        reply: Frame | None = None
        while reply is None and (left_ns := until_ns - self._clock.now_ns()) > 0:
            self._port.timeout = min(left_ns, _LONGEST_NS) / NANOSECONDS
            for frame in self._reader.feed(self._port.read(self._port.in_waiting or 1)):
                if reply is None and (frame.kind, frame.sequence) == (command | _IS_REPLY, self._sequence):
                    reply = frame
                else:
                    self.arrivals.place(frame)
            self._must_not_have_restarted()
        return reply

    def _judged(self, command: Command, frame: Frame) -> bytes:
        if frame.version != MAJOR:
            raise self._foreign(frame.version)
        if not frame.payload:
            raise Garbled(self.device, f"an empty reply to {command.name}", "compare the firmware with the protocol")
        code, fields = frame.payload[0], frame.payload[1:]
        if code != Code.OK:
            raise BoardRefused(self.device, command, code, int.from_bytes(fields[:2], "little"))
        return fields

    def _must_not_have_restarted(self) -> None:
        """Raise where a boot notice came during the session; one before the first identification is ignored."""
        if not (notice := self.arrivals.take_notice()):
            return
        known, self._board, self._met = self._board, None, False
        if known:
            raise self._restarted(notice.boots, notice.reason)

    def _restarted(self, boots: int, reason: int) -> DeviceFault:
        fault = DeviceFault(self.device, f"the board has restarted (boot {boots}, {reason_text(reason)})", _LOOK)
        self.arrivals.break_streams(fault)
        return fault

    def _foreign(self, major: int) -> WrongIdentity:
        return WrongIdentity(
            self.device,
            f"the board speaks version {major} of the protocol, this driver version {MAJOR}",
            "flash firmware of this version",
        )

    def _silence(self, command: Command, damaged: int) -> DeviceFault:
        if damaged:
            return Garbled(
                self.device,
                f"asked {command.name}, got no reply, but {damaged} damaged frames",
                "check the line's speed and the USB cable",
            )
        return NoReply(self.device, f"asked {command.name}, got no reply", "check the board's power and its USB cable")
