"""Bosch BNO055 gyroscope, accelerometer and magnetometer on an I2C bus, in its non-fusion modes.

Registers, modes and mode-switching times: data sheet BST-BNO055-DS000-14; magnetometer rates, bandwidths and
TEMP_SOURCE are from memory of it. The chip has no FIFO and no data-ready flag. It accepts settings in CONFIGMODE only,
and without fusion compensates nothing. It stretches the clock for long, and not every controller allows that (the
Raspberry Pi's does not: raspberrypi/linux 254, 4884), so a sample is read in one transfer together with the registers
that follow it: units and mode must be as set. On an OBC's bus the board's timer does the reading.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, ClassVar

from hil.clock.port import Clock
from hil.instruments import settings
from hil.instruments.sampled import Channel
from hil.instruments.sensors.axes import Sampling, three_axes
from hil.instruments.sensors.filters import BUTTERWORTH
from hil.instruments.sensors.registers import Banks, Registers
from hil.instruments.sensors.scale import Scale
from hil.instruments.sensors.sensor import Chip, Sensor, SensorDriver
from hil.instruments.sensors.timed import Outputs, TimedSensor
from hil.model.bench import Wire
from hil.model.errors import Garbled, NoReply
from hil.model.notation import measured

__all__ = ["Bno055", "Bno055Accelerometer", "Bno055Gyroscope", "Bno055Magnetometer"]


class Register(IntEnum):
    """Registers by page (high byte) and number (low byte)."""

    CHIP_ID, PAGE_ID, ACC_DATA, MAG_DATA, GYR_DATA, TEMP = 0x00, 0x07, 0x08, 0x0E, 0x14, 0x34
    SYS_STATUS, SYS_ERR, UNIT_SEL, OPR_MODE, PWR_MODE = 0x39, 0x3A, 0x3B, 0x3D, 0x3E
    TEMP_SOURCE, AXIS_MAP_CONFIG, AXIS_MAP_SIGN = 0x40, 0x41, 0x42
    ACC_CONFIG, MAG_CONFIG, GYR_CONFIG_0, GYR_CONFIG_1 = 0x108, 0x109, 0x10A, 0x10B


_CONFIG, _MAGGYRO, _AMG = 0x00, 0x06, 0x07
_TO_CONFIG_S, _FROM_CONFIG_S = 0.025, 0.01  # 19 ms, 7 ms
_BOOT_S = 0.7  # 650 ms
_POLL_S = 0.05
_NORMAL, _SUSPENDED = 0x00, 0x02
_UNITS, _UNITS_AFTER_RESET = 0x00, 0x80  # deg/s, m/s2, degC
_SYSTEM_ERROR = 0x01
_COMMON: Mapping[int, int] = {
    Register.PWR_MODE: _NORMAL,
    Register.UNIT_SEL: _UNITS,
    Register.TEMP_SOURCE: 0x01,  # the gyroscope, which is on in both modes
    Register.AXIS_MAP_CONFIG: 0x24,
    Register.AXIS_MAP_SIGN: 0x00,
}

_RATE = 100.0
_GRAVITY = 9.80665
_GYRO_RANGES = (2000.0, 1000.0, 500.0, 250.0, 125.0)
_GYRO_CUT_OFFS = (523.0, 230.0, 116.0, 47.0, 23.0, 12.0, 64.0, 32.0)
_ACCEL_RANGES = (2.0, 4.0, 8.0, 16.0)
_ACCEL_CUT_OFFS = (7.81, 15.63, 31.25, 62.5, 125.0, 250.0, 500.0, 1000.0)
_MAG_RATES = (2.0, 6.0, 8.0, 10.0, 15.0, 20.0, 25.0, 30.0)
_REGULAR = 0b01 << 3
_MAG_RANGE = 1300.0  # of x and y; z has more
_GYRO_NOISE, _ACCEL_NOISE = 0.014, 150e-6 * _GRAVITY  # one-sided, typical: deg/s/sqrt(Hz), m/s2/sqrt(Hz)
_CELSIUS = Scale(per_unit=1.0, rails=(-41, 86))


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroscopeSettings:
    """Wire settings: range [deg/s] and -3 dB bandwidth [Hz]."""

    range: Annotated[float, measured("deg/s", choices=_GYRO_RANGES)] = 2000.0
    bandwidth: Annotated[float, measured("Hz", choices=_GYRO_CUT_OFFS)] = 32.0


@dataclass(frozen=True, slots=True, kw_only=True)
class AccelerometerSettings:
    """Wire settings: range [g] and -3 dB bandwidth [Hz]."""

    range: Annotated[float, measured("g", choices=_ACCEL_RANGES)] = 16.0
    bandwidth: Annotated[float, measured("Hz", choices=_ACCEL_CUT_OFFS)] = 62.5


@dataclass(frozen=True, slots=True, kw_only=True)
class MagnetometerSettings:
    """Wire settings: sampling rate [Hz]."""

    rate: Annotated[float, measured("Hz", choices=_MAG_RATES)] = 20.0


def _chip(role: str) -> Chip:
    return Chip(
        model="BNO055",
        driver="bno055",
        role=role,
        identity=(Register.CHIP_ID, 0xA0),
        identity_name="CHIP_ID",
        strap="COM3",
        addresses=(0x28, 0x29),
        banks=Banks(register=Register.PAGE_ID, most=1),
    )


def _sampling(per_unit: float, full_scale: float, *, rate: float, density: float, bandwidth: float) -> Sampling:
    """Return the sampling of a sensor whose readings saturate at the ends of its range."""
    rail = round(full_scale * per_unit)
    return Sampling(
        rate=rate,
        axes=Scale(per_unit=per_unit, rails=(-rail, rail)),
        temperature=_CELSIUS,
        order="little",
        full_scale=full_scale,
        density=density,
        bandwidth=bandwidth,
        awake={},
    )


class _Bno055(TimedSensor):
    """One of the chip's sensors. The first to start configures every wired one; later ones only join in."""

    own: Mapping[int, int]

    def _identify(self) -> None:
        """Read the chip's ID; it answers only from 650 ms after power-on."""
        deadline = self._clock.now() + _BOOT_S
        while True:
            try:
                return super()._identify()
            except NoReply:
                if self._clock.now() >= deadline:
                    raise
            self._clock.sleep(_POLL_S)

    def _wake(self) -> None:
        """Configure the chip in CONFIGMODE unless another of its sensors runs, read all back, and start sampling."""
        if not self._others_run():
            self._switch(_CONFIG, _TO_CONFIG_S)
            wanted = dict(_COMMON)
            for each in self.beside.values():
                wanted |= each.own if isinstance(each, _Bno055) else {}
            wanted |= self.own
            self._registers.put(wanted)
            self._switch(self._mode, _FROM_CONFIG_S)
        self._reset_stillness()
        self._clock.sleep(2.0 * self._sampling.period)  # there is no data-ready flag
        self._read_outputs()

    def _sleep(self) -> None:
        """Suspend the chip unless another of its sensors runs, and read that back."""
        if not self._others_run():
            self._switch(_CONFIG, _TO_CONFIG_S)
            self._registers.put({Register.PWR_MODE: _SUSPENDED})

    @property
    def _mode(self) -> int:
        """The operating mode for the wired sensors: `maggyro`, or `amg` with the accelerometer."""
        return _AMG if "accelerometer" in {*self.beside, self.chip.role} else _MAGGYRO

    def _switch(self, mode: int, seconds: float) -> None:
        self._registers.write(Register.OPR_MODE, mode)
        self._clock.sleep(seconds)
        self._registers.expect({Register.OPR_MODE: mode})

    def _read_outputs(self) -> tuple[int, tuple[int, ...]]:
        """Read axes, temperature and the status registers that follow them in one transfer."""
        outputs = self._outputs()
        data = self._registers.long(outputs.first, outputs.length)
        self._judge(data)
        at = outputs.temperature
        return self._sampling.temperature_counts(data[at : at + 1]), struct.unpack("<hhh", data[:6])

    def _outputs(self) -> Outputs:
        first = self.axes_at
        return Outputs(
            first=first,
            length=Register.OPR_MODE + 1 - first,
            axes=0,
            temperature=Register.TEMP - first,
            steady=slice(Register.SYS_STATUS - first, Register.OPR_MODE + 1 - first),
            judge=self._judge,
        )

    def _judge(self, data: bytes) -> None:
        """Raise the fault that the registers after axes and temperature show."""
        first = self.axes_at
        status, error, units, _, mode = data[Register.SYS_STATUS - first :]
        if (mode, units) == (_CONFIG, _UNITS_AFTER_RESET):
            raise NoReply(
                self._device, "it is in CONFIGMODE: it has lost its settings", "check its power, and start it again"
            )
        if (mode, units) != (self._mode, _UNITS):
            raise Garbled(
                self._device,
                f"OPR_MODE reads {mode:#04x} and UNIT_SEL {units:#04x}, set were {self._mode:#04x} and {_UNITS:#04x}",
                "use a bus that waits while the sensor holds the clock (i2c-gpio), and look what else writes to it",
            )
        if status == _SYSTEM_ERROR:
            raise NoReply(self._device, f"it reports the system error {error}", "switch it off and on")

    def _temperature_bytes(self) -> bytes:
        return self._read_outputs()[0].to_bytes(1, "little", signed=True)


