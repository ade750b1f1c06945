"""What a port or bus asks of the simulated instrument at its other end."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, runtime_checkable

__all__ = ["BusPeer", "BusServer", "Cancellable", "Line", "Nack", "Openable", "PeerClock", "SerialPeer"]


class Nack(Exception):
    """A bus peer does not acknowledge: absent, unpowered, asleep, or busy."""


class Cancellable(Protocol):
    """An event that can be taken back."""

    @property
    def number(self) -> int:
        """Its place among the events of one peer at one instant."""
        ...

    def cancel(self) -> None:
        """Take it back."""
        ...


class PeerClock(Protocol):
    """The part of the bench's clock that a peer sees: what time it is, `at` to act later, how long nobody else acts."""

    def now_ns(self) -> int:
        """Return the nanoseconds since the bench's epoch."""
        ...

    def at(self, when_ns: int, action: Callable[[], None], number: int | None = None) -> Cancellable:
        """Let `action` happen at `when_ns`; an event that is restored keeps the `number` that it had."""
        ...

    def calm_until_ns(self) -> int:
        """Return the last instant up to which nothing else happens; asked during an action."""
        ...


class Line(Protocol):
    """The peer's way to the host."""

    def send(self, data: bytes, after_ns: int = 0) -> None:
        """Give bytes to the host; the first leaves `after_ns` from now, the line's speed is added."""
        ...


class SerialPeer(Protocol):
    """A simulated instrument on a byte stream: a byte-level state machine written from its manual."""

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect the peer to its line and clock, once, before anything else."""
        ...

    def receive(self, data: bytes) -> None:
        """Take bytes that the host wrote, in whatever pieces they come; never reads the future."""
        ...

    def state(self) -> Mapping[str, object]:
        """Return everything that the peer would need to continue, as JSON values."""
        ...

    def restore(self, state: Mapping[str, object]) -> None:
        """Continue from what `state` returned, also if this peer has more faults: added ones come last."""
        ...


@runtime_checkable
class Openable(Protocol):
    """A simulated instrument that notices when its port is opened, because DTR rises."""

    def opened(self) -> None:
        """Notice it."""
        ...


class BusPeer(Protocol):
    """A simulated device on an I2C bus, at register level."""

    @property
    def addresses(self) -> tuple[int, ...]:
        """The 7-bit addresses that it answers to."""
        ...

    def attach(self, clock: PeerClock) -> None:
        """Connect the peer to its clock, once, before anything else."""
        ...

    def write(self, address: int, data: bytes) -> None:
        """Take one write message; raises Nack where the device would not acknowledge."""
        ...

    def read(self, address: int, count: int) -> bytes:
        """Give one read message of `count` bytes; raises Nack where the device would not acknowledge."""
        ...

    def state(self) -> Mapping[str, object]:
        """Return everything that the peer would need to continue, as JSON values."""
        ...

    def restore(self, state: Mapping[str, object]) -> None:
        """Continue from what `state` returned, also if this peer has more faults: added ones come last."""
        ...


@runtime_checkable
class BusServer(Protocol):
    """A simulated instrument that serves an I2C bus of its own."""

    def serve(self, peers: Sequence[BusPeer]) -> None:
        """Put devices on its bus, once, before it is attached."""
        ...
