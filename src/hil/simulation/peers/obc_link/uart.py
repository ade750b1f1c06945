"""The simulated board's UART: frames one after the other, replies first, stream frames out of a ring of finite size."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

from hil.model.notation import whole
from hil.simulation.faults import Fault, Faults
from hil.simulation.peers.alarm import Alarm, Alarms
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import Line, PeerClock

__all__ = ["LoseFrames", "Stall", "Uart"]


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

    The fault `stall` lets stream frames wait while it lasts, so that the ring overflows; replies go on. The fault
    `lose-frames` lets the line swallow as many stream frames as it says, without the board knowing.

    Args:
        ns_per_byte: what a byte takes.
        ring: bytes that stream frames may take, the one that is being sent included.
        faults: what goes wrong.
        drained: told whenever no stream frame waits any more.
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
