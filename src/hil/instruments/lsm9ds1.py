"""ST LSM9DS1 on an I2C bus: gyroscope and accelerometer on one die, magnetometer on another, one address each.

Registers, scales and ranges: data sheet DocID025715, as implemented by public drivers (Adafruit, SparkFun, ST). From
memory: cut-off frequencies of the first low-pass filter, start-up time of the gyroscope, the FIFO; filters are modelled
as second-order Butterworth filters. The data sheet states no noise: the expected value is that of one unit.

Pitfalls that are avoided. The temperature is 25 degC + counts / 16 (one widely used driver has another formula). The
accelerometer's range codes are not in order of range. While the gyroscope runs, the accelerometer samples at its rate.
With the gyroscope on, the FIFO's 32 levels hold both sensors, and a block read alternates between the axes of the
gyroscope and of the accelerometer; beside other roles the gyroscope is polled for its samples.
The magnetometer powers up in power-down, increments the register address only if the address says so, and has no
thermometer: that is on the other die, which measures only while a sensor there is on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from hil.clock.port import Clock
from hil.instruments import settings
from hil.instruments.lis3mdl import Lis3mdlMagnetometer
from hil.instruments.sampled import Channel
from hil.instruments.sensors.axes import Sampling, three_axes
from hil.instruments.sensors.fifo import Fifo, Packets
from hil.instruments.sensors.filters import BUTTERWORTH
from hil.instruments.sensors.recorder import FifoSensor
from hil.instruments.sensors.registers import Registers
from hil.instruments.sensors.scale import Scale
from hil.instruments.sensors.sensor import Chip, Sensor, SensorDriver
from hil.instruments.sensors.shared_die import SharedDie
from hil.model.bench import Wire
from hil.model.errors import Refused
from hil.model.notation import measured

__all__ = ["Lsm9ds1", "Lsm9ds1Accelerometer", "Lsm9ds1Gyroscope", "Lsm9ds1Magnetometer"]

_CTRL_REG1_G, _CTRL_REG2_G, _CTRL_REG3_G, _CTRL_REG4, _CTRL_REG5_XL, _CTRL_REG6_XL = 0x10, 0x11, 0x12, 0x1E, 0x1F, 0x20
_CTRL_REG7_XL, _CTRL_REG8, _CTRL_REG9, _FIFO_CTRL, _FIFO_SRC = 0x21, 0x22, 0x23, 0x2E, 0x2F
_OUT_TEMP, _STATUS, _OUT_G, _OUT_XL = 0x15, 0x17, 0x18, 0x28
_GYRO_NEW, _ACCEL_NEW, _TEMPERATURE_NEW = 0x02, 0x01, 0x04
_RESET, _WHOLE_BLOCKS = 0x05, 0x44  # both keep address auto-increment on, as after power-on
_ALL_AXES = 0x38
_FIFO_ON, _BYPASS, _CONTINUOUS, _OVERRUN, _STORED = 0x02, 0x00, 0xC0, 0x40, 0x3F
_LEVELS, _LEVEL_BYTES = 32, 12
_RESET_S = 0.05
_START_S = 0.08
_LONGEST_START_S = 0.5

# Range: code, and per count: mdeg/s, mg, mgauss.
_TURNS = {245.0: (0b00, 8.75), 500.0: (0b01, 17.5), 2000.0: (0b11, 70.0)}
_ACCELERATIONS = {2.0: (0b00, 0.061), 4.0: (0b10, 0.122), 8.0: (0b11, 0.244), 16.0: (0b01, 0.732)}
_FIELDS = {4.0: (0b00, 0.14), 8.0: (0b01, 0.29), 12.0: (0b10, 0.43), 16.0: (0b11, 0.58)}
# Rate in Hz: code, and -3 dB bandwidth in Hz. The accelerometer's slowest rates exist only without the gyroscope.
_GYRO_RATES = {
    14.9: (1, 5.0), 59.5: (2, 19.0), 119.0: (3, 38.0), 238.0: (4, 76.0), 476.0: (5, 100.0), 952.0: (6, 100.0),
}  # fmt: skip
_ACCEL_RATES = {
    10.0: (1, 408.0), 50.0: (2, 408.0), 119.0: (3, 50.0), 238.0: (4, 105.0), 476.0: (5, 211.0), 952.0: (6, 408.0),
}  # fmt: skip
_TEN_HERTZ = 1 << 5
_GYRO_NOISE, _ACCEL_NOISE = 0.007, 90e-6  # deg/s/sqrt(Hz) and g/sqrt(Hz)
_STANDARD_GRAVITY = 9.80665
_RAILS = (-32768, 32767)
_CELSIUS = Scale(per_unit=16.0, zero=25.0, rails=(-(45 + 25) * 16, (95 - 25) * 16))  # made for -40 to 85 degC

_INERTIAL = Chip(
    model="LSM9DS1",
    driver="lsm9ds1",
    role="gyroscope",
    identity=(0x0F, 0x68),
    strap="SDO_A/G",
    addresses=(0x6A, 0x6B),
)


def _decoded(data: bytes) -> Packets:
    """Decode the gyroscope's axes, which precede the accelerometer's."""
    counts = np.frombuffer(data, dtype="<i2").reshape(-1, _LEVEL_BYTES // 2)[:, :3].astype(np.int16)
    return Packets(counts=counts, usable=np.ones(len(counts), dtype=np.bool_))


_FIFO = Fifo(
    size=_LEVELS * _LEVEL_BYTES,
    packet=_LEVEL_BYTES,
    count=_FIFO_SRC,
    count_bytes=1,
    count_mask=_STORED,
    unit=_LEVEL_BYTES,
    data=_OUT_G,
    lost=_FIFO_SRC,
    lost_flag=_OVERRUN,
    temperature=_OUT_TEMP,
    prepare=lambda _: {_CTRL_REG9: _FIFO_ON},
    flush=(_FIFO_CTRL, _BYPASS),
    fill=lambda _: {_FIFO_CTRL: _CONTINUOUS},
    off={_FIFO_CTRL: _BYPASS, _CTRL_REG9: 0},
    decode=_decoded,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Lsm9ds1GyroscopeSettings:
    """Wire settings of the gyroscope: range [deg/s] and sampling rate [Hz]."""

    range: Annotated[float, measured("deg/s", choices=tuple(_TURNS))] = 245.0
    rate: Annotated[float, measured("Hz", choices=tuple(_GYRO_RATES))] = 119.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Lsm9ds1AccelerometerSettings:
    """Wire settings of the accelerometer: range [g] and sampling rate [Hz], the gyroscope's where one is wired."""

    range: Annotated[float, measured("g", choices=tuple(_ACCELERATIONS))] = 2.0
    rate: Annotated[float, measured("Hz", choices=tuple(_ACCEL_RATES))] = 119.0


