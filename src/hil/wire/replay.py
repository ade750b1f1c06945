"""Replay: recorded operations, in strict order, in place of instruments at the far ends of ports and buses."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, NoReturn

from serial import SerialException

from hil.clock.port import Clock
from hil.model.errors import Diverged
from hil.wire.tap import message_bytes
from hil.wire.transcript import Operation, format_of, read_transcript

if TYPE_CHECKING:
    from smbus2 import i2c_msg

__all__ = [
    "BUSY",
    "CLOCK",
    "DISTRESS",
    "HOLD",
    "HOLD_END",
    "MONITOR",
    "OVERDUE",
    "Handover",
    "Place",
    "Playback",
    "ReplayedBus",
    "ReplayedStream",
]

BUSY = "busy"
"""The operation that marks where a case's own code had let nobody look after a bench for too long.

It sends the number of events of the run's own course up to there, and for how many seconds of the wall."""

CLOCK = "clock"
"""The operation that marks where a bench outside this process caught up with the present without another operation.

It sends its place; see `Place`."""

DISTRESS = "distress"
"""The operation that marks where a bench outside this process could no longer be driven.

It sends the number of events as above, and why."""

HOLD = "hold"
"""The operation that marks entry into the hold state; it sends its place."""

HOLD_END = "hold-end"
"""The operation that marks release from the hold state; it sends its place, too."""

MONITOR = "monitor"
"""The operation that marks a monitor's turn during a wait; its device is the monitor's limit.

It sends its place; see `Place`."""

OVERDUE = "monitor-overdue"
"""The same at a scheduling point without a wait; a wait may follow at the same instant."""

_AMID_A_WAIT = frozenset({DISTRESS, HOLD})
"""Operations that interrupt a wait: timed at their own instant, not at the wait's end."""

_ALL_ALIKE = 2
"""The last transcript format in which both had one name."""

_NEVER_WAITED = 3
"""The last transcript format in which streams were drained as often as possible."""

_IN_PARTS = 4
"""The last transcript format in which query and reply were separate operations."""

_NOT_SHARED = 5
"""The last transcript format without planned bus sharing between recordings."""

_NOT_ALL_SHARED = 6
"""The last transcript format in which recordings beside a case did not share, and only streams fed limits."""

_NOT_NAMED = 7
"""The last transcript format without sensor ID checks between samples."""

_NOT_SPARING = 8
"""The last transcript format in which sensors were read more often than necessary."""

_ANYWHERE = -1
"""What stands for a number that a mark did not send up to format 9: it is before every place."""

_HEX_SHOWN = 48


@dataclass(frozen=True, slots=True)
class Handover:
    """Handover from a record to the bench itself, which continues from there.

    Attributes:
        operations: number of operations answered by the record.
        at_ns: bench time of the handover, at a scheduling point after the last of them.
        act: continues the bench.
    """

    operations: int
    at_ns: int
    act: Callable[[], None]


class Place(NamedTuple):
    """A place in the course of a run: at a point or wait that the case passes in a replay, too, or after it.

    Attributes:
        course: the number of events of the run's own course before it.
        ordinal: how many points and waits have begun since the last of these.
    """

    course: int
    ordinal: int

    @classmethod
    def of(cls, sent: bytes) -> Place:
        """Return the place that a mark sent."""
        course, _, ordinal = sent.partition(b" ")
        return cls(int(course or _ANYWHERE), int(ordinal or _ANYWHERE))

    @property
    def sent(self) -> bytes:
        """How a mark tells it."""
        return b"%d %d" % self


