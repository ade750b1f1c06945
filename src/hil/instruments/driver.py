"""What every driver is: made from a connection, it identifies its instrument and fills roles."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol, runtime_checkable

from hil.clock.port import Clock
from hil.instruments.safing import LONGEST_REPLY_S
from hil.model.bench import Clamp, Wire
from hil.model.errors import ClampExceeded
from hil.model.identity import Identity
from hil.wire.port import I2cBus, Port
from hil.wire.streaming import StreamingBus

__all__ = [
    "ANY_BYTE",
    "OVER_VOLTAGE_LEVEL",
    "TERMINATED",
    "Clamps",
    "Connection",
    "Driver",
    "NamesInputs",
    "OpenedAnew",
    "Outlet",
    "ServesBus",
    "Strap",
    "Strapped",
    "offers",
]

ANY_BYTE = "any-byte"
"""A capability: a protocol in which every value of a byte occurs, so that a line may keep none for itself."""

TERMINATED = "terminated"
"""A capability: lines of text, and the bench file may say what ends them."""

OVER_VOLTAGE_LEVEL = "over-voltage-level"
"""A capability: a supply whose over-voltage protection has a level of its own, apart from the voltage that is set."""


@dataclass(frozen=True, slots=True)
class Outlet:
    """One output as arm finds it: the channel (0 for the whole instrument) and whether it is on."""

    channel: int
    on: bool


@dataclass(frozen=True, slots=True)
class Strap:
    """How one address of a device on a bus is chosen.

    Attributes:
        pin: that sets it, empty where it cannot be chosen.
        addresses: that there are, the usual one first; none where they are not known.
    """

    pin: str
    addresses: tuple[int, ...]


class Clamps:
    """The clamps on one instrument's outputs; asked with every setting before its bytes leave.

    Args:
        clamps: per channel, the clamps of the wires on it.
    """

    def __init__(self, clamps: dict[int, tuple[Clamp, ...]] | None = None) -> None:
        self._clamps = clamps or {}

    def permit(self, channel: int, quantity: str, value: float) -> None:
        """Return if the setting is allowed; raise ClampExceeded otherwise, NaN always."""
        for clamp in self._clamps.get(channel, ()):
            if clamp.quantity == quantity and not clamp.minimum <= value <= clamp.maximum:
                raise ClampExceeded(
                    f"{clamp.output}: {quantity} {value:g} {clamp.unit} is outside its clamp"
                    f" {clamp.minimum:g} to {clamp.maximum:g} {clamp.unit}",
                    "change the setting, or the clamp in the bench file after a review",
                )

    def bounds(self, channel: int, quantity: str) -> tuple[float, float]:
        """Return the least and the most that every clamp of a quantity allows, infinite if there is none."""
        clamps = [clamp for clamp in self._clamps.get(channel, ()) if clamp.quantity == quantity]
        least = max((clamp.minimum for clamp in clamps), default=-math.inf)
        return least, min((clamp.maximum for clamp in clamps), default=math.inf)


@dataclass(frozen=True, slots=True, kw_only=True)
class Connection:
    """How a driver reaches its instrument.

    Attributes:
        device: the instrument's name.
        clock: the bench's clock.
        clamps: what its outputs may be told.
        port: its byte stream, None if it is on a bus.
        bus: its bus.
        address: on the bus, or of the unit on a shared line.
        second_address: on the bus, of the chip's second die; 0 for its usual one.
        timeout: how long one of its replies may take [s]; the driver and the guardian keep to the same limit.
        terminator: what ends a line, where the bench file says it; drivers that offer `TERMINATED` look at it.
        names_asked: whether sensors are asked for their names between samples; not where an older record answers.
        sparing: whether sensors are read in as few transfers as do; not where an older record answers.
    """

    device: str
    clock: Clock
    clamps: Clamps
    port: Port | None = None
    bus: I2cBus | None = None
    address: int = 0
    second_address: int = 0
    timeout: float = LONGEST_REPLY_S
    terminator: bytes = b""
    names_asked: bool = True
    sparing: bool = True


class Driver(Protocol):
    """One instrument's protocol.

    Attributes:
        roles: the names of the roles that the driver can fill.
    """

    roles: ClassVar[frozenset[str]]

    def __init__(self, connection: Connection) -> None:
        """Keep the connection; send nothing."""
        ...

    def identify(self) -> Identity:
        """Ask the instrument who it is; reads only."""
        ...

    def outlets(self) -> Sequence[Outlet]:
        """Return the state of every output that the instrument has; reads only."""
        ...

    def role(self, wire: Wire) -> object:
        """Return the role that `wire` names; Refused where this instrument cannot fill it."""
        ...


@runtime_checkable
class NamesInputs(Protocol):
    """A driver whose role is read by names that the wire gives: its role has `read(name)`, and limits may name them."""

    @staticmethod
    def inputs(wire: Wire) -> Mapping[str, str]:
        """Return the unit of each input that the wire names; what it does not name rightly is left out."""
        ...


@runtime_checkable
class Strapped(Protocol):
    """A driver whose device on a bus answers at some addresses only, or at two at once."""

    @classmethod
    def straps(cls) -> tuple[Strap, ...]:
        """Return how each of its addresses is chosen: that of `address`, and where there are two, `second_address`."""
        ...


@runtime_checkable
class OpenedAnew(Protocol):
    """A driver that remembers of its instrument what does not outlive an opening of its port."""

    def reopened(self) -> None:
        """Forget that; send nothing."""
        ...


@runtime_checkable
class ServesBus(Protocol):
    """A driver whose instrument runs the transfers of an I2C bus."""

    def bus(self, frequency_hz: float) -> StreamingBus:
        """Return the bus, which runs at `frequency_hz`; send nothing before its first transfer."""
        ...


def offers(driver: type, capability: str) -> bool:
    """Return whether a driver lists a capability in its `capabilities`; one that has no list has none."""
    return capability in getattr(driver, "capabilities", frozenset())