class Bno055Gyroscope(_Bno055):
    """The chip's gyroscope, uncompensated."""

    chip: ClassVar[Chip] = _chip("gyroscope")
    measures: ClassVar[tuple[Channel, ...]] = three_axes("deg/s")
    axes_at: ClassVar[int] = Register.GYR_DATA

    def __init__(self, registers: Registers, clock: Clock, wire: Wire) -> None:
        own = settings.read(wire, GyroscopeSettings)
        code = _GYRO_CUT_OFFS.index(own.bandwidth) << 3 | _GYRO_RANGES.index(own.range)
        self.own = {Register.GYR_CONFIG_0: code, Register.GYR_CONFIG_1: 0}
        bandwidth = own.bandwidth * BUTTERWORTH
        sampling = _sampling(16.0, own.range, rate=_RATE, density=_GYRO_NOISE, bandwidth=bandwidth)
        super().__init__(registers, clock, wire, sampling)


class Bno055Accelerometer(_Bno055):
    """The chip's accelerometer."""

    chip: ClassVar[Chip] = _chip("accelerometer")
    measures: ClassVar[tuple[Channel, ...]] = three_axes("m/s2")
    axes_at: ClassVar[int] = Register.ACC_DATA

    def __init__(self, registers: Registers, clock: Clock, wire: Wire) -> None:
        own = settings.read(wire, AccelerometerSettings)
        code = _ACCEL_CUT_OFFS.index(own.bandwidth) << 2 | _ACCEL_RANGES.index(own.range)
        self.own = {Register.ACC_CONFIG: code}
        bandwidth = own.bandwidth * BUTTERWORTH
        sampling = _sampling(100.0, own.range * _GRAVITY, rate=_RATE, density=_ACCEL_NOISE, bandwidth=bandwidth)
        super().__init__(registers, clock, wire, sampling)


