"""A sensor's registers over any I2C bus."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from hil.model.errors import Garbled, NoReply
from hil.wire.port import I2cBus

__all__ = ["I2cRegisters"]

_T = TypeVar("_T")


class I2cRegisters:
    """One sensor's registers; a missing acknowledge is NoReply of the sensor, whoever drives the bus.

    Args:
        device: the sensor's name, for messages.
        bus: its bus.
        address: its 7-bit address.
    """

    def __init__(self, device: str, bus: I2cBus, address: int) -> None:
        self.device = device
        self.bus = bus
        self.address = address

    def read(self, register: int) -> int:
        """Return one register."""
        return self._heard(lambda: self.bus.read_byte_data(self.address, register))

    def write(self, register: int, value: int) -> None:
        """Write one register."""
        self._heard(lambda: self.bus.write_byte_data(self.address, register, value))

    def block(self, register: int, count: int) -> bytes:
        """Return up to 32 bytes from a register on, in one transfer."""
        data = bytes(self._heard(lambda: self.bus.read_i2c_block_data(self.address, register, count)))
        return self._whole(data, count)

    def _whole(self, data: bytes, count: int) -> bytes:
        if len(data) != count:
            raise Garbled(self.device, f"{count} bytes were asked for and {len(data)} came", "look at the I2C adapter")
        return data

    def _heard(self, transfer: Callable[[], _T]) -> _T:
        try:
            return transfer()
        except OSError as error:
            raise NoReply(
                self.device,
                f"no acknowledge at address {self.address:#04x}: {error.strerror or error}",
                "look at the sensor's power, its wires and the address in the bench file",
            ) from error
