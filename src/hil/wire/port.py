"""Driver-side interfaces of byte streams and I2C buses, the same for hardware, simulation and replay."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

__all__ = ["I2cBus", "Port"]


class Port(Protocol):
    """An open byte stream. Reads time out after `timeout` s, 2 s at most, in operations of up to 0.5 s each."""

    timeout: float

    @property
    def in_waiting(self) -> int:
        """The number of bytes that can be read without waiting."""
        ...

    def write(self, data: bytes) -> int:
        """Write all bytes and return their number."""
        ...

    def exchange(self, data: bytes) -> bytes:
        """Write all bytes, and return the first byte received within the timeout and all that arrived with it."""
        ...

    def read(self, size: int = 1) -> bytes:
        """Return `size` bytes, or fewer at the timeout."""
        ...

    def read_line(self, terminator: bytes = b"\n", limit: int = 4096) -> bytes:
        """Return bytes up to and including `terminator`, or without it at the timeout."""
        ...

    def reset_input_buffer(self) -> None:
        """Discard received bytes not read yet."""
        ...

    def pulse_dtr(self) -> None:
        """Pulse the modem line DTR low, which resets a board whose reset is coupled to it by a capacitor."""
        ...

    def close(self) -> None:
        """Close the stream."""
        ...


class I2cBus(Protocol):
    """An I2C bus with smbus2's interface; a missing acknowledge is OSError with errno EREMOTEIO."""

    def read_byte(self, i2c_addr: int) -> int:
        """Read one byte without a register address."""
        ...

    def write_byte(self, i2c_addr: int, value: int) -> None:
        """Write one byte without a register address."""
        ...

    def read_byte_data(self, i2c_addr: int, register: int) -> int:
        """Read one byte from a register."""
        ...

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Write one byte to a register."""
        ...

    def read_word_data(self, i2c_addr: int, register: int) -> int:
        """Read two bytes starting at a register, low byte first."""
        ...

    def write_word_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Write two bytes starting at a register, low byte first."""
        ...

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Read up to 32 bytes starting at a register."""
        ...

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Write up to 32 bytes starting at a register."""
        ...

    def i2c_rdwr(self, *i2c_msgs: object) -> None:
        """Run combined messages (smbus2.i2c_msg) with repeated starts; reads fill their message."""
        ...
