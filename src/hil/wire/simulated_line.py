"""A simulated byte stream: the line's speed, its finite buffer, and the peer at its end."""

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

    Both directions take the time that their bits take at `baud`; 0 stands for a network, whose
    latency is the peer's own. What the host does not fetch overflows after `buffer` bytes: the
    bytes are lost, as they are in a driver's ring, and counted in `lost`. Of a network they wait at
    the other end, and nothing is lost.

    Args:
        device: the instrument's name, for messages.
        peer: the simulated instrument.
        clock: the bench's clock.
        number: the device's place in the bench file; it orders events of one instant.
        baud: bits per second, 0 for a network.
        buffer: bytes that the host's side holds.
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
        """How many bytes overflowed."""
        self._arrive()
        return self._lost

    @property
    def quiet(self) -> bool:
        """Whether no byte is on its way to the host."""
        self._arrive()
        return not self._on_the_way

    def opened(self) -> None:
        """Start with an empty buffer, and let the peer notice where it can."""
        self.discard()
        self._open = True
        self.dtr_rose()

    def dtr_rose(self) -> None:
        """Let the peer notice where it can, as when the port is opened; what was received stays."""
        if isinstance(self._peer, Openable):
            self._peer.opened()

    def closed(self) -> None:
        """Drop what comes from now on."""
        self._arrive()
        self._open = False

    def write(self, data: bytes) -> None:
        """Let the bits take their time, then give the bytes to the peer."""
        if self._ns_per_byte:
            self._clock.wait_until(self._now_ns() + len(data) * self._ns_per_byte)
        self._peer.receive(data)

    def exchange(self, data: bytes, timeout: float) -> bytes:
        """Write, let time pass until a byte is here or the timeout is over, and give what is here."""
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
        """Let time pass until `size` bytes are here, or until the timeout."""
        if self._on_the_way:
            self._arrive()
        received = self._received
        if timeout and len(received) < size:
            self._wait(size, self._now_ns() + round(timeout * NANOSECONDS))
        data = bytes(received[:size])
        del received[:size]
        return data

    def waiting(self) -> int:
        """Return the bytes at hand; looking for ever without letting time pass is an error."""
        now_ns = self._now_ns()
        self._looks = self._looks + 1 if now_ns == self._last_look_ns else 0
        self._last_look_ns = now_ns
        if self._looks > _MOST_LOOKS_AT_ONE_INSTANT:
            raise ClockError(f"{self.device} is polled for ever at {self._clock.now():.9f} s without letting time pass")
        self._arrive()
        return len(self._received)

    def discard(self) -> None:
        """Throw received bytes away."""
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
        """Let time pass until so many bytes are here, with an event wherever some arrive."""
        for arrives_ns, _ in self._on_the_way:
            self._clock.at(arrives_ns, self._arrive, device=self._number)
        self._awaited = True
        try:
            self._clock.run(deadline_ns, lambda: len(self._received) >= size, self.device)
        finally:
            self._awaited = False
        self._arrive()

    def _arrive(self) -> None:
        """Take the bytes that have come by now; while nobody looks, nothing has to happen for them."""
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