class _Inertial(SharedDie):
    """One of the two sensors on the first die; subclasses hold what differs.

    Attributes:
        control: its control register, which is 0 while it is off.
    """

    control: ClassVar[int]
    reset: ClassVar[tuple[int, int, float]] = (_CTRL_REG8, _RESET, _RESET_S)
    temperature_at: ClassVar[int] = _OUT_TEMP
    controls: int

    def _wake(self) -> None:
        """Reset the die unless another sensor needs it, configure it, read all back, and wait for the first sample."""
        for other in (self.beside.get("gyroscope"), self.beside.get("accelerometer")):
            if isinstance(other, _Inertial) and other.controls >> 5 != self.controls >> 5:
                raise Refused(
                    f"{self._device}: gyroscope and accelerometer have one rate, and are wired for {self.rate:g} and"
                    f" {other.rate:g} Hz",
                    "give both wires the same rate; to 14.9 Hz belong 10 Hz of the accelerometer, to 59.5 Hz 50 Hz",
                )
        self._reset_alone()
        wanted = {
            _CTRL_REG8: _WHOLE_BLOCKS,
            _CTRL_REG2_G: 0,  # no second filter,
            _CTRL_REG3_G: 0,  # no high-pass filter, no low-power mode
            _CTRL_REG4: _ALL_AXES,
            _CTRL_REG5_XL: _ALL_AXES,
            _CTRL_REG7_XL: 0,
            self.control: self.controls,
        }
        self._registers.set(wanted)
        self._read_outputs()  # clears the flags of an old sample
        self._clock.sleep(_START_S)
        self._registers.expect(wanted)
        self._reset_stillness()
        fault = (
            f"no new sample {_START_S + _LONGEST_START_S:.2f} s after it was switched on",
            "check the sensor's power",
        )
        self._wait_for(self._is_fresh, _LONGEST_START_S, self._sampling.period, fault)
        self._wait_until_valid(_LONGEST_START_S, "after it was switched on")

    def _sleep(self) -> None:
        """Switch this sensor off and read that back; the die stays on for a magnetometer that needs its thermometer."""
        self._registers.put({self.control: 0})
        _rest(self._registers, self.beside)

    @property
    def rate(self) -> float:
        """Nominal sampling rate in Hz."""
        return self._sampling.rate


class Lsm9ds1Gyroscope(_Inertial, FifoSensor):
    """The gyroscope, which can stream."""

    can_be_asked: ClassVar[bool] = True
    fifo: ClassVar[Fifo] = _FIFO
    chip: ClassVar[Chip] = _INERTIAL
    measures: ClassVar[tuple[Channel, ...]] = three_axes("deg/s")
    control: ClassVar[int] = _CTRL_REG1_G
    fresh: ClassVar[tuple[int, int]] = (_STATUS, _GYRO_NEW | _TEMPERATURE_NEW)
    axes_at: ClassVar[int] = _OUT_G
    together: ClassVar[bool] = True

    def __init__(self, registers: Registers, clock: Clock, wire: Wire) -> None:
        own = settings.read(wire, Lsm9ds1GyroscopeSettings)
        code, milli = _TURNS[own.range]
        rate, cut_off = _GYRO_RATES[own.rate]
        self.controls = rate << 5 | code << 3
        sampling = Sampling(
            rate=own.rate,
            axes=Scale(per_unit=1000.0 / milli, rails=_RAILS),
            temperature=_CELSIUS,
            order="little",
            full_scale=own.range,
            density=_GYRO_NOISE,
            bandwidth=cut_off * BUTTERWORTH,
            awake={_CTRL_REG1_G: self.controls},
        )
        super().__init__(registers, clock, wire, sampling)


