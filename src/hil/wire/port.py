"""What drivers see of a byte stream, and of an I2C bus: the same face for hardware, simulation and replay."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

__all__ = ["I2cBus", "Port"]


class Port(Protocol):
    """An open byte stream. Reads end at `timeout` seconds of the clock, 2 s at most, in operations of up to 0.5 s."""

    timeout: float

    @property
    def in_waiting(self) -> int:
        """The number of bytes that can be read without waiting."""
        ...

    def write(self, data: bytes) -> int:
        """Write all bytes and return their number."""
        ...

    def exchange(self, data: bytes) -> bytes:
        """Write all bytes, and return what comes: the first byte within the timeout, and what is there with it."""
        ...

    def read(self, size: int = 1) -> bytes:
        """Return `size` bytes, or what came until the timeout."""
        ...

    def read_line(self, terminator: bytes = b"\n", limit: int = 4096) -> bytes:
        """Return bytes up to and with `terminator`; without it at the end they are what came until the timeout."""
        ...

    def reset_input_buffer(self) -> None:
        """Throw away what was received and not read."""
        ...

    def pulse_dtr(self) -> None:
        """Let the modem line DTR fall and rise, which resets a board that hangs on it by a capacitor."""
        ...

    def close(self) -> None:
        """Close the stream."""
        ...


class I2cBus(Protocol):
    """An I2C bus with smbus2's interface; a missing acknowledge is OSError with errno EREMOTEIO."""

    def read_byte(self, i2c_addr: int) -> int:
        """Return one byte without naming a register."""
        ...

    def write_byte(self, i2c_addr: int, value: int) -> None:
        """Write one byte without naming a register."""
        ...

    def read_byte_data(self, i2c_addr: int, register: int) -> int:
        """Return one byte of a register."""
        ...

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Write one byte to a register."""
        ...

    def read_word_data(self, i2c_addr: int, register: int) -> int:
        """Return two bytes from a register on, low byte first."""
        ...

    def write_word_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Write two bytes from a register on, low byte first."""
        ...

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Return up to 32 bytes from a register on."""
        ...

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Write up to 32 bytes from a register on."""
        ...

    def i2c_rdwr(self, *i2c_msgs: object) -> None:
        """Run combined messages (smbus2.i2c_msg) with repeated starts; reads fill their message."""
        ...
