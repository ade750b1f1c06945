"""Base of simulated sensors on a bus: power, identity, registers and pointer; a chip's class adds their function."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated, ClassVar

from hil.clock.port import NANOSECONDS
from hil.model.notation import NotNegative, matching, whole
from hil.simulation.faults import Fault, Faults
from hil.simulation.peers.model import PeerSetup
from hil.simulation.peers.sensors.registers import RegisterFile
from hil.simulation.plants.terminal import SignalPoint
from hil.simulation.truth import TruthError
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import Nack, PeerClock

__all__ = ["Asleep", "Datasheet", "Fitted", "OtherIdentity", "Package", "SensorPeer", "TemperatureRaw", "number_at"]


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherIdentity(Fault):
    """Another sensor answers: its identity register holds `value`."""

    name = "identity"

    value: Annotated[str, matching("0x[0-9A-Fa-f]{1,4}", "a hexadecimal number such as 0x3C")]

    @property
    def number(self) -> int:
        """Content of the register."""
        return int(self.value, 16)


@dataclass(frozen=True, slots=True, kw_only=True)
class Asleep(Fault):
    """The sensor falls asleep: it loses its settings, and wakes only by a reset after the fault."""

    name = "asleep"


@dataclass(frozen=True, slots=True, kw_only=True)
class TemperatureRaw(Fault):
    """The temperature reads a fixed number of counts."""

    name = "temperature-raw"

    counts: Annotated[int, whole(-32_767, 32_767)] = 24_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Datasheet:
    """Bus and power properties from a chip's data sheet.

    Attributes:
        model: its name.
        addresses: 7-bit addresses that can be strapped, the usual one first.
        identity: the register that names the type, and what it holds.
        least_volts: supply voltage below which it does nothing.
        boot_s: from power-on to the first acknowledge, where the truth does not say.
        reset: registers after power-on; all others are 0.
        read_only: registers that cannot be written.
        select: the register that selects a bank, None if there are no banks.
        shift, banks: place of the bank's number in that register, and how many there are.
        increment: the bit of a register's number that asks to continue; 0 where every transfer continues.
        follows: the register that comes after one, where that is not the next number.
        width: bytes of a register, the high one first.
        size: registers, of a bank where there are banks.
        second: whether it is the second die of its chip, with an address of its own.
    """

    model: str
    addresses: tuple[int, ...]
    identity: tuple[int, int]
    least_volts: float
    boot_s: float
    reset: Mapping[int, int] = field(default_factory=dict)
    read_only: Container[int] = frozenset()
    select: int | None = None
    shift: int = 0
    banks: int = 8
    increment: int = 0
    follows: Mapping[int, int] = field(default_factory=dict)
    width: int = 1
    size: int = 0x80
    second: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class BootTruth:
    """From power-on to the first acknowledge [s], None for what the data sheet says."""

    boot_time: NotNegative | None = None


@dataclass(frozen=True, slots=True)
class Fitted:
    """Installation of one sensor: address, supply, and injected faults.

    Attributes:
        address: 7-bit address.
        power: where its supply voltage is seen, or None for a sensor that always has power.
        boot_ns: from power-on to the first acknowledge.
        faults: what goes wrong.
    """

    address: int
    power: SignalPoint | None
    boot_ns: int
    faults: Faults

    @classmethod
    def read(cls, setup: PeerSetup, sheet: Datasheet) -> Fitted:
        """Read address, `boot_time` and the terminal `power`.

        Raises:
            TruthError: no such sensor answers at this address, or the fault `identity` names no register value.
        """
        path = setup.truth.path[:-1]
        strapped = setup.instrument.second_address if sheet.second else setup.instrument.address
        address = strapped or sheet.addresses[0]
        if address not in sheet.addresses:
            known = " or ".join(f"0x{known:02X}" for known in sheet.addresses)
            raise TruthError(path, f"the {sheet.model} answers at {known}, not at 0x{address:02X}")
        for fault in setup.faults.of(OtherIdentity):
            if fault.number >= 256**sheet.width:
                message = f"'value' must fit into a register of {8 * sheet.width} bits, found '{fault.value}'"
                raise TruthError((*path, "faults"), message)
        given = setup.truth.part(BootTruth).boot_time
        boot_s = sheet.boot_s if given is None else given
        return cls(address, setup.connections.signal("power"), round(boot_s * NANOSECONDS), setup.faults)


class SensorPeer(Stateful):
    """The sensor: registers read through a pointer, silent without power and while it boots.

    A chip's class defines what follows a write and what is computed for a read, in `_store`, `_readers` and `_burst`;
    `_was_reset` and `_connected` are told. What it has to keep it marks as `Kept`.

    Args:
        fitted: where it is, and how it is fed.
    """

    sheet: ClassVar[Datasheet]
    _ready_ns: Kept[int | None]
    _pointer: Kept[int]
    _registers: Kept[RegisterFile]

    def __init__(self, fitted: Fitted) -> None:
        self._fitted = fitted
        self._faults = fitted.faults
        sheet = self.sheet
        self._registers = RegisterFile(
            sheet.reset, sheet.read_only, sheet.select, sheet.size, shift=sheet.shift, banks=sheet.banks
        )
        self._readers: Mapping[int, Callable[[], int]] = {}
        self._ready_ns = None
        self._pointer = 0
        self._clock: PeerClock

    @property
    def addresses(self) -> tuple[int, ...]:
        """The address that is strapped."""
        return (self._fitted.address,)

    def attach(self, clock: PeerClock) -> None:
        """Connect the clock, and watch the supply voltage."""
        self._clock = clock
        self._connected()
        if self._fitted.power is not None:
            self._fitted.power.plant.listen(self._power_changed)
        self._power_changed()

    def write(self, address: int, data: bytes) -> None:
        """Take the register's number and what is written from there on."""
        del address
        self._require_answer()
        if not data:
            return
        width = self.sheet.width
        if len(data) > width:  # a pointer alone changes nothing that has to be up to now
            self._settle()
        self._pointer = data[0]
        for place in range(1, len(data) + 1 - width, width):
            register, value = self._register(), int.from_bytes(data[place : place + width], "big")
            if register == self.sheet.select:
                self._registers[register] = value
            else:
                self._store(register, value)
            self._step()

    def read(self, address: int, count: int) -> bytes:
        """Give registers from the pointer on."""
        del address
        self._acknowledge()
        data, width = bytearray(), self.sheet.width
        while (missing := count - len(data)) > 0:
            register = self._register()
            if burst := self._burst(register, missing):
                data += burst
                continue
            if width == 1:
                data.append(self._load(register))
            else:
                data += self._load(register).to_bytes(width, "big")
            self._step()
        return bytes(data[:count])

    def _connected(self) -> None:
        """Create alarms, now that the clock is connected."""

    def _settle(self) -> None:
        """Bring everything up to the present before a read or write."""

    def _was_reset(self) -> None:
        """Reinitialise after the registers were reset to their power-on values."""

    def _burst(self, register: int, count: int) -> bytes:
        """Return bytes of a register that does not continue at the next one, nothing for every other."""
        del register, count
        return b""

    def _store(self, register: int, value: int) -> None:
        """Take what is written to a register, unless it selects a bank."""
        self._registers[register] = value

    def _load(self, register: int) -> int:
        if register == self.sheet.identity[0]:
            fault = self._faults.now(OtherIdentity, self._clock.now_ns())
            return fault.number if fault else self.sheet.identity[1]
        reader = self._readers.get(register)
        return reader() if reader else self._registers[register]

    def _register(self) -> int:
        return self._registers.in_bank(self._pointer & ~self.sheet.increment)

    def _step(self) -> None:
        """Go on to the next register, where the chip does."""
        bit = self.sheet.increment
        if bit and not self._pointer & bit:
            return
        number = self._pointer & ~bit
        self._pointer = self._pointer & bit | self.sheet.follows.get(number, (number + 1) % self.sheet.size)

    def _acknowledge(self) -> None:
        self._require_answer()
        self._settle()

    def _require_answer(self) -> None:
        if self._ready_ns is None or self._clock.now_ns() < self._ready_ns:
            raise Nack

    def _power_changed(self) -> None:
        power = self._fitted.power
        powered = power is None or power.observe() >= self.sheet.least_volts
        if powered and self._ready_ns is None:
            # A sensor without a power terminal has had power since long before the epoch.
            self._reset(self._fitted.boot_ns if power is not None else 0)
        elif not powered and self._ready_ns is not None:
            self._reset(0)
            self._ready_ns = None

    def _reset(self, busy_ns: int) -> None:
        """Reset to power-on, and acknowledge nothing for `busy_ns`."""
        self._registers.reset()
        self._was_reset()
        self._ready_ns = self._clock.now_ns() + busy_ns