class Playback:
    """Cursor over a transcript, shared by all replayed ports and buses.

    Args:
        path: the transcript of the run.
        clock: set to the recorded end of every operation.
        where: returns the current step, for messages.
        handover: where the record stops answering, None if it never does.

    Attributes:
        at_divergence: called with an operation that is not in the record, before it is raised.
        rows_wait: whether rows of its streams waited as long as the limits that they feed allow.
        in_parts: whether query and reply were separate operations.
        shared: whether recordings shared the bus by plan, with disturbances not held against the article.
        all_share: whether recordings beside a case shared it too, rows of sampled roles fed limits, and the first
            arming checked for room.
        names_asked: whether sensor IDs were checked between samples.
        sparing: whether sensors were read in as few transfers as possible.
    """

    def __init__(self, path: Path, clock: Clock, where: Callable[[], str], handover: Handover | None = None) -> None:
        self.at_divergence: Callable[[Diverged], object] = lambda _: None
        self._operations = islice(read_transcript(path), handover.operations if handover else None)
        self._next = next(self._operations, None)
        self._clock = clock
        self._where = where
        self._handover = handover
        format_ = format_of(path)
        self.rows_wait = format_ > _NEVER_WAITED
        self.in_parts = format_ <= _IN_PARTS
        self.shared = format_ > _NOT_SHARED
        self.all_share = format_ > _NOT_ALL_SHARED
        self.names_asked = format_ > _NOT_NAMED
        self.sparing = format_ > _NOT_SPARING
        alike = format_ <= _ALL_ALIKE
        self._alike = {MONITOR: {MONITOR}, OVERDUE: {MONITOR} if alike else {OVERDUE}}

    @property
    def exhausted(self) -> bool:
        """Whether every recorded operation has been requested."""
        return self._next is None

    def skip(self, operations: int) -> None:
        """Skip the record up to that number of operations, which are not repeated."""
        while self._next is not None and self._next.sequence < operations:
            self._next = next(self._operations, None)

    def look_up_ns(self, when_ns: int) -> int:
        """Return when a wait until `when_ns` must pause: where the record ends or holds it, or ends itself."""
        marks = [self._handover.at_ns] if self._handover else []
        if self._next is not None and self._next.name in _AMID_A_WAIT:
            marks.append(self._next.start_ns)
        return min((mark_ns for mark_ns in marks if self._clock.now_ns() < mark_ns < when_ns), default=when_ns)

    def hand_over_if_due(self) -> None:
        """Hand over if every operation up to there was requested and it is time; called at scheduling points."""
        handover = self._handover
        if handover and self._next is None and self._clock.now_ns() >= handover.at_ns:
            self._handover = None
            handover.act()

    def take_monitor(self, latest_ns: int, name: str, place: Place) -> str:
        """Consume the turn of the monitor that comes next in the record, and return its limit; empty if none does.

        Args:
            latest_ns: the last instant at which it may come.
            name: MONITOR in a wait, OVERDUE at a point.
            place: the last place at which it may come.
        """
        found = self._next_here(self._alike[name], latest_ns, place)
        return self.take(found.device, found.name, found.sent).device if found else ""

    def comes(self, name: str, latest_ns: int, place: Place) -> bool:
        """Return whether this operation comes next in the record, no later than `latest_ns`, and at this place."""
        return self._next_here({name}, latest_ns, place) is not None

    def next_if(self, name: str) -> Operation | None:
        """Return the record's next operation if it has this name."""
        found = self._next
        return found if found is not None and found.name == name else None

    def next_is(self, device: str, *names: str) -> bool:
        """Return whether the record's next operation is one of these of a device."""
        found = self._next
        return found is not None and found.device == device and found.name in names

    def take(self, device: str, name: str, sent: bytes = b"") -> Operation:
        """Consume the next operation, which must be this one, and set the clock to its end.

        Raises:
            Diverged: if another operation, device or other bytes were recorded here.
        """
        found = self._next
        if found is None:
            self.diverge(f"{device}: {name} at {self._where()}, but the record has ended")
        if (found.device, found.name, found.sent) != (device, name, sent):
            self.diverge(self._difference(found, device, name, sent))
        self._next = next(self._operations, None)
        self._clock.wait_until(found.end_ns)
        return found

    def diverge(self, text: str) -> NoReturn:
        """Report that the requested operation is not the recorded one.

        Raises:
            Diverged: always.
        """
        error = Diverged(text)
        self.at_divergence(error)
        raise error

    def _next_here(self, names: set[str], latest_ns: int, place: Place) -> Operation | None:
        found = self._next
        there = found is not None and found.name in names and found.start_ns <= latest_ns
        return found if found and there and Place.of(found.sent) <= place else None

    def _difference(self, found: Operation, device: str, name: str, sent: bytes) -> str:
        offset = next((i for i, (a, b) in enumerate(zip(found.sent, sent, strict=False)) if a != b), 0)
        return (
            f"{device}: {name} {sent.hex()[:_HEX_SHOWN]} at {self._where()}, but the record holds {found.device}:"
            f" {found.name} {found.sent.hex()[:_HEX_SHOWN]} (operation {found.sequence}, byte {offset})"
        )


