"""Interface of drivers: made from a connection, a driver identifies its instrument and fills roles."""

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
"""Capability: a binary protocol that uses every byte value, so the line must not reserve any."""

TERMINATED = "terminated"
"""Capability: a text protocol whose line terminator the bench file may set."""

OVER_VOLTAGE_LEVEL = "over-voltage-level"
"""Capability: a supply whose over-voltage protection has a level independent of the voltage setpoint."""


@dataclass(frozen=True, slots=True)
class Outlet:
    """State of one output at arm: its channel (0 for the whole instrument) and whether it is on."""

    channel: int
    on: bool


@dataclass(frozen=True, slots=True)
class Strap:
    """How one bus address of a device is selected.

    Attributes:
        pin: the pin that selects it, empty where it is fixed.
        addresses: the possible addresses, the usual one first; empty where unknown.
    """

    pin: str
    addresses: tuple[int, ...]


class Clamps:
    """Clamps on one instrument's outputs, applied to every setting before its bytes leave.

    Args:
        clamps: per channel, the clamps of the wires on it.
    """

    def __init__(self, clamps: dict[int, tuple[Clamp, ...]] | None = None) -> None:
        self._clamps = clamps or {}

    def permit(self, channel: int, quantity: str, value: float) -> None:
        """Raise ClampExceeded if the setting is not allowed; NaN never is."""
        for clamp in self._clamps.get(channel, ()):
            if clamp.quantity == quantity and not clamp.minimum <= value <= clamp.maximum:
                raise ClampExceeded(
                    f"{clamp.output}: {quantity} {value:g} {clamp.unit} is outside its clamp"
                    f" {clamp.minimum:g} to {clamp.maximum:g} {clamp.unit}",
                    "change the setting, or the clamp in the bench file after a review",
                )

    def bounds(self, channel: int, quantity: str) -> tuple[float, float]:
        """Return the tightest lower and upper bounds of all clamps on a quantity, infinite if there is none."""
        clamps = [clamp for clamp in self._clamps.get(channel, ()) if clamp.quantity == quantity]
        least = max((clamp.minimum for clamp in clamps), default=-math.inf)
        return least, min((clamp.maximum for clamp in clamps), default=math.inf)


@dataclass(frozen=True, slots=True, kw_only=True)
class Connection:
    """How a driver reaches its instrument.

    Attributes:
        device: the instrument's name.
        clock: the bench's clock.
        clamps: the clamps on its outputs.
        port: its byte stream, None if it is on a bus.
        bus: its bus.
        address: on the bus, or of the unit on a shared line.
        second_address: bus address of the chip's second die; 0 for its usual one.
        timeout: longest wait for one reply [s]; driver and guardian use the same limit.
        terminator: line terminator from the bench file; used by drivers that offer `TERMINATED`.
        names_asked: whether sensor IDs are re-read between samples; False to replay an older record.
        sparing: whether sensors are read in as few transfers as possible; False to replay an older record.
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
        """Store the connection; send nothing."""
        ...

    def identify(self) -> Identity:
        """Query the instrument's identity; reads only."""
        ...

    def outlets(self) -> Sequence[Outlet]:
        """Return the state of every output of the instrument; reads only."""
        ...

    def role(self, wire: Wire) -> object:
        """Return the role that `wire` names; Refused where this instrument cannot fill it."""
        ...


@runtime_checkable
class NamesInputs(Protocol):
    """A driver whose role has `read(name)`, with input names defined by the wire; limits may refer to them."""

    @staticmethod
    def inputs(wire: Wire) -> Mapping[str, str]:
        """Return the unit of each input that the wire defines; invalid definitions are left out."""
        ...


@runtime_checkable
class Strapped(Protocol):
    """A driver of a bus device with a limited set of addresses, or with two addresses at once."""

    @classmethod
    def straps(cls) -> tuple[Strap, ...]:
        """Return how `address` is selected, and `second_address` where there are two."""
        ...


@runtime_checkable
class OpenedAnew(Protocol):
    """A driver that caches instrument state which reopening the port invalidates."""

    def reopened(self) -> None:
        """Discard that state; send nothing."""
        ...


@runtime_checkable
class ServesBus(Protocol):
    """A driver whose instrument serves an I2C bus."""

    def bus(self, frequency_hz: float) -> StreamingBus:
        """Return the bus, clocked at `frequency_hz`; nothing is sent before its first transfer."""
        ...


def offers(driver: type, capability: str) -> bool:
    """Return whether a driver lists a capability in its `capabilities`; a driver without the list has none."""
    return capability in getattr(driver, "capabilities", frozenset())