class Package(Stateful):
    """A chip of two dies, each at an address of its own.

    Args:
        dies: the first one's interrupt pin is that of the chip, where it has one.
        way: raises Nack while the second die, behind the first one, cannot be reached; None for dies side by side.
    """

    _dies: Kept[list[SensorPeer]]

    def __init__(self, *dies: SensorPeer, way: Callable[[], None] | None = None) -> None:
        self._dies, self._way = list(dies), way
        self._at = {address: die for die in dies for address in die.addresses}

    @property
    def addresses(self) -> tuple[int, ...]:
        """The addresses that are strapped."""
        return tuple(self._at)

    def attach(self, clock: PeerClock) -> None:
        """Connect the clock."""
        for die in self._dies:
            die.attach(clock)

    def on_interrupt(self, callback: Callable[[], None]) -> None:
        """Call back at every rising edge of the first interrupt pin that a die has."""
        for die in self._dies:
            if hasattr(die, "on_interrupt"):
                die.on_interrupt(callback)
                return

    def write(self, address: int, data: bytes) -> None:
        """Write to the die at this address."""
        self._die(address).write(address, data)

    def read(self, address: int, count: int) -> bytes:
        """Read from the die at this address."""
        return self._die(address).read(address, count)

    def _die(self, address: int) -> SensorPeer:
        die = self._at[address]
        if self._way is not None and die is not self._dies[0]:
            self._way()
        return die


def number_at(
    register: int, read: Callable[[], int], size: int = 2, *, big: Callable[[], bool] = lambda: False
) -> dict[int, Callable[[], int]]:
    """Return readers of the bytes of a number that is computed when it is read.

    Args:
        register: the first one.
        read: computes the number.
        size: its bytes.
        big: whether the high byte comes first now.
    """

    def byte(place: int) -> int:
        return read() >> 8 * (size - 1 - place if big() else place) & 0xFF

    return {register + place: partial(byte, place) for place in range(size)}
