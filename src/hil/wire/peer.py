"""Interfaces between a port or bus and the simulated instrument at its far end."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, runtime_checkable

__all__ = ["BusPeer", "BusServer", "Cancellable", "Line", "Nack", "Openable", "PeerClock", "SerialPeer"]


class Nack(Exception):
    """A bus peer does not acknowledge: absent, unpowered, asleep, or busy."""


class Cancellable(Protocol):
    """A scheduled event that can be cancelled."""

    @property
    def number(self) -> int:
        """Its place among the events of one peer at one instant."""
        ...

    def cancel(self) -> None:
        """Cancel the event."""
        ...


class PeerClock(Protocol):
    """A peer's view of the bench's clock: present time, scheduling of events, and time until any other event."""

    def now_ns(self) -> int:
        """Return the nanoseconds since the bench's epoch."""
        ...

    def at(self, when_ns: int, action: Callable[[], None], number: int | None = None) -> Cancellable:
        """Schedule `action` at `when_ns`; a restored event keeps its `number`."""
        ...

    def calm_until_ns(self) -> int:
        """Return the last instant before any other event; called during an action."""
        ...


class Line(Protocol):
    """The peer's transmit path to the host."""

    def send(self, data: bytes, after_ns: int = 0) -> None:
        """Send bytes to the host; the first leaves after `after_ns`, plus the time on the line."""
        ...


class SerialPeer(Protocol):
    """A simulated instrument on a byte stream: a byte-level state machine written from its manual."""

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect the peer to its line and clock, once, before anything else."""
        ...

    def receive(self, data: bytes) -> None:
        """Take bytes written by the host, in chunks of any size; causal: never uses later bytes."""
        ...

    def state(self) -> Mapping[str, object]:
        """Return everything that the peer needs to continue, as JSON values."""
        ...

    def restore(self, state: Mapping[str, object]) -> None:
        """Continue from what `state` returned, even if this peer has additional faults, which come last."""
        ...


@runtime_checkable
class Openable(Protocol):
    """A simulated instrument that detects the opening of its port by the rise of DTR."""

    def opened(self) -> None:
        """Note the opening of the port."""
        ...


class BusPeer(Protocol):
    """A simulated device on an I2C bus, at register level."""

    @property
    def addresses(self) -> tuple[int, ...]:
        """The 7-bit addresses to which it responds."""
        ...

    def attach(self, clock: PeerClock) -> None:
        """Connect the peer to its clock, once, before anything else."""
        ...

    def write(self, address: int, data: bytes) -> None:
        """Take one write message; raises Nack where the device would not acknowledge."""
        ...

    def read(self, address: int, count: int) -> bytes:
        """Return one read message of `count` bytes; raises Nack where the device would not acknowledge."""
        ...

    def state(self) -> Mapping[str, object]:
        """Return everything that the peer needs to continue, as JSON values."""
        ...

    def restore(self, state: Mapping[str, object]) -> None:
        """Continue from what `state` returned, even if this peer has additional faults, which come last."""
        ...


@runtime_checkable
class BusServer(Protocol):
    """A simulated instrument that serves its own I2C bus."""

    def serve(self, peers: Sequence[BusPeer]) -> None:
        """Put devices on its bus, once, before it is attached."""
        ...