_READ_FLAG = 0x0001


class ReplayedStream:
    """The recorded far end of one byte stream."""

    def __init__(self, device: str, playback: Playback) -> None:
        self._device = device
        self._playback = playback

    def opened(self) -> None:
        """Do nothing: opening is not recorded."""

    def closed(self) -> None:
        """Do nothing: closing is not recorded."""

    def dtr_rose(self) -> None:
        """Consume the recorded pulse."""
        self._take("pulse_dtr")

    def write(self, data: bytes) -> None:
        """Compare the bytes with the record."""
        self._take("write", data)

    def exchange(self, data: bytes, timeout: float) -> bytes:
        """Return the recorded reply; a record in parts has a second look at the buffer before the query."""
        if not self._playback.in_parts:
            return self._take("exchange", data).received
        while self._playback.next_is(self._device, "waiting", "discard"):
            self._take("discard" if self._playback.next_is(self._device, "discard") else "waiting")
        self.write(data)
        first = self.read(1, timeout)
        return first + self.read(more, timeout) if first and (more := self.waiting()) else first

    def read(self, size: int, timeout: float) -> bytes:  # noqa: ARG002 - the record knows what came in time
        """Give what was received then."""
        return self._take("read").received

    def waiting(self) -> int:
        """Return the recorded number of waiting bytes."""
        return int.from_bytes(self._take("waiting").received)

    def discard(self) -> None:
        """Consume the recorded discard."""
        self._take("discard")

    def _take(self, name: str, sent: bytes = b"") -> Operation:
        operation = self._playback.take(self._device, name, sent)
        if operation.error:
            raise SerialException(int(operation.error), "the port was gone in the record, too")
        return operation


class ReplayedBus:
    """The recorded far end of one device's view of an I2C bus."""

    def __init__(self, device: str, playback: Playback) -> None:
        self._device = device
        self._playback = playback

    def read_byte(self, i2c_addr: int) -> int:
        """Give the recorded byte."""
        return self._take("read_byte", bytes([i2c_addr]))[0]

    def write_byte(self, i2c_addr: int, value: int) -> None:
        """Compare with the record."""
        self._take("write_byte", bytes([i2c_addr, value]))

    def read_byte_data(self, i2c_addr: int, register: int) -> int:
        """Give the recorded byte."""
        return self._take("read_byte_data", bytes([i2c_addr, register]))[0]

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Compare with the record."""
        self._take("write_byte_data", bytes([i2c_addr, register, value]))

    def read_word_data(self, i2c_addr: int, register: int) -> int:
        """Give the recorded word."""
        return int.from_bytes(self._take("read_word_data", bytes([i2c_addr, register])), "little")

    def write_word_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Compare with the record."""
        self._take("write_word_data", bytes([i2c_addr, register]) + value.to_bytes(2, "little"))

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Give the recorded bytes."""
        return list(self._take("read_i2c_block_data", bytes([i2c_addr, register, length])))

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Compare with the record."""
        self._take("write_i2c_block_data", bytes([i2c_addr, register, *data]))

    def i2c_rdwr(self, *i2c_msgs: i2c_msg) -> None:
        """Compare the writes with the record, and fill the reads from it."""
        received = self._take("i2c_rdwr", message_bytes(i2c_msgs))
        for message in (message for message in i2c_msgs if message.flags & _READ_FLAG):
            ctypes.memmove(message.buf, received, min(message.len, len(received)))
            received = received[message.len :]

    def _take(self, name: str, sent: bytes) -> bytes:
        operation = self._playback.take(self._device, name, sent)
        if operation.error:
            raise OSError(int(operation.error), os.strerror(int(operation.error)))
        return operation.received
