"""TDK InvenSense ICM-20948 gyroscope, accelerometer and magnetometer on an I2C bus, of the host or of an OBC.

Registers, banks, ranges and rates: data sheet DS-000189 and the SparkFun and PX4 drivers; noise bandwidths of the
filters and timings are from memory of its tables. Three pitfalls are avoided. The chip sleeps after power-on. Its
settings are spread over four banks. The magnetometer, an AK09916 at 0x0C, is on an auxiliary bus that the host reaches
only while the chip is awake, with BYPASS_EN set and I2C_MST_EN cleared; ST2 must be read to release each sample.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, ClassVar

import numpy as np

from hil.clock.port import Clock
from hil.instruments import settings
from hil.instruments.sampled import Channel
from hil.instruments.sensors.axes import Field, Sampling, three_axes
from hil.instruments.sensors.fifo import Fifo, Packets
from hil.instruments.sensors.filters import Filters
from hil.instruments.sensors.recorder import FifoSensor
from hil.instruments.sensors.registers import Banks, Registers
from hil.instruments.sensors.scale import Scale
from hil.instruments.sensors.second_die import Condition, SecondDie
from hil.instruments.sensors.sensor import Chip, Sensor, SensorDriver
from hil.instruments.sensors.shared_die import SharedDie
from hil.model.bench import Wire
from hil.model.notation import measured

__all__ = ["Icm20948", "Icm20948Accelerometer", "Icm20948Gyroscope", "Icm20948Magnetometer"]


class Register(IntEnum):
    """Registers by bank (high byte) and number (low byte)."""

    WHO_AM_I, USER_CTRL, PWR_MGMT_1, PWR_MGMT_2, INT_PIN_CFG = 0x00, 0x03, 0x06, 0x07, 0x0F
    INT_STATUS_1, INT_STATUS_2, ACCEL_OUT, GYRO_OUT, TEMP_OUT = 0x1A, 0x1B, 0x2D, 0x33, 0x39
    FIFO_EN_2, FIFO_RST, FIFO_MODE, FIFO_COUNT, FIFO_R_W, REG_BANK_SEL = 0x67, 0x68, 0x69, 0x70, 0x72, 0x7F
    GYRO_SMPLRT_DIV, GYRO_CONFIG_1 = 0x200, 0x201
    ACCEL_SMPLRT_DIV_1, ACCEL_SMPLRT_DIV_2, ACCEL_CONFIG = 0x210, 0x211, 0x214


class MagnetometerRegister(IntEnum):
    """Registers of the AK09916."""

    WIA2, ST1, HXL, CNTL2, CNTL3 = 0x01, 0x10, 0x11, 0x31, 0x32


_DEVICE_RESET, _ASLEEP, _AWAKE = 0x80, 0x41, 0x01
_RESET_S = 0.1
_START_UP_S = 0.035
_NEW = 0x01
_BYPASS, _FIFO_ON = 0x02, 0x40
_WAY = (
    Condition(register=Register.PWR_MGMT_1, value=_AWAKE, otherwise="the chip sleeps"),
    Condition(register=Register.USER_CTRL, value=0, bits=0xFF & ~_FIFO_ON, otherwise="I2C_MST_EN must be off"),
    Condition(register=Register.INT_PIN_CFG, value=_BYPASS, otherwise="BYPASS_EN is not set"),
)
"""Settings of the first die that make the magnetometer reachable."""

_BASE_RATE = 1125.0
_RATES = tuple(_BASE_RATE / divisor for divisor in (250, 125, 90, 50, 25, 15, 10, 9, 5))
_GYRO_RANGES = {250.0: (0, 131.0), 500.0: (1, 65.5), 1000.0: (2, 32.8), 2000.0: (3, 16.4)}
_ACCEL_RANGES = {2.0: (0, 16384.0), 4.0: (1, 8192.0), 8.0: (2, 4096.0), 16.0: (3, 2048.0)}
_GYRO_FILTERS = Filters(
    cut_offs=(196.6, 151.8, 119.5, 51.2, 23.9, 11.6, 5.7, 361.4),
    bandwidths=(229.8, 187.6, 154.3, 73.3, 35.9, 17.8, 8.9, 376.5),
)
_ACCEL_FILTERS = Filters(  # code 0 equals code 1
    cut_offs=(246.0, 246.0, 111.4, 50.4, 23.9, 11.5, 5.7, 473.0),
    bandwidths=(265.0, 265.0, 136.0, 68.8, 34.4, 17.0, 8.3, 499.0),
)
_GYRO_NOISE, _ACCEL_NOISE = 0.015, 230e-6  # one-sided, typical: deg/s/sqrt(Hz), g/sqrt(Hz)
_GRAVITY = 9.80665  # m/s2 of a g
_RAILS = (-32768, 32767)
# 21 degC and 333.87 counts per degree; the chip is rated from -40 to 85 degC.
_LSB_PER_KELVIN = 333.87
_CELSIUS = Scale(per_unit=_LSB_PER_KELVIN, zero=21.0, rails=(-20_367, 21_368))

_PACKET = np.dtype([("gyro", ">i2", (3,)), ("temperature", ">i2")])
_GYRO_AND_TEMPERATURE = 0x0F

_MAG_RATES = {10.0: 0x02, 20.0: 0x04, 50.0: 0x06, 100.0: 0x08}
_OFF, _SOFT_RESET = 0x00, 0x01
_MAG_RESET_S = 0.001
_READY, _OVERFLOW = 0x01, 0x08
_MAG_NOISE = 2.0  # counts rms, estimated
_MAG_LSB, _MAG_MOST = 0.15, 32752  # uT; readings saturate there


def _decoded(data: bytes) -> Packets:
    """Decode packets. They have no header, so one whose temperature is far from the others' is taken as misaligned."""
    packets = np.frombuffer(data, _PACKET)
    warm = packets["temperature"].astype(np.int64)
    middle = np.sort(warm)[len(warm) // 2] if len(warm) else 0
    usable = np.abs(warm - middle) < _LSB_PER_KELVIN
    return Packets(packets["gyro"].astype(np.int16), usable)


FIFO = Fifo(
    size=512,
    packet=_PACKET.itemsize,
    count=Register.FIFO_COUNT,
    data=Register.FIFO_R_W,
    lost=Register.INT_STATUS_2,
    lost_flag=0x1F,
    temperature=Register.TEMP_OUT,
    prepare=lambda _: {Register.FIFO_MODE: 0, Register.FIFO_EN_2: _GYRO_AND_TEMPERATURE},
    flush=(Register.FIFO_RST, 0x1F),
    fill=lambda _: {Register.FIFO_RST: 0, Register.USER_CTRL: _FIFO_ON},
    off={Register.USER_CTRL: 0, Register.FIFO_EN_2: 0},
    decode=_decoded,
)
"""64 packets of 8 bytes fill the FIFO exactly, so an overflow loses whole packets."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroscopeSettings:
    """Wire settings: range [deg/s], sampling rate [Hz], and -3 dB bandwidth [Hz], None to match the rate."""

    range: Annotated[float, measured("deg/s", choices=tuple(_GYRO_RANGES))] = 2000.0
    rate: Annotated[float, measured("Hz", choices=_RATES)] = 112.5
    bandwidth: Annotated[float | None, measured("Hz", choices=_GYRO_FILTERS.cut_offs)] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class AccelerometerSettings:
    """Wire settings: range [g], sampling rate [Hz], and -3 dB bandwidth [Hz], None to match the rate."""

    range: Annotated[float, measured("g", choices=tuple(_ACCEL_RANGES))] = 16.0
    rate: Annotated[float, measured("Hz", choices=_RATES)] = 112.5
    bandwidth: Annotated[float | None, measured("Hz", choices=_ACCEL_FILTERS.cut_offs)] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MagnetometerSettings:
    """Wire settings: sampling rate [Hz]."""

    rate: Annotated[float, measured("Hz", choices=tuple(_MAG_RATES))] = 100.0


def _chip(role: str) -> Chip:
    return Chip(
        model="ICM-20948",
        driver="icm20948",
        role=role,
        identity=(Register.WHO_AM_I, 0xEA),
        strap="AD0",
        addresses=(0x68, 0x69),
        banks=Banks(register=Register.REG_BANK_SEL, shift=4, most=3),
    )


class _FirstDie(SharedDie):
    """Gyroscope or accelerometer; both are on the first die."""

    reset: ClassVar[tuple[int, int, float]] = (Register.PWR_MGMT_1, _DEVICE_RESET, _RESET_S)
    fresh: ClassVar[tuple[int, int]] = (Register.INT_STATUS_1, _NEW)
    temperature_at: ClassVar[int] = Register.TEMP_OUT
    together: ClassVar[bool] = True
    _settings: Mapping[int, int]

    def _wake(self) -> None:
        """Reset the chip unless another sensor on it runs, configure this one, read all back, and wait for a sample."""
        self._reset_alone()
        values: dict[int, int] = {each.register: each.value for each in _WAY}
        values |= {Register.PWR_MGMT_2: 0, **self._settings}
        self._registers.set(values)
        self._clock.sleep(_START_UP_S)
        self._registers.expect(values)
        self._reset_stillness()
        self._is_fresh()  # clears the flag of an old sample
        self._await_sample()

    def _sleep(self) -> None:
        """Put the chip to sleep unless another of its sensors runs, and read that back."""
        if not self._others_run():
            self._registers.put({Register.PWR_MGMT_1: _ASLEEP})


class Icm20948Gyroscope(_FirstDie, FifoSensor):
    """The chip's gyroscope, which can stream."""

    chip: ClassVar[Chip] = _chip("gyroscope")
    measures: ClassVar[tuple[Channel, ...]] = three_axes("deg/s")
    fifo: ClassVar[Fifo] = FIFO
    axes_at: ClassVar[int] = Register.GYRO_OUT

    def __init__(self, registers: Registers, clock: Clock, wire: Wire) -> None:
        own = settings.read(wire, GyroscopeSettings)
        code, sensitivity = _GYRO_RANGES[own.range]
        filtered = _GYRO_FILTERS.code(own.rate, own.bandwidth)
        self._settings = {
            Register.GYRO_SMPLRT_DIV: round(_BASE_RATE / own.rate) - 1,
            Register.GYRO_CONFIG_1: filtered << 3 | code << 1 | 1,
        }
        sampling = Sampling(
            rate=own.rate,
            axes=Scale(per_unit=sensitivity, rails=_RAILS),
            temperature=_CELSIUS,
            order="big",
            full_scale=own.range,
            density=_GYRO_NOISE,
            bandwidth=_GYRO_FILTERS.bandwidths[filtered],
            awake={Register.PWR_MGMT_1: _AWAKE, Register.USER_CTRL: _FIFO_ON},
        )
        super().__init__(registers, clock, wire, sampling)


class Icm20948Accelerometer(_FirstDie):
    """The chip's accelerometer."""

    chip: ClassVar[Chip] = _chip("accelerometer")
    measures: ClassVar[tuple[Channel, ...]] = three_axes("m/s2")
    axes_at: ClassVar[int] = Register.ACCEL_OUT

    def __init__(self, registers: Registers, clock: Clock, wire: Wire) -> None:
        own = settings.read(wire, AccelerometerSettings)
        code, sensitivity = _ACCEL_RANGES[own.range]
        filtered = _ACCEL_FILTERS.code(own.rate, own.bandwidth)
        self._settings = {
            Register.ACCEL_SMPLRT_DIV_1: 0,
            Register.ACCEL_SMPLRT_DIV_2: round(_BASE_RATE / own.rate) - 1,
            Register.ACCEL_CONFIG: filtered << 3 | code << 1 | 1,
        }
        sampling = Sampling(
            rate=own.rate,
            axes=Scale(per_unit=sensitivity, factor=_GRAVITY, rails=_RAILS),
            temperature=_CELSIUS,
            order="big",
            full_scale=own.range * _GRAVITY,
            density=_ACCEL_NOISE,
            bandwidth=_ACCEL_FILTERS.bandwidths[filtered],
            awake={},
        )
        super().__init__(registers, clock, wire, sampling)


class Icm20948Magnetometer(SecondDie, Field):
    """The chip's magnetometer, an AK09916 with its own registers; each sample is a new one.

    The temperature is read from the first die.
    """

    chip: ClassVar[Chip] = Chip(
        model="AK09916",
        driver="icm20948",
        role="magnetometer",
        identity=(MagnetometerRegister.WIA2, 0x09),
        identity_name="WIA2",
        strap="",
        addresses=(0x0C,),
        second=True,
        hidden=True,
    )
    first: ClassVar[Chip] = _chip("magnetometer")
    way: ClassVar[tuple[Condition, ...]] = _WAY
    first_asleep: ClassVar[Mapping[int, int]] = {Register.PWR_MGMT_1: _ASLEEP}

    def __init__(self, registers: Registers, clock: Clock, wire: Wire) -> None:
        rate = settings.read(wire, MagnetometerSettings).rate
        axes = Scale(per_unit=1.0, factor=_MAG_LSB, rails=(-_MAG_MOST, _MAG_MOST))
        full_scale = _MAG_LSB * _MAG_MOST
        super().__init__(registers, clock, wire, rate=rate, axes=axes, full_scale=full_scale, noise=_MAG_NOISE)

    def _wake(self) -> None:
        """Reset the magnetometer, set its rate, read it back, and wait for the first sample."""
        self._registers.write(MagnetometerRegister.CNTL3, _SOFT_RESET)
        self._clock.sleep(_MAG_RESET_S)
        self._registers.put({MagnetometerRegister.CNTL2: _MAG_RATES[self._rate]})
        self._reset_stillness()
        self._await_sample()

    def _switch_off(self) -> None:
        self._registers.put({MagnetometerRegister.CNTL2: _OFF})

    def _sample(self) -> tuple[float, ...]:
        data = self._transfer_through(self._await_sample)
        counts = struct.unpack("<hhh", data[1:7])
        self._stillness.judge(counts)
        overflow = data[8] & _OVERFLOW
        axes = (math.nan if overflow else self._axes.number(axis) for axis in counts)
        return (*axes, self._die_temperature())

    def _read_die_temperature(self) -> float:
        return _CELSIUS.number(int.from_bytes(self._first_die.block(Register.TEMP_OUT, 2), "big", signed=True))

    def _await_sample(self) -> bytes:
        """Return a new sample, read in one transfer: ST1, x, y, z, a dummy, and ST2, which releases the sample."""
        data = b""

        def is_new() -> bool:
            nonlocal data
            data = self._registers.block(MagnetometerRegister.ST1, 9)
            return bool(data[0] & _READY)

        self._await_new(is_new, self._rate)
        return data


class Icm20948(SensorDriver):
    """Driver `icm20948`: roles `gyroscope`, `accelerometer`, `magnetometer`, and `thermometer` for the die temperature.

    A wire may set `range` (deg/s or g), `rate` (Hz) and `bandwidth` (-3 dB, Hz), and for the magnetometer `rate`.
    """

    roles: ClassVar[frozenset[str]] = frozenset({"gyroscope", "accelerometer", "magnetometer", "thermometer"})
    sensor: ClassVar[type[Sensor]] = Icm20948Gyroscope
    others: ClassVar[tuple[type[Sensor], ...]] = (Icm20948Accelerometer, Icm20948Magnetometer)
