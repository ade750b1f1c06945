"""The registers of the simulated IIM-42652: their numbers, and what they ask for; sources as in `iim42652`."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from math import pi, sin
from typing import Self

from hil.simulation.peers.sensors.pin import PinSetting
from hil.simulation.peers.sensors.registers import RegisterFile
from hil.simulation.peers.sensors.sampler import FifoSetting

__all__ = ["READ_ONLY", "RESET", "SENSORS", "Register", "Setting", "fifo_setting", "packet_bytes", "pin_setting"]


class Register(IntEnum):
    """Registers by bank (high byte) and number (low byte)."""

    DEVICE_CONFIG = 0x11
    INT_CONFIG = 0x14
    FIFO_CONFIG = 0x16
    TEMP_DATA = 0x1D
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


RESET: dict[int, int] = {
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
"""Registers after power-on; all others are 0."""

READ_ONLY = frozenset((*range(0x1D, 0x39), 0x6C, 0x6D, Register.WHO_AM_I, *range(0x162, 0x165)))
"""Registers that cannot be written."""

SENSORS = 0x03
"""Bits of FIFO_CONFIG1: accelerometer and gyroscope."""

_EVERY_SAMPLE, _RECORDS = 0x20, 0x40
_PULSE_NS, _SHORT_PULSE_NS = 100_000, 8_000
_RATES = {code: 8000.0 / 2 ** (code - 3) for code in range(3, 7)}  # 8 to 1 kHz; slower ones from 200 Hz on
_RATES |= {code: 200.0 / 2 ** (code - 7) for code in range(7, 15)} | {15: 500.0}
_DEFAULT_RATE, _SLOWEST_GYRO = 1000.0, 12.5
_DIVISORS = {1: 4, 2: 5, 3: 8, 4: 10, 5: 16, 6: 20, 7: 40}
_LEAST_FILTERED_RATE = 400.0
_LOW_NOISE, _LOW_POWER = 3, 2
_STREAM = 1
_LATCHED, _ACTIVE_HIGH = 0x04, 0x01
_SHORT_PULSE, _ASYNC_RESET = 0x40, 0x10


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """What the registers ask for.

    Attributes:
        gyro, accel: which of them is on; none of them is sleep.
        rate: nominal samples per second.
        bandwidth: noise bandwidth of the gyroscope's filter [Hz].
    """

    gyro: bool
    accel: bool
    rate: float
    bandwidth: float

    @classmethod
    def read(cls, registers: RegisterFile) -> Self:
        """Read the registers; samples come at the gyroscope's rate, and at the accelerometer's where that is alone."""
        power = registers[Register.PWR_MGMT0]
        gyro, accel = power >> 2 & 3 == _LOW_NOISE, power & 3 in {_LOW_NOISE, _LOW_POWER}
        source = Register.GYRO_CONFIG0 if gyro or not accel else Register.ACCEL_CONFIG0
        rate = _RATES.get(registers[source] & 0x0F, _DEFAULT_RATE)
        if gyro:
            rate = max(rate, _SLOWEST_GYRO)
        divisor = _DIVISORS.get(registers[Register.GYRO_ACCEL_CONFIG0] & 0x0F)
        cut_off = max(_LEAST_FILTERED_RATE, rate) / divisor if divisor else rate / 2
        angle = pi / (2 * (min(registers[Register.GYRO_CONFIG1] >> 2 & 3, 2) + 1))  # of a Butterworth filter
        return cls(gyro=gyro, accel=accel, rate=rate, bandwidth=cut_off * (angle / sin(angle)))


def packet_bytes(registers: RegisterFile) -> int:
    """Return the bytes of a packet: of one sensor, or of both."""
    return 16 if registers[Register.FIFO_CONFIG1] & SENSORS == SENSORS else 8


def fifo_setting(registers: RegisterFile) -> FifoSetting:
    """Return what they say of FIFO and interrupt."""
    config, mode = registers[Register.FIFO_CONFIG1], registers[Register.FIFO_CONFIG] >> 6
    level = (registers[Register.FIFO_CONFIG3] & 0x0F) << 8 | registers[Register.FIFO_CONFIG2]
    in_packets = registers[Register.INTF_CONFIG0] & _RECORDS
    return FifoSetting(
        active=bool(mode and config & SENSORS),
        newest_go=mode != _STREAM,
        watermark=level if in_packets else -(-level // packet_bytes(registers)),
        every=bool(config & _EVERY_SAMPLE),
        sources=registers[Register.INT_SOURCE0],
    )


def pin_setting(registers: RegisterFile) -> PinSetting:
    """Return what they say of INT1."""
    config, timing = registers[Register.INT_CONFIG], registers[Register.INT_CONFIG1]
    return PinSetting(
        works=not timing & _ASYNC_RESET,
        high=bool(config & _ACTIVE_HIGH),
        latched=bool(config & _LATCHED),
        pulse_ns=_SHORT_PULSE_NS if timing & _SHORT_PULSE else _PULSE_NS,
    )
