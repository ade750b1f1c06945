"""Bosch BMI088 on an I2C bus: accelerometer and gyroscope, two dies with one address each.

Registers and scales: the vendor's driver (boschsensortec/BMI08x_SensorAPI: bmi08_defs.h, bmi08a.c, bmi08g.c) and
devices read with it; accelerometer bandwidths and noise densities are from memory of the data sheet
(BST-BMI088-DS001). Filters are modelled as second-order Butterworth filters.

Two pitfalls are avoided. The accelerometer powers up suspended, and the only thermometer is on its die, so waking the
gyroscope wakes that die too. The temperature is an 11-bit number, left-aligned in two bytes, high byte first, in steps
of 1/8 K from 23 degC.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from hil.clock.port import Clock
from hil.instruments import settings
from hil.instruments.sampled import Channel
from hil.instruments.sensors.axes import Axes, Sampling, three_axes
from hil.instruments.sensors.fifo import Fifo, Packets
from hil.instruments.sensors.filters import BUTTERWORTH
from hil.instruments.sensors.recorder import FifoSensor
from hil.instruments.sensors.registers import Registers
from hil.instruments.sensors.scale import Scale
from hil.instruments.sensors.sensor import Chip, Sensor, SensorDriver
from hil.model.bench import Wire
from hil.model.errors import WrongIdentity
from hil.model.notation import measured

__all__ = ["Bmi088", "Bmi088Accelerometer", "Bmi088AccelerometerSettings", "Bmi088Gyroscope", "Bmi088GyroscopeSettings"]

_ACC_DATA, _TEMP = 0x12, 0x22
_ACC_CONF, _ACC_RANGE, _ACC_PWR_CONF, _ACC_PWR_CTRL, _ACC_SOFTRESET = 0x40, 0x41, 0x7C, 0x7D, 0x7E
_ACC_ON, _ACC_OFF = {_ACC_PWR_CONF: 0x00, _ACC_PWR_CTRL: 0x04}, {_ACC_PWR_CTRL: 0x00, _ACC_PWR_CONF: 0x03}
_ACC_RESET_S, _ACC_RESUME_S, _ACC_START_S = 0.001, 0.005, 0.05

_RATE_DATA, _FIFO_STATUS = 0x02, 0x0E
_GYRO_RANGE, _GYRO_BANDWIDTH, _GYRO_LPM1, _GYRO_SOFTRESET = 0x0F, 0x10, 0x11, 0x14
_GYRO_INT_CTRL, _INT3_INT4_IO_CONF, _INT3_INT4_IO_MAP, _FIFO_WM_ENABLE = 0x15, 0x16, 0x18, 0x1E
_FIFO_CONFIG_0, _FIFO_CONFIG_1, _FIFO_DATA = 0x3D, 0x3E, 0x3F
_BANDWIDTH_ONE = 0x80  # this bit always reads as 1
_NORMAL, _SUSPENDED = 0x00, 0x80
_BYPASS, _STREAM = 0x00, 0x80
_FRAMES, _OVERRUN = 0x7F, 0x80
_GYRO_START_S = 0.03
_SOFT_RESET = 0xB6

# Range: code; in deg/s, and in g.
_RATES_OF_TURN = {2000.0: 0, 1000.0: 1, 500.0: 2, 250.0: 3, 125.0: 4}
_ACCELERATIONS = {3.0: 0, 6.0: 1, 12.0: 2, 24.0: 3}
# Rate in Hz, and -3 dB bandwidth in Hz: code.
_GYRO_FILTERS = {
    (2000.0, 532.0): 0, (2000.0, 230.0): 1, (1000.0, 116.0): 2, (400.0, 47.0): 3,
    (200.0, 23.0): 4, (100.0, 12.0): 5, (200.0, 64.0): 6, (100.0, 32.0): 7,
}  # fmt: skip
_ACC_FILTERS = {
    12.5: (5, 5.0),
    25.0: (6, 10.0),
    50.0: (7, 20.0),
    100.0: (8, 40.0),
    200.0: (9, 80.0),
    400.0: (10, 145.0),
}
_NORMAL_FILTER = 0b1010 << 4
_GYRO_NOISE, _ACC_NOISE = 0.014, 190e-6  # deg/s/sqrt(Hz) and g/sqrt(Hz), one-sided, typical
_STANDARD_GRAVITY = 9.80665
_HALF = 32768
_RAILS = (-_HALF, _HALF - 1)

_CELSIUS = Scale(per_unit=256.0, zero=23.0, rails=(((-45 - 23) * 256), ((95 - 23) * 256)))
"""Temperature of the package, rated from -40 to 85 degC; 8000h marks an invalid reading."""


def _decoded(data: bytes) -> Packets:
    counts = np.frombuffer(data, "<i2").reshape(-1, 3).astype(np.int16)
    return Packets(counts, np.ones(len(counts), dtype=np.bool_))


def _prepared(watermark: int) -> Mapping[int, int]:
    return {_FIFO_CONFIG_0: watermark}


def _filling(interrupt: bool) -> Mapping[int, int]:
    del interrupt  # the host polls the fill level
    return {_FIFO_CONFIG_1: _STREAM}


FIFO = Fifo(
    size=600,
    packet=6,
    count=_FIFO_STATUS,
    count_bytes=1,
    count_mask=_FRAMES,
    unit=6,
    data=_FIFO_DATA,
    lost=_FIFO_STATUS,
    lost_flag=_OVERRUN,
    lost_flag_stays=True,
    temperature=_TEMP,
    temperature_on_other=True,
    prepare=_prepared,
    flush=(_FIFO_CONFIG_1, _BYPASS),
    fill=_filling,
    off={_FIFO_CONFIG_1: _BYPASS},
    decode=_decoded,
)
"""The gyroscope's FIFO: a hundred packets of three axes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bmi088GyroscopeSettings:
    """Wire settings of the gyroscope.

    Attributes:
        range: [deg/s].
        rate: sampling rate [Hz].
        bandwidth: -3 dB bandwidth [Hz], None for the widest at that rate.
    """

    range: Annotated[float, measured("deg/s", choices=tuple(_RATES_OF_TURN))] = 2000.0
    rate: Annotated[float, measured("Hz", choices=(100.0, 200.0, 400.0, 1000.0, 2000.0))] = 100.0
    bandwidth: Annotated[float | None, measured("Hz")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Bmi088AccelerometerSettings:
    """Wire settings of the accelerometer: range [g] and sampling rate [Hz]."""

    range: Annotated[float, measured("g", choices=tuple(_ACCELERATIONS))] = 24.0
    rate: Annotated[float, measured("Hz", choices=tuple(_ACC_FILTERS))] = 100.0


class Bmi088Accelerometer(Axes):
    """The accelerometer, with the package's thermometer."""

    chip: ClassVar[Chip] = Chip(
        model="BMI088",
        driver="bmi088",
        role="accelerometer",
        identity=(0x00, 0x1E),
        identity_name="ACC_CHIP_ID",
        strap="SDO1",
        addresses=(0x18, 0x19),
    )
    measures: ClassVar[tuple[Channel, ...]] = three_axes("m/s2")
    axes_at: ClassVar[int] = _ACC_DATA
    temperature_at: ClassVar[int] = _TEMP

    def __init__(self, registers: Registers, clock: Clock, wire: Wire) -> None:
        own = settings.read(wire, Bmi088AccelerometerSettings)
        code, cut_off = _ACC_FILTERS[own.rate]
        self._settings = {_ACC_CONF: _NORMAL_FILTER | code, _ACC_RANGE: _ACCELERATIONS[own.range]}
        sampling = Sampling(
            rate=own.rate,
            axes=Scale(per_unit=_HALF / own.range, factor=_STANDARD_GRAVITY, rails=_RAILS),
            temperature=_CELSIUS,
            order="little",
            temperature_order="big",
            full_scale=own.range * _STANDARD_GRAVITY,
            density=_ACC_NOISE,
            bandwidth=cut_off * BUTTERWORTH,
            awake=_ACC_ON,
        )
        super().__init__(registers, clock, wire, sampling)

    def _wake(self) -> None:
        """Reset the die unless the gyroscope reads its temperature there; resume, configure, read the settings back."""
        if not self._others_run():
            self._registers.write(_ACC_SOFTRESET, _SOFT_RESET)
            self._clock.sleep(_ACC_RESET_S)
        _resume(self._registers, self._clock)
        self._registers.put(self._settings)
        self._clock.sleep(self._sampling.period)
        self._wait_until_valid(_ACC_START_S, f"{_ACC_START_S} s after the accelerometer was switched on")

    def _sleep(self) -> None:
        """Suspend the die and read that back, unless the gyroscope reads its temperature there."""
        if not self._others_run():
            self._registers.put(_ACC_OFF)


class Bmi088Gyroscope(FifoSensor):
    """The gyroscope. Its temperature is read from the accelerometer's die."""

    chip: ClassVar[Chip] = Chip(
        model="BMI088",
        driver="bmi088",
        role="gyroscope",
        identity=(0x00, 0x0F),
        identity_name="GYRO_CHIP_ID",
        strap="SDO2",
        addresses=(0x68, 0x69),
        second=True,
    )
    measures: ClassVar[tuple[Channel, ...]] = three_axes("deg/s")
    fifo: ClassVar[Fifo] = FIFO
    axes_at: ClassVar[int] = _RATE_DATA
    temperature_at: ClassVar[int] = _TEMP
    temperature_on_other: ClassVar[bool] = True

    def __init__(self, registers: Registers, clock: Clock, wire: Wire) -> None:
        own = settings.read(wire, Bmi088GyroscopeSettings)
        known = [bandwidth for rate, bandwidth in _GYRO_FILTERS if rate == own.rate]
        cut_off = max(known) if own.bandwidth is None else own.bandwidth
        if cut_off not in known:
            choices = " or ".join(f"{each:g}" for each in sorted(known))
            raise settings.wrong(wire, "bandwidth", f"must be {choices} Hz at {own.rate:g} Hz")
        self._settings = {
            _GYRO_RANGE: _RATES_OF_TURN[own.range],
            _GYRO_BANDWIDTH: _BANDWIDTH_ONE | _GYRO_FILTERS[own.rate, cut_off],
            _GYRO_LPM1: _NORMAL,
        }
        sampling = Sampling(
            rate=own.rate,
            axes=Scale(per_unit=_HALF / own.range, rails=_RAILS),
            temperature=_CELSIUS,
            order="little",
            temperature_order="big",
            full_scale=own.range,
            density=_GYRO_NOISE,
            bandwidth=cut_off * BUTTERWORTH,
            awake={register: self._settings[register] for register in (_GYRO_LPM1, _GYRO_RANGE, _GYRO_BANDWIDTH)},
        )
        super().__init__(registers, clock, wire, sampling)

    @property
    def _thermal(self) -> Registers:
        """The die with the thermometer."""
        return self._registers.other or self._registers

    def _wake(self) -> None:
        """Reset and configure the die, wake the other die for the temperature, read all back, and wait for data."""
        chip = Bmi088Accelerometer.chip
        if (name := chip.name_of(self._thermal)) != chip.identity[1]:
            raise WrongIdentity(
                self._device,
                f"{chip.identity_name} is {name:#04x} at address {self._thermal.address:#04x}, the {chip.model} has"
                f" {chip.identity[1]:#04x}",
                f"compare the address in the bench file with the board's {chip.strap} strap",
            )
        self._registers.write(_GYRO_SOFTRESET, _SOFT_RESET)
        self._clock.sleep(_GYRO_START_S)
        self._registers.set(self._settings)
        self._clock.sleep(_GYRO_START_S)
        self._registers.expect(self._settings)
        if not self._others_run():
            _resume(self._thermal, self._clock)
        self._wait_until_valid(_ACC_START_S, f"{_GYRO_START_S} s after the gyroscope was set")

    def _sleep(self) -> None:
        """Suspend this die, and the other die unless the accelerometer runs; read that back."""
        self._registers.put({_GYRO_LPM1: _SUSPENDED})
        if not self._others_run():
            self._thermal.put(_ACC_OFF)


class Bmi088(SensorDriver):
    """Driver `bmi088`: roles `accelerometer`, `gyroscope` and `thermometer`, on a bus of the host or of an OBC.

    `address` is that of the accelerometer's die, `second_address` that of the gyroscope's.
    """

    roles: ClassVar[frozenset[str]] = frozenset({"accelerometer", "gyroscope", "thermometer"})
    sensor: ClassVar[type[Sensor]] = Bmi088Accelerometer
    others: ClassVar[tuple[type[Sensor], ...]] = (Bmi088Gyroscope,)


def _resume(registers: Registers, clock: Clock) -> None:
    """Switch the accelerometer's die on, and read that back."""
    for register, value in _ACC_ON.items():
        registers.write(register, value)
        clock.sleep(_ACC_RESUME_S)
    clock.sleep(_ACC_START_S)
    registers.expect(_ACC_ON)
