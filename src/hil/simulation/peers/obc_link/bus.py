"""The simulated board's I2C bus: one user at a time, transfers that take the time of their bits."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Protocol

from hil.clock.port import NANOSECONDS
from hil.model.notation import Complaint, Notation
from hil.simulation.faults import Fault, Faults
from hil.simulation.peers.timing import Alarm
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import BusPeer, Nack, PeerClock

__all__ = ["NO_ADDRESS", "OK", "SLOWEST", "BoardBus", "BusUser", "NoAcknowledge"]

OK, NO_ADDRESS = 0, 1
SLOWEST = 100_000

_BITS = 9


class BusUser(Protocol):
    """Who runs transfers: the request that is being executed, or a turn of the stream."""

    def on_bus(self) -> None:
        """Run every transfer, at this one instant; the bus is taken for as long as their bits take."""
        ...

    def off_bus(self) -> None:
        """Go on when the bits are through."""
        ...


def _address(value: object) -> int:
    if not isinstance(value, str) or not re.fullmatch(r"0x[0-7][0-9A-Fa-f]", value):
        raise Complaint("must be an address such as '0x68'")
    return int(value, 16)


@dataclass(frozen=True, slots=True, kw_only=True)
class NoAcknowledge(Fault):
    """An address of its bus does not acknowledge."""

    name = "nack"

    address: Annotated[int, Notation(_address, 0x08)]

    def concerns(self, part: int) -> bool:
        """Return whether it is this address."""
        return self.address == part


class BoardBus(Stateful):
    """The bus. A device that does not acknowledge is status 1: simulated devices know no other refusal.

    The fault `nack` lets an address not acknowledge while it lasts.

    Args:
        faults: what goes wrong.
    """

    frequency_hz: Kept[int]
    _line_up: Kept[list[str]]
    _through: Kept[Alarm]

    def __init__(self, faults: Faults) -> None:
        self.frequency_hz = SLOWEST
        self._faults = faults
        self._peers: dict[int, BusPeer] = {}
        self._users: dict[str, BusUser] = {}
        self._line_up = []
        self._bits = 0
        self._clock: PeerClock

    def serve(self, peers: Sequence[BusPeer]) -> None:
        """Put devices on the bus."""
        self._peers = {address: peer for peer in peers for address in peer.addresses}

    def attach(self, clock: PeerClock, users: Mapping[str, BusUser]) -> None:
        """Connect the clock and those who may ask for the bus."""
        self._clock = clock
        self._users = dict(users)
        self._through = Alarm(clock, self._end)

    def ask(self, user: str) -> None:
        """Give a user the bus, now or when those before it are through."""
        self._line_up.append(user)
        if len(self._line_up) == 1:
            self._begin()

    def withdraw(self, user: str) -> None:
        """Bring a user's transfers to an end, or its wait for them; `off_bus` does not come any more."""
        if user not in self._line_up:
            return
        running = self._line_up[0] == user
        self._line_up.remove(user)
        if running:
            self._through.clear()
            if self._line_up:
                self._begin()

    def reset(self) -> None:
        """Be as after a reset."""
        self._line_up.clear()
        self._through.clear()
        self.frequency_hz = SLOWEST

    def write(self, address: int, data: bytes) -> int:
        """Write one message and return its status."""
        try:
            self._at(address).write(address, data)
        except Nack:
            self._bits += _BITS
            return NO_ADDRESS
        self._bits += _BITS * (1 + len(data))
        return OK

    def read(self, address: int, length: int) -> tuple[int, bytes]:
        """Read one message and return its status and bytes."""
        try:
            data = self._at(address).read(address, length)
        except Nack:
            self._bits += _BITS
            return NO_ADDRESS, b""
        self._bits += _BITS * (1 + length)
        return OK, data

    def registers(self, address: int, register: int, length: int) -> tuple[int, bytes]:
        """Write a register's number and read, with a repeated start."""
        status = self.write(address, bytes([register]))
        return self.read(address, length) if status == OK else (status, b"")

    def remembers(self, address: int, register: int, length: int) -> bool:
        """Return whether `remembered` can tell these registers until somebody writes to the bus."""
        able = getattr(self._peers.get(address), "remembers", None)
        return not self._line_up and not self._faults.faults and able is not None and bool(able(register, length))

    def remembered(self, address: int, register: int, length: int, times_ns: Sequence[int]) -> list[bytes]:
        """Return what `registers` would have given at rising instants of the past."""
        found: list[bytes] = getattr(self._peers[address], "remembered")(register, length, times_ns)  # noqa: B009
        return found

    def _at(self, address: int) -> BusPeer:
        if address not in self._peers or self._faults.now(NoAcknowledge, self._clock.now_ns(), address):
            raise Nack
        return self._peers[address]

    def _begin(self) -> None:
        self._bits = 0
        self._users[self._line_up[0]].on_bus()
        self._through.set(self._clock.now_ns() + self._bits * NANOSECONDS // self.frequency_hz)

    def _end(self) -> None:
        # The next user begins before this one continues, as the bus is free from now on.
        user = self._line_up.pop(0)
        if self._line_up:
            self._begin()
        self._users[user].off_bus()