class Lsm9ds1Accelerometer(_Inertial):
    """The accelerometer."""

    chip: ClassVar[Chip] = replace(_INERTIAL, role="accelerometer")
    measures: ClassVar[tuple[Channel, ...]] = three_axes("m/s2")
    control: ClassVar[int] = _CTRL_REG6_XL
    fresh: ClassVar[tuple[int, int]] = (_STATUS, _ACCEL_NEW | _TEMPERATURE_NEW)
    axes_at: ClassVar[int] = _OUT_XL

    def __init__(self, registers: Registers, clock: Clock, wire: Wire) -> None:
        own = settings.read(wire, Lsm9ds1AccelerometerSettings)
        code, milli = _ACCELERATIONS[own.range]
        rate, cut_off = _ACCEL_RATES[own.rate]
        self.controls = rate << 5 | code << 3
        sampling = Sampling(
            rate=own.rate,
            axes=Scale(per_unit=1000.0 / milli, factor=_STANDARD_GRAVITY, rails=_RAILS),
            temperature=_CELSIUS,
            order="little",
            full_scale=own.range * _STANDARD_GRAVITY,
            density=_ACCEL_NOISE,
            bandwidth=cut_off * BUTTERWORTH,
            awake={_CTRL_REG6_XL: self.controls},
        )
        super().__init__(registers, clock, wire, sampling)


class Lsm9ds1Magnetometer(Lis3mdlMagnetometer):
    """The magnetometer: registers of a LIS3MDL, but other scales, and the other die's thermometer.

    The bit that enables a LIS3MDL's thermometer enables this one's temperature compensation.
    """

    chip: ClassVar[Chip] = Chip(
        model="LSM9DS1",
        driver="lsm9ds1",
        role="magnetometer",
        identity=(0x0F, 0x3D),
        identity_name="WHO_AM_I_M",
        strap="SDO_M",
        addresses=(0x1C, 0x1E),
        second=True,
        increment=0x80,
    )
    ranges: ClassVar[dict[float, tuple[int, float]]] = {
        gauss: (code, 1000.0 / milli) for gauss, (code, milli) in _FIELDS.items()
    }

    def _wake(self) -> None:
        """Wake the thermometer, then the magnetometer."""
        if not _any_inertial(self.beside):
            _keep_thermometer_on(self._inertial, _TEN_HERTZ)
            self._read_die_temperature()  # clears the flag of an old one
            fault = (f"no temperature {_LONGEST_START_S} s after its die was switched on", "check the sensor's power")
            self._wait_for(self._has_temperature, _LONGEST_START_S, _START_S, fault)
        super()._wake()

    def _sleep(self) -> None:
        """Power down the magnetometer, and the other die unless a sensor there runs; read that back."""
        super()._sleep()
        _rest(self._inertial, self.beside)

    def _has_temperature(self) -> bool:
        return bool(self._inertial.read(_STATUS) & _TEMPERATURE_NEW)

    @property
    def _inertial(self) -> Registers:
        return self._registers.other or self._registers

    def _read_die_temperature(self) -> float:
        self._warm = self._inertial.block(_OUT_TEMP, 2)
        return _CELSIUS.number(int.from_bytes(self._warm, "little", signed=True))


class Lsm9ds1(SensorDriver):
    """Driver `lsm9ds1`: roles `gyroscope`, `accelerometer`, `magnetometer` and `thermometer`.

    `address` is that of gyroscope and accelerometer, `second_address` that of the magnetometer.
    """

    roles: ClassVar[frozenset[str]] = frozenset({"accelerometer", "gyroscope", "magnetometer", "thermometer"})
    sensor: ClassVar[type[Sensor]] = Lsm9ds1Gyroscope
    others: ClassVar[tuple[type[Sensor], ...]] = (Lsm9ds1Accelerometer, Lsm9ds1Magnetometer)


def _any_inertial(beside: Mapping[str, Sensor]) -> bool:
    """Return whether gyroscope or accelerometer runs, and with it the thermometer."""
    return any(each.running for each in beside.values() if isinstance(each, _Inertial))


def _rest(registers: Registers, beside: Mapping[str, Sensor]) -> None:
    """If no sensor of the first die runs, put it to sleep, or leave it on for a magnetometer's thermometer."""
    field = beside.get("magnetometer")
    if not _any_inertial(beside):
        _keep_thermometer_on(registers, _TEN_HERTZ if field is not None and field.running else 0)


def _keep_thermometer_on(registers: Registers, rate: int) -> None:
    """Set the accelerometer's rate just to keep the thermometer running, or 0 for off; read that back."""
    registers.put({_CTRL_REG6_XL: rate})
