"""Wrappers that inject link faults into any peer, whichever package the kind of fault is from."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

from hil.analysis.noise.numbers import RandomStream
from hil.simulation.faults import Chatty, Faults, LinkFault
from hil.simulation.peers.timing import Alarms
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import BusPeer, BusServer, Line, Nack, Openable, PeerClock, SerialPeer

__all__ = ["FaultyBusPeer", "FaultySerialPeer"]


class FaultySerialPeer(Stateful):
    """A peer on a byte stream with injected link faults.

    Dead means without power: nothing is received or sent. Faults are evaluated at the instant a byte
    would leave.

    Args:
        peer: the healthy peer.
        faults: what goes wrong.
        noise: decides which bits are hit.

    Attributes:
        receive: takes bytes; those of the peer itself unless it is dead at times.
    """

    _peer: Kept[SerialPeer]
    _chats: Kept[Alarms]

    def __init__(self, peer: SerialPeer, faults: Faults, noise: RandomStream) -> None:
        self._peer = peer
        self._faults = faults
        self._noise = noise
        self.receive: Callable[[bytes], None] = self._take if faults.faults else peer.receive
        self._chatty = faults.of(Chatty)
        self._line: Line
        self._clock: PeerClock

    def serve(self, peers: Sequence[BusPeer]) -> None:
        """Put devices on the bus that the peer serves."""
        if isinstance(self._peer, BusServer):
            self._peer.serve(peers)

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect the peer through its faults, and start unsolicited output."""
        self._line = line
        self._clock = clock
        # A peer that nothing is wrong with talks to the line itself.
        self._peer.attach(self if self._faults.faults else line, clock)
        starts = [self._next_chat_ns(fault, fault.start_ns) for fault in self._chatty]
        self._chats = Alarms(clock, [(when, partial(self._chat, place)) for place, when in enumerate(starts)])

    def opened(self) -> None:
        """Let the peer notice that its port was opened, where it can and is not dead."""
        if isinstance(self._peer, Openable) and not _cut(self._faults, self._clock.now_ns()):
            self._peer.opened()

    def _take(self, data: bytes) -> None:
        """Pass bytes on, unless the peer is dead."""
        if not _cut(self._faults, self._clock.now_ns()):
            self._peer.receive(data)

    def send(self, data: bytes, after_ns: int = 0) -> None:
        """Spoil what the peer sends, as a line that the peer takes for the real one."""
        now_ns = self._clock.now_ns()
        if _cut(self._faults, now_ns):
            return
        for fault in _holding(self._faults, now_ns):
            data, after_ns = fault.spoiled(data, self._noise, now_ns), after_ns + fault.delay_ns
        if data:
            self._line.send(data, after_ns)

    def _next_chat_ns(self, fault: Chatty, earliest_ns: int) -> int | None:
        """Return when a chatty peer speaks next, None once it is over."""
        late_by_ns = max(0, self._clock.now_ns() - fault.start_ns)
        pauses = -(-late_by_ns // fault.every_ns)
        when_ns = max(earliest_ns, fault.start_ns + pauses * fault.every_ns)
        return when_ns if when_ns < fault.end_ns else None

    def _chat(self, place: int) -> None:
        fault, now_ns = self._chatty[place], self._clock.now_ns()
        if not _cut(self._faults, now_ns):
            self._line.send(fault.text.encode("utf-8"))
        self._chats.set(place, self._next_chat_ns(fault, now_ns + fault.every_ns))


class FaultyBusPeer(Stateful):
    """A device on an I2C bus with injected link faults.

    Args:
        peer: the healthy peer.
        faults: what goes wrong.
        noise: decides which bits are hit.

    Attributes:
        write: takes one write message; the peer's own where nothing is wrong with its link.
        read: gives one read message, likewise.
    """

    _peer: Kept[BusPeer]

    def __init__(self, peer: BusPeer, faults: Faults, noise: RandomStream) -> None:
        self._peer = peer
        self._faults = faults
        self._noise = noise
        wrong = bool(faults.of(LinkFault))
        self.write: Callable[[int, bytes], None] = self._write if wrong else peer.write
        self.read: Callable[[int, int], bytes] = self._read if wrong else peer.read
        self._clock: PeerClock

    @property
    def addresses(self) -> tuple[int, ...]:
        """The addresses of the peer."""
        return self._peer.addresses

    def attach(self, clock: PeerClock) -> None:
        """Connect the peer through its faults."""
        self._clock = clock
        self._peer.attach(clock)

    def on_interrupt(self, callback: Callable[[], None]) -> None:
        """Pass the rising edges of the device's interrupt pin on, where it has one, unless the device is dead."""
        listen = getattr(self._peer, "on_interrupt", None)
        if listen is not None:
            listen(lambda: None if _cut(self._faults, self._clock.now_ns()) else callback())

    def remembers(self, register: int, length: int) -> bool:
        """Return whether the peer can tell what its registers held before now, which one with faults cannot."""
        able = getattr(self._peer, "remembers", None)
        return not self._faults.faults and able is not None and bool(able(register, length))

    def remembered(self, register: int, length: int, times_ns: Sequence[int]) -> list[bytes]:
        """Return what the peer's registers held at rising instants, if it `remembers` them."""
        found: list[bytes] = getattr(self._peer, "remembered")(register, length, times_ns)  # noqa: B009
        return found

    def _write(self, address: int, data: bytes) -> None:
        """Pass a message on, unless the device is dead."""
        self._live()
        self._peer.write(address, data)

    def _read(self, address: int, count: int) -> bytes:
        """Pass a reply on, spoiled where the fault says so."""
        self._live()
        data = self._peer.read(address, count)
        for fault in _holding(self._faults, self._clock.now_ns()):
            data = fault.spoiled(data, self._noise, self._clock.now_ns())
        return data

    def _live(self) -> None:
        if _cut(self._faults, self._clock.now_ns()):
            raise Nack


def _holding(faults: Faults, now_ns: int) -> Iterator[LinkFault]:
    """Yield the first fault of each kind that holds."""
    seen: set[type[LinkFault]] = set()
    for fault in faults.of(LinkFault):
        if fault.holds(now_ns) and type(fault) not in seen:
            seen.add(type(fault))
            yield fault


def _cut(faults: Faults, now_ns: int) -> bool:
    return any(fault.cuts for fault in _holding(faults, now_ns))
