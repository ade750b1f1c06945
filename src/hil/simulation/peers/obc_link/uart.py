"""Frames of the OBC link as the simulated board makes and takes them, and the UART that sends them."""

from __future__ import annotations

import binascii
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Annotated

from hil.model.notation import whole
from hil.simulation.faults import Fault, Faults
from hil.simulation.peers.timing import Alarm, Alarms
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import Line, PeerClock

__all__ = ["LARGEST", "OVERHEAD", "VERSION", "Frame", "FrameReader", "LoseFrames", "Stall", "Uart", "seal"]

VERSION = 1
OVERHEAD = 6
"""Bytes of a frame around its payload: version, type, sequence, CRC."""

LARGEST = 2048
"""The longest frame before stuffing."""

_LONGEST_ON_LINE = LARGEST + -(-LARGEST // 254)
_FULL = 254
_CODES = tuple(bytes([length + 1]) for length in range(_FULL))


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One frame that arrived whole."""

    version: int
    kind: int
    sequence: int
    payload: bytes


class FrameReader(Stateful):
    """Cuts what arrives at its delimiters; how the bytes are cut on their way does not matter."""

    _held: Kept[bytearray]

    def __init__(self) -> None:
        self._held = bytearray()

    def take(self, data: bytes) -> Iterator[tuple[int, Frame | None]]:
        """Yield what ends in `data`: how many bytes of it come later, and the frame, None if it is unusable."""
        start = 0
        while (end := data.find(0, start)) >= 0:
            self._hold(data[start:end])
            if self._held:
                yield len(data) - end - 1, _opened(bytes(self._held))
            self._held.clear()
            start = end + 1
        self._hold(data[start:])

    def clear(self) -> None:
        """Forget what has not ended."""
        self._held.clear()

    def _hold(self, data: bytes) -> None:
        # One byte more than a frame can have is enough to know that it is none.
        self._held += data[: _LONGEST_ON_LINE + 1 - len(self._held)]


def seal(kind: int, sequence: int, payload: bytes) -> bytes:
    """Return a frame as it stands on the line, delimiter included."""
    body = bytes([VERSION, kind]) + sequence.to_bytes(2, "little") + payload
    return _stuffed(body + _checksum(body)) + b"\0"


def _checksum(data: bytes) -> bytes:
    return binascii.crc_hqx(data, 0xFFFF).to_bytes(2, "little")


def _stuffed(data: bytes) -> bytes:
    """Return the bytes by COBS: each run up to a zero after its length, full runs without a zero after them."""
    *runs, last = data.split(b"\0")
    parts = [
        _CODES[0] if not run else _CODES[len(run)] + run if len(run) < _FULL else _full_blocks(run) + _rest(run)
        for run in runs  # most are empty: a sensor that sleeps gives zeros
    ]
    # A full run at the very end needs nothing after it; before a zero it does, for the zero's sake.
    end = b"" if last and len(last) % _FULL == 0 else _rest(last)
    return b"".join(parts) + _full_blocks(last) + end


def _rest(run: bytes) -> bytes:
    """Return what follows the full blocks of a run, with its code."""
    rest = run[len(run) // _FULL * _FULL :]
    return _CODES[len(rest)] + rest


def _full_blocks(run: bytes) -> bytes:
    ends = range(_FULL, len(run) + 1, _FULL)
    return b"".join(b"\xff" + run[end - _FULL : end] for end in ends)


def _unstuffed(data: bytes) -> bytes | None:
    plain = bytearray()
    place = code = 0
    while place < len(data):
        code = data[place]
        if place + code > len(data):
            return None
        plain += data[place + 1 : place + code]
        place += code
        if code <= _FULL:
            plain.append(0)
    # The zero of the last block stands for the end; a full last block has none.
    return bytes(plain[:-1] if code <= _FULL else plain)


def _opened(data: bytes) -> Frame | None:
    frame = _unstuffed(data) if len(data) <= _LONGEST_ON_LINE else None
    if frame is None or not OVERHEAD <= len(frame) <= LARGEST or _checksum(frame[:-2]) != frame[-2:]:
        return None
    return Frame(version=frame[0], kind=frame[1], sequence=int.from_bytes(frame[2:4], "little"), payload=frame[4:-2])


@dataclass(frozen=True, slots=True, kw_only=True)
class LoseFrames(Fault):
    """As many frames as it says never arrive."""

    name = "lose-frames"

    frames: Annotated[int, whole(1)] = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Stall(Fault):
    """Stream frames wait."""

    name = "stall"


class Uart(Stateful):
    """Sends whole frames.

    The fault `stall` lets stream frames wait while it lasts, so that the ring overflows; replies continue. The fault
    `lose-frames` lets the line swallow as many stream frames as it says, without the board knowing.

    Args:
        ns_per_byte: what a byte takes.
        ring: bytes that stream frames may take, the one that is being sent included.
        faults: what goes wrong.
        drained: called whenever no stream frame waits any more.
    """

    _first: Kept[deque[bytes]]
    _waiting: Kept[deque[bytes]]
    _sending: Kept[int]
    _swallowed: Kept[list[int]]
    _free: Kept[Alarm]
    _stalled: Kept[Alarms]

    def __init__(self, ns_per_byte: int, ring: int, faults: Faults, drained: Callable[[], None]) -> None:
        self.ns_per_byte = ns_per_byte
        self._ring = ring
        self._faults = faults
        self._drained = drained
        self._first = deque()
        self._waiting = deque()
        self._sending = 0
        self._swallowed = [0] * len(faults.of(LoseFrames))
        self._line: Line
        self._clock: PeerClock

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect the line."""
        self._line = line
        self._clock = clock
        self._free = Alarm(clock, self._sent)
        self._stalled = Alarms(clock, [(fault.end_ns, self._next) for fault in self._faults.of(Stall)])

    @property
    def holds_stream(self) -> bool:
        """Whether a stream frame waits; the one that is being sent is on its way."""
        return bool(self._waiting)

    def free_ns(self) -> int:
        """Return when a reply that comes now can leave."""
        now_ns = self._clock.now_ns()
        if self._free.due_ns is None:
            return now_ns
        return self._free.due_ns + sum(map(len, self._first)) * self.ns_per_byte

    def send(self, frame: bytes) -> None:
        """Send a frame before the stream frames that wait."""
        self._first.append(frame)
        self._next()

    def stream(self, frame: bytes) -> bool:
        """Let a stream frame wait in the ring; return whether there was room for it."""
        if self._sending + sum(map(len, self._waiting)) + len(frame) > self._ring:
            return False
        self._waiting.append(frame)
        self._next()
        return True

    @property
    def idle(self) -> bool:
        """Whether nothing is sent or waits, and nothing goes wrong with what is sent at any time."""
        return self._free.due_ns is None and not self._first and not self._waiting and not self._faults.faults

    def streamed(self, frame: bytes, at_ns: int) -> None:
        """Let a stream frame have left at an instant of the past, at which nothing else was sent."""
        self._line.send(frame, at_ns - self._clock.now_ns())

    def discard(self) -> None:
        """Throw the stream frames away that wait."""
        self._waiting.clear()

    def reset(self) -> None:
        """Throw everything away; what is on the line already arrives."""
        self._first.clear()
        self._waiting.clear()
        self._sending = 0

    def restored(self) -> None:
        """Count for faults that were added since, too."""
        self._swallowed += [0] * (len(self._faults.of(LoseFrames)) - len(self._swallowed))

    def _sent(self) -> None:
        self._sending = 0
        self._next()

    def _next(self) -> None:
        if self._free.due_ns is not None:
            return
        if self._first:
            self._put(self._first.popleft())
        elif self._waiting and not self._faults.now(Stall, self._clock.now_ns()):
            frame = self._waiting.popleft()
            self._sending = len(frame)
            self._put(frame, swallowed=self._swallow())
            if not self._waiting:
                self._drained()

    def _put(self, frame: bytes, *, swallowed: bool = False) -> None:
        if not swallowed:
            self._line.send(frame)
        self._free.set(self._clock.now_ns() + len(frame) * self.ns_per_byte)

    def _swallow(self) -> bool:
        for place, fault in enumerate(self._faults.of(LoseFrames)):
            if fault.holds(self._clock.now_ns()) and self._swallowed[place] < fault.frames:
                self._swallowed[place] += 1
                return True
        return False