class Bno055Magnetometer(_Bno055):
    """The chip's magnetometer, uncompensated."""

    chip: ClassVar[Chip] = _chip("magnetometer")
    measures: ClassVar[tuple[Channel, ...]] = three_axes("uT")
    axes_at: ClassVar[int] = Register.MAG_DATA

    def __init__(self, registers: Registers, clock: Clock, wire: Wire) -> None:
        rate = settings.read(wire, MagnetometerSettings).rate
        self.own = {Register.MAG_CONFIG: _REGULAR | _MAG_RATES.index(rate)}
        sampling = _sampling(16.0, _MAG_RANGE, rate=rate, density=math.inf, bandwidth=rate / 2)
        super().__init__(registers, clock, wire, sampling)


class Bno055(SensorDriver):
    """Driver `bno055`: roles `gyroscope`, `accelerometer`, `magnetometer`, and `thermometer` for the die temperature.

    A wire may set `range` (deg/s or g) and `bandwidth` (-3 dB, Hz), and for the magnetometer `rate` (Hz).
    """

    roles: ClassVar[frozenset[str]] = frozenset({"gyroscope", "accelerometer", "magnetometer", "thermometer"})
    sensor: ClassVar[type[Sensor]] = Bno055Gyroscope
    others: ClassVar[tuple[type[Sensor], ...]] = (Bno055Accelerometer, Bno055Magnetometer)
