"""Register access to a sensor over any I2C bus."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal, TypeVar

from hil.model.errors import Garbled, NoReply, Rejected
from hil.wire.port import I2cBus

__all__ = ["Banks", "Registers"]

_BANK = 0x100
_REJECTED = "check the sensor's power and what else talks to it"

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Banks:
    """Register banks of a chip.

    Attributes:
        register: the bank-select register, present in every bank.
        shift: bit position of the bank number in that register.
        most: highest bank number.
    """

    register: int
    shift: int = 0
    most: int


class Registers:
    """One sensor's registers; a missing acknowledge is the sensor's NoReply, whatever drives the bus.

    The bank is in the high byte of a register number: 0x201 is register 0x01 of bank 2. The bank is selected when it
    changes; after a reset of the chip, `bank_lost` restores it.

    Args:
        device: the sensor's name, for messages.
        bus: its bus.
        address: its 7-bit address.
        increment: bits to set in a register number for auto-increment within a transfer.
        width: size of a register in bytes.
        order: byte order on the bus.
        banks: the chip's banks; None for a chip without.
        sparing: whether the chip is read in as few transfers as possible, as each costs time; see `Connection`.

    Attributes:
        other: the registers of the chip's other die, None where it has one die.
    """

    def __init__(
        self,
        device: str,
        bus: I2cBus,
        address: int,
        *,
        increment: int = 0,
        width: int = 1,
        order: Literal["big", "little"] = "big",
        banks: Banks | None = None,
        sparing: bool = True,
    ) -> None:
        self.device = device
        self.bus = bus
        self.address = address
        self._increment = increment
        self._width = width
        self._order = order
        self._banks = banks
        self._bank = 0
        self.sparing = sparing
        self.other: Registers | None = None

    def read(self, register: int) -> int:
        """Read one register as an unsigned number."""
        number = self._selected(register)
        if self._width == 1:
            return self._heard(lambda: self.bus.read_byte_data(self.address, number))
        return int.from_bytes(self.block(register, self._width), self._order)

    def write(self, register: int, value: int) -> None:
        """Write one register."""
        number = self._selected(register)
        if self._width == 1:
            self._heard(lambda: self.bus.write_byte_data(self.address, number, value))
        else:
            data = list(value.to_bytes(self._width, self._order))
            self._heard(lambda: self.bus.write_i2c_block_data(self.address, number, data))

    def block(self, register: int, count: int) -> bytes:
        """Read up to 32 bytes starting at a register, in one transfer."""
        number = self._selected(register) | self._increment
        return self._whole(self._heard(lambda: self.bus.read_i2c_block_data(self.address, number, count)), count)

    def long(self, register: int, count: int) -> bytes:
        """Read any number of bytes starting at a register, in one transfer with a repeated start."""
        from smbus2 import i2c_msg  # noqa: PLC0415  # only hosts with an I2C bus of their own need it

        number = self._selected(register) | self._increment
        ask, take = i2c_msg.write(self.address, [number]), i2c_msg.read(self.address, count)
        self._heard(lambda: self.bus.i2c_rdwr(ask, take))
        return self._whole(bytes(take), count)

    def set(self, values: Mapping[int, int]) -> None:
        """Write registers in the order given."""
        for register, value in values.items():
            self.write(register, value)

    def put(self, values: Mapping[int, int]) -> None:
        """Write registers in the order given, then read them back; see `expect`."""
        self.set(values)
        self.expect(values)

    def expect(self, values: Mapping[int, int]) -> None:
        """Read settings back, one by one.

        Raises:
            Rejected: one differs; the message names the first.
        """
        for register, value in values.items():
            found = self.read(register)
            if found != value:
                name = register.name if isinstance(register, IntEnum) else f"register {register:#04x}"
                raise Rejected(self.device, f"{name} was set to {value:#04x} and reads back {found:#04x}", _REJECTED)

    def expect_block(self, register: int, wanted: bytes) -> None:
        """Read the settings of consecutive registers back in one transfer.

        Raises:
            Rejected: they differ.
        """
        found = self.block(register, len(wanted))
        if found != wanted:
            raise Rejected(
                self.device,
                f"registers from {register:#04x} on were set to {wanted.hex(' ')} and read back {found.hex(' ')}",
                _REJECTED,
            )

    def bank_lost(self) -> bool:
        """Select the first bank if the chip has another one selected, and return whether it had."""
        self._bank = 0
        if self._banks is None:
            return False
        found = self.read(self._banks.register) >> self._banks.shift
        if not 0 < found <= self._banks.most:
            return False
        self.write(self._banks.register, 0)
        return True

    def _selected(self, register: int) -> int:
        """Select the register's bank, and return the register's number within it."""
        bank, number = divmod(int(register), _BANK)
        if self._banks and bank != self._bank and number != self._banks.register:
            value = bank << self._banks.shift
            select = self._banks.register
            self._heard(lambda: self.bus.write_byte_data(self.address, select, value))
            self._bank = bank
        return number

    def _whole(self, data: Sequence[int], count: int) -> bytes:
        if len(data) != count:
            raise Garbled(self.device, f"{count} bytes were asked for and {len(data)} came", "check the I2C adapter")
        return bytes(data)

    def _heard(self, transfer: Callable[[], _T]) -> _T:
        try:
            return transfer()
        except OSError as error:
            raise NoReply(
                self.device,
                f"no acknowledge at address {self.address:#04x}: {error.strerror or error}",
                "check the sensor's power, its wires and the address in the bench file",
            ) from error
