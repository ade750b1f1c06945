"""The registers of the IIM-42652, and access to them over any I2C bus.

Numbers and bits: the vendor's header Ixm42xxxDefs.h (InvenSenseInc/public.mcu.iim42652) and Linux inv_icm42600.
Registers stand in banks behind REG_BANK_SEL; all that are used here are in bank 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import cast

from hil.instruments.i2c_registers import I2cRegisters
from hil.model.errors import Rejected

__all__ = ["ITS_NAME", "Register", "Registers"]

ITS_NAME = 0x6F
"""What WHO_AM_I says."""


class Register(IntEnum):
    """Registers of bank 0."""

    DEVICE_CONFIG = 0x11
    INT_CONFIG = 0x14
    FIFO_CONFIG = 0x16
    TEMP_DATA = 0x1D
    INT_STATUS = 0x2D
    FIFO_COUNT = 0x2E
    FIFO_DATA = 0x30
    SIGNAL_PATH_RESET = 0x4B
    INTF_CONFIG0 = 0x4C
    PWR_MGMT0 = 0x4E
    GYRO_CONFIG0 = 0x4F
    GYRO_CONFIG1 = 0x51
    GYRO_ACCEL_CONFIG0 = 0x52
    FIFO_CONFIG1 = 0x5F
    FIFO_CONFIG2 = 0x60
    FIFO_CONFIG3 = 0x61
    INT_CONFIG1 = 0x64
    INT_SOURCE0 = 0x65
    FIFO_LOST_PKT = 0x6C
    WHO_AM_I = 0x75
    REG_BANK_SEL = 0x76


class Registers(I2cRegisters):
    """The sensor's registers, and settings that are written and read back."""

    def long(self, register: Register, count: int) -> bytes:
        """Return any number of bytes from a register on, in one transfer with a repeated start."""
        from smbus2 import i2c_msg  # noqa: PLC0415  # only hosts with an I2C bus of their own need it

        ask, take = i2c_msg.write(self.address, [register]), i2c_msg.read(self.address, count)
        self._heard(lambda: self.bus.i2c_rdwr(ask, take))
        # smbus2 knows its messages as iterable at run time only.
        return self._whole(bytes(cast("list[int]", list(take))), count)

    def set(self, values: Mapping[Register, int]) -> None:
        """Write registers in their order."""
        for register, value in values.items():
            self.write(register, value)

    def expect(self, values: Mapping[Register, int]) -> None:
        """Read settings back.

        Raises:
            Rejected: one reads otherwise; the message names the first.
        """
        for register, value in values.items():
            found = self.read(register)
            if found != value:
                raise Rejected(
                    self.device,
                    f"{register.name} was set to {value:#04x} and reads back {found:#04x}",
                    "look at the sensor's power and who else talks to it",
                )
