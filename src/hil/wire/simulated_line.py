"""Simulated byte stream: line speed, finite receive buffer, and the peer at its far end."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

from hil.clock.port import NANOSECONDS, ClockError
from hil.clock.virtual import VirtualClock
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import Openable, SerialPeer

__all__ = ["SimulatedLine"]

_BITS_PER_BYTE = 10
_MOST_LOOKS_AT_ONE_INSTANT = 100_000


class SimulatedLine(Stateful):
    """The stream between a port and its peer.

    Both directions take the time of their bits at `baud`; 0 stands for a network, whose latency is
    the peer's own. Bytes that the host does not fetch overflow after `buffer` bytes: they are lost,
    as in a driver's ring buffer, and counted in `lost`. On a network they wait at the other end, and
    nothing is lost.

    Args:
        device: the instrument's name, for messages.
        peer: the simulated instrument.
        clock: the bench's clock.
        number: the device's position in the bench file; it orders simultaneous events.
        baud: bits per second, 0 for a network.
        buffer: size of the host's receive buffer in bytes.
    """

    _received: Kept[bytearray]
    _on_the_way: Kept[deque[tuple[int, bytes]]]
    _free_at_ns: Kept[int]
    _lost: Kept[int]
    _open: Kept[bool]

    def __init__(
        self, device: str, peer: SerialPeer, clock: VirtualClock, *, number: int = 0, baud: int = 0, buffer: int = 4096
    ) -> None:
        self.device = device
        self._lost = 0
        self._peer = peer
        self._clock = clock
        self._number = number
        self._now_ns = clock.now_ns
        self._ns_per_byte = round(_BITS_PER_BYTE * NANOSECONDS / baud) if baud else 0
        self._buffer = buffer
        self._received = bytearray()
        self._free_at_ns = 0
        self._last_look_ns = -1
        self._looks = 0
        self._on_the_way = deque()
        self._awaited = False
        self._open = False

    @property
    def lost(self) -> int:
        """Number of bytes lost by overflow."""
        self._arrive()
        return self._lost

    @property
    def quiet(self) -> bool:
        """Whether no byte is in transit to the host."""
        self._arrive()
        return not self._on_the_way

    def opened(self) -> None:
        """Start with an empty buffer, and notify the peer if it detects opening."""
        self.discard()
        self._open = True
        self.dtr_rose()

    def dtr_rose(self) -> None:
        """Notify the peer if it detects DTR, as at opening; received bytes stay."""
        if isinstance(self._peer, Openable):
            self._peer.opened()

    def closed(self) -> None:
        """Drop all further bytes."""
        self._arrive()
        self._open = False

    def write(self, data: bytes) -> None:
        """Let the time of the bits pass, then pass the bytes to the peer."""
        if self._ns_per_byte:
            self._clock.wait_until(self._now_ns() + len(data) * self._ns_per_byte)
        self._peer.receive(data)

    def exchange(self, data: bytes, timeout: float) -> bytes:
        """Write, let time pass until a byte arrives or the timeout expires, and return the received bytes."""
        deadline_ns = self._now_ns() + round(timeout * NANOSECONDS)
        self.write(data)
        if self._on_the_way:
            self._arrive()
        if not self._received and self._now_ns() < deadline_ns:
            self._wait(1, deadline_ns)
        received = bytes(self._received)
        self._received.clear()
        return received

    def read(self, size: int, timeout: float) -> bytes:
        """Let time pass until `size` bytes have arrived, or the timeout expires."""
        if self._on_the_way:
            self._arrive()
        received = self._received
        if timeout and len(received) < size:
            self._wait(size, self._now_ns() + round(timeout * NANOSECONDS))
        data = bytes(received[:size])
        del received[:size]
        return data

    def waiting(self) -> int:
        """Return the number of received bytes; polling for ever without letting time pass is an error."""
        now_ns = self._now_ns()
        self._looks = self._looks + 1 if now_ns == self._last_look_ns else 0
        self._last_look_ns = now_ns
        if self._looks > _MOST_LOOKS_AT_ONE_INSTANT:
            raise ClockError(f"{self.device} is polled for ever at {self._clock.now():.9f} s without letting time pass")
        self._arrive()
        return len(self._received)

    def discard(self) -> None:
        """Discard received bytes."""
        self._arrive()
        self._received.clear()

    def send(self, data: bytes, after_ns: int = 0) -> None:
        """Take bytes from the peer; the first leaves after `after_ns`, after what is still being sent."""
        start_ns = self._now_ns() + after_ns
        start_ns = max(start_ns, self._free_at_ns)
        self._free_at_ns = arrives_ns = start_ns + len(data) * self._ns_per_byte
        self._on_the_way.append((arrives_ns, data))
        if self._awaited:
            self._clock.at(arrives_ns, self._arrive, device=self._number)

    def state(self) -> Mapping[str, object]:
        """Return everything that the line needs to continue, as JSON values."""
        self._arrive()
        return super().state()

    def _wait(self, size: int, deadline_ns: int) -> None:
        """Let time pass until `size` bytes have arrived, with an event at each arrival."""
        for arrives_ns, _ in self._on_the_way:
            self._clock.at(arrives_ns, self._arrive, device=self._number)
        self._awaited = True
        try:
            self._clock.run(deadline_ns, lambda: len(self._received) >= size, self.device)
        finally:
            self._awaited = False
        self._arrive()

    def _arrive(self) -> None:
        """Receive the bytes that have arrived by now; unobserved arrivals need no events."""
        way = self._on_the_way
        if not way:
            return
        now_ns = self._now_ns()
        if way[0][0] > now_ns:
            return
        received = self._received
        before = len(received)
        waits = self._open and not self._ns_per_byte
        while way and way[0][0] <= now_ns:
            if waits and len(received) + len(way[0][1]) > self._buffer:
                self._fill(received)
                return
            received += way.popleft()[1]
        if not self._open:
            del received[before:]
        elif (surplus := len(received) - self._buffer) > 0:
            self._lost += surplus
            del received[self._buffer :]

    def _fill(self, received: bytearray) -> None:
        """Take as much of the next message as there is room for."""
        arrives_ns, data = self._on_the_way[0]
        room = self._buffer - len(received)
        received += data[:room]
        self._on_the_way[0] = (arrives_ns, data[room:])
