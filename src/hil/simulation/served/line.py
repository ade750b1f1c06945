"""A byte stream of a served bench, with the bytes that are on their way on it."""

from __future__ import annotations

from collections import deque

from hil.clock.port import NANOSECONDS
from hil.wire.peer import Openable, PeerClock, SerialPeer

__all__ = ["ServedLine"]

_BITS_PER_BYTE = 10
_BUFFER = 4096
_PIECE = 256
_NETWORK_NS_PER_BYTE = 100_000
_NETWORK_AHEAD_NS = 100_000_000


class ServedLine:
    """The line between an open end and its peer, with the same speed as in the process of a run.

    Every byte takes the time of its bits, in both directions. A network takes no time, but no more than a kilobyte at
    once and ten kilobytes a second after that, as the processor of an instrument would. What a client writes ahead of
    that waits in the operating system, and what it does not fetch overflows.

    Args:
        device: the instrument's name.
        baud: bits per second, 0 for a network.

    Attributes:
        outbox: bytes that have arrived at the client's side; whoever gives them to the client removes them.
        lost: how many bytes overflowed.
        is_open: whether a client is there.
    """

    def __init__(self, device: str, baud: int) -> None:
        self.device = device
        self.outbox = bytearray()
        self.lost = 0
        self.is_open = False
        self._ns_per_byte = round(_BITS_PER_BYTE * NANOSECONDS / baud) if baud else 0
        self._to_peer: deque[tuple[int, bytes]] = deque()
        self._to_client: deque[tuple[int, bytes]] = deque()
        self._peer_free_ns = 0
        self._client_free_ns = 0
        self._peer: SerialPeer
        self._clock: PeerClock

    def connect(self, peer: SerialPeer, clock: PeerClock) -> None:
        """Belong to a peer, at first or in the place of an equal one; bytes on their way stay on it."""
        self._peer, self._clock = peer, clock
        for when_ns, _ in self._to_peer:
            clock.at(when_ns, self._reach_peer)
        for when_ns, _ in self._to_client:
            clock.at(when_ns, self._reach_client)

    def opened(self) -> None:
        """Start with an empty buffer, and let the peer notice where it can."""
        self.is_open = True
        self.outbox.clear()
        if isinstance(self._peer, Openable):
            self._peer.opened()

    def closed(self) -> None:
        """Drop what comes from now on."""
        self.is_open = False
        self.outbox.clear()

    @property
    def room(self) -> int:
        """How many bytes the line takes from the client now; 0 while it is still busy with earlier ones."""
        ahead_ns = self._peer_free_ns - self._clock.now_ns()
        return _PIECE if ahead_ns <= (0 if self._ns_per_byte else _NETWORK_AHEAD_NS) else 0

    @property
    def room_at_ns(self) -> int:
        """When the line takes bytes again."""
        return self._peer_free_ns - (0 if self._ns_per_byte else _NETWORK_AHEAD_NS)

    def take(self, data: bytes) -> None:
        """Take bytes from the client, at most `room`; the peer has them when their last bit has arrived."""
        now_ns = self._clock.now_ns()
        arrives_ns = max(now_ns, self._peer_free_ns) + len(data) * self._ns_per_byte if self._ns_per_byte else now_ns
        per_byte_ns = self._ns_per_byte or _NETWORK_NS_PER_BYTE
        self._peer_free_ns = max(now_ns, self._peer_free_ns) + len(data) * per_byte_ns
        self._to_peer.append((arrives_ns, data))
        self._clock.at(arrives_ns, self._reach_peer)

    def send(self, data: bytes, after_ns: int = 0) -> None:
        """Take bytes from the peer; the first leaves after `after_ns`, behind what is still being sent."""
        start_ns = max(self._clock.now_ns() + after_ns, self._client_free_ns)
        self._client_free_ns = arrives_ns = start_ns + len(data) * self._ns_per_byte
        self._to_client.append((arrives_ns, data))
        self._clock.at(arrives_ns, self._reach_client)

    def _reach_peer(self) -> None:
        _, data = self._to_peer.popleft()
        self._peer.receive(data)

    def _reach_client(self) -> None:
        _, data = self._to_client.popleft()
        if self.is_open:
            room = max(0, _BUFFER - len(self.outbox))
            self.lost += max(0, len(data) - room)
            self.outbox += data[:room]
