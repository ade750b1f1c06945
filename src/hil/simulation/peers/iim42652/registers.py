"""The registers of the simulated IIM-42652: numbers, reset values, banks; sources as in `sensor`."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum

__all__ = ["FIFO_FULL", "FIFO_WATERMARK", "NEW_DATA", "Register", "RegisterFile"]

FIFO_FULL, FIFO_WATERMARK, NEW_DATA = 0x02, 0x04, 0x08
"""Bits of INT_STATUS and INT_SOURCE0."""

_SIZE = 0x80
_BANKS = 8


class Register(IntEnum):
    """Registers by bank (high byte) and number (low byte)."""

    DEVICE_CONFIG = 0x11
    INT_CONFIG = 0x14
    FIFO_CONFIG = 0x16
    TEMP_DATA = 0x1D
    ACCEL_DATA = 0x1F
    GYRO_DATA = 0x25
    TMST_FSYNC = 0x2B
    INT_STATUS = 0x2D
    FIFO_COUNT = 0x2E
    FIFO_DATA = 0x30
    SIGNAL_PATH_RESET = 0x4B
    INTF_CONFIG0 = 0x4C
    INTF_CONFIG1 = 0x4D
    PWR_MGMT0 = 0x4E
    GYRO_CONFIG0 = 0x4F
    ACCEL_CONFIG0 = 0x50
    GYRO_CONFIG1 = 0x51
    GYRO_ACCEL_CONFIG0 = 0x52
    ACCEL_CONFIG1 = 0x53
    TMST_CONFIG = 0x54
    FIFO_CONFIG1 = 0x5F
    FIFO_CONFIG2 = 0x60
    FIFO_CONFIG3 = 0x61
    FSYNC_CONFIG = 0x62
    INT_CONFIG0 = 0x63
    INT_CONFIG1 = 0x64
    INT_SOURCE0 = 0x65
    FIFO_LOST_PKT = 0x6C
    WHO_AM_I = 0x75
    REG_BANK_SEL = 0x76
    TMSTVAL = 0x162


_RESET: dict[int, int] = {
    Register.INTF_CONFIG0: 0x30,
    Register.INTF_CONFIG1: 0x91,
    Register.GYRO_CONFIG0: 0x06,
    Register.ACCEL_CONFIG0: 0x06,
    Register.GYRO_CONFIG1: 0x16,
    Register.GYRO_ACCEL_CONFIG0: 0x11,
    Register.ACCEL_CONFIG1: 0x0D,
    Register.TMST_CONFIG: 0x23,
    Register.FSYNC_CONFIG: 0x10,
    Register.INT_CONFIG1: 0x10,
    Register.INT_SOURCE0: 0x10,
}
_READ_ONLY = frozenset((*range(0x1D, 0x39), 0x6C, 0x6D, Register.WHO_AM_I, *range(0x162, 0x165)))


class RegisterFile:
    """Plain storage with banks; what a register does is its owner's business."""

    def __init__(self) -> None:
        self._values: dict[int, int] = dict(_RESET)
        self._bank = 0

    def __getitem__(self, register: int) -> int:
        """Return what is stored."""
        return self._values.get(register, 0)

    def __setitem__(self, register: int, value: int) -> None:
        """Store a byte, unless the register can only be read."""
        if register not in _READ_ONLY:
            self._values[register] = value

    def in_bank(self, number: int) -> int:
        """Return the register that an address on the bus means; REG_BANK_SEL is in every bank."""
        number %= _SIZE
        return number if number == Register.REG_BANK_SEL else self._bank << 8 | number

    @property
    def bank(self) -> int:
        """The bank that is selected."""
        return self._bank

    def select(self, value: int) -> None:
        """Select a bank."""
        self._bank = value % _BANKS

    def reset(self) -> None:
        """Bring back the values after power-on."""
        self._values, self._bank = dict(_RESET), 0

    def state(self) -> Mapping[str, object]:
        """Return everything as JSON values."""
        return {"bank": self._bank, "values": {str(key): value for key, value in sorted(self._values.items())}}

    def restore(self, bank: int, values: Mapping[str, int]) -> None:
        """Go on from what `state` returned."""
        self._bank = bank
        self._values = {int(key): value for key, value in values.items()}
