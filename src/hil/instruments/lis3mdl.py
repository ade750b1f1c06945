"""ST LIS3MDL three-axis magnetometer on an I2C bus.

Registers and their meaning: LIS3MDL data sheet (DocID024204) and AN4602. Two pitfalls are avoided. A block read that
starts at the X axis wraps from Z back to X, so the temperature is read separately; and the temperature's zero is
25 degC, with 8 counts per degree (AN4602).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Annotated, ClassVar

from hil.clock.port import Clock
from hil.instruments import settings
from hil.instruments.sensors.axes import Field
from hil.instruments.sensors.registers import Registers
from hil.instruments.sensors.scale import Scale
from hil.instruments.sensors.sensor import Chip, Sensor, SensorDriver
from hil.model.bench import Wire
from hil.model.errors import Garbled
from hil.model.notation import measured

__all__ = ["Lis3mdl", "Lis3mdlMagnetometer", "Lis3mdlSettings"]

_WHO_AM_I, _ITS_NAME = 0x0F, 0x3D
_CTRL_REG1, _CTRL_REG2, _CTRL_REG3, _CTRL_REG4, _CTRL_REG5 = range(0x20, 0x25)
_STATUS_REG = 0x27
_OUT_X_L = 0x28
_TEMP_OUT_L = 0x2E
_AUTO_INCREMENT = 0x80

_TEMPERATURE_ON = 1 << 7
_ULTRA_HIGH_XY = 0b11 << 5
_FAST_RATE = 1 << 1
_ULTRA_HIGH_Z = 0b11 << 2
_BLOCK_DATA_UPDATE = 1 << 6
_CONTINUOUS, _POWER_DOWN = 0b00, 0b11
_NEW_XYZ = 1 << 3

# Range in gauss: (full-scale bits, counts per gauss). At 16 gauss the noise is 5 counts rms on each axis.
_RANGES = {4.0: (0b00, 6842.0), 8.0: (0b01, 3421.0), 12.0: (0b10, 2281.0), 16.0: (0b11, 1711.0)}
# Rate in Hz: bits of CTRL_REG1; 155 Hz is the fast rate of the ultra-high performance mode.
_RATES = {0.625 * 2**code: code << 2 for code in range(8)} | {155.0: _FAST_RATE}
_MICROTESLA_PER_GAUSS = 100.0
_CELSIUS = Scale(per_unit=8.0, zero=25.0, rails=(-(45 + 25) * 8, (95 - 25) * 8))  # made for -40 to 85 degC


@dataclass(frozen=True, slots=True, kw_only=True)
class Lis3mdlSettings:
    """Wire settings: range [gauss] and sampling rate [Hz]."""

    range: Annotated[float, measured("gauss", choices=tuple(_RANGES))] = 4.0
    rate: Annotated[float, measured("Hz", choices=tuple(_RATES))] = 80.0


class Lis3mdlMagnetometer(Field):
    """One sensor; fills the role `magnetometer`. Each sample is a new one.

    Attributes:
        ranges: full scale in gauss: its code, and counts per gauss.
    """

    chip: ClassVar[Chip] = Chip(
        model="LIS3MDL",
        driver="lis3mdl",
        role="magnetometer",
        identity=(_WHO_AM_I, _ITS_NAME),
        strap="SA1",
        addresses=(0x1C, 0x1E),
        increment=_AUTO_INCREMENT,
    )
    ranges: ClassVar[dict[float, tuple[int, float]]] = _RANGES

    def __init__(self, registers: Registers, clock: Clock, wire: Wire) -> None:
        own = settings.read(wire, Lis3mdlSettings)
        code, per_gauss = self.ranges[own.range]
        axes = Scale(per_unit=per_gauss, factor=_MICROTESLA_PER_GAUSS, full_scale=own.range, rails=(-32768, 32767))
        full_scale = own.range * _MICROTESLA_PER_GAUSS
        super().__init__(registers, clock, wire, rate=own.rate, axes=axes, full_scale=full_scale)
        self._last = self._warm = b""
        self._controls = bytes(
            (
                _TEMPERATURE_ON | _ULTRA_HIGH_XY | _RATES[self._rate],
                code << 5,
                _CONTINUOUS,
                _ULTRA_HIGH_Z,
                _BLOCK_DATA_UPDATE,
            )
        )

    def _wake(self) -> None:
        """Configure range and rate from power-down, read the settings back, and wait for the first new sample."""
        self._registers.write(_CTRL_REG3, _POWER_DOWN)
        for register in (_CTRL_REG1, _CTRL_REG2, _CTRL_REG4, _CTRL_REG5):
            self._registers.write(register, self._controls[register - _CTRL_REG1])
        self._last = self._registers.block(_OUT_X_L, 6)  # clears the flag of an old sample
        self._registers.write(_CTRL_REG3, _CONTINUOUS)
        self._registers.expect_block(_CTRL_REG1, self._controls)
        self._await_sample()
        self._reset_stillness()

    def _sleep(self) -> None:
        """Put the sensor into power-down and read it back."""
        self._registers.write(_CTRL_REG3, _POWER_DOWN)
        self._registers.expect_block(_CTRL_REG3, bytes((_POWER_DOWN,)))

    def _sample(self) -> tuple[float, ...]:
        """Wait for a new sample, for at most two sampling periods and a margin, and return it."""
        data = self._new() if self._registers.sparing else self._new_in_two_reads()
        celsius = self._die_temperature()
        ones = set(data) == {0xFF} and (self._registers.sparing or set(self._warm) == {0xFF})
        if ones and self.chip.name_of(self._registers) != _ITS_NAME:
            raise Garbled(self._device, "the bus reads nothing but ones", "check the sensor's power and its SDA wire")
        counts = struct.unpack("<hhh", data)
        self._stillness.judge(counts)
        return (*(self._axes.number(axis) for axis in counts), celsius)

    def _read_die_temperature(self) -> float:
        self._warm = self._registers.block(_TEMP_OUT_L, 2)
        return _CELSIUS.number(struct.unpack("<h", self._warm)[0])

    def _new(self) -> bytes:
        """Return a new sample, read together with the status in one transfer.

        A sample may arrive between the two, and is new although the status did not show it yet: reading it cleared the
        flag. Zeros after a reset look the same, but then the settings are gone.
        """

        def is_new() -> bool:
            read = self._registers.block(_STATUS_REG, 7)
            fresh = bool(read[0] & _NEW_XYZ) or (read[1:] != self._last and self._is_set())
            self._last = read[1:]
            return fresh

        self._await_new(is_new, self._rate)
        return self._last

    def _is_set(self) -> bool:
        return self._registers.block(_CTRL_REG1, len(self._controls)) == self._controls

    def _new_in_two_reads(self) -> bytes:
        self._await_sample()
        return self._registers.block(_OUT_X_L, 6)

    def _await_sample(self) -> None:
        self._await_new(lambda: bool(self._registers.read(_STATUS_REG) & _NEW_XYZ), self._rate)


class Lis3mdl(SensorDriver):
    """Driver `lis3mdl`: role `magnetometer`, and `thermometer` for the temperature of its die.

    A wire may set `range` (4, 8, 12 or 16 gauss; 4 where it does not) and `rate` (0.625, 1.25, 2.5, 5,
    10, 20, 40, 80 or 155 Hz; 80 where it does not).
    """

    roles: ClassVar[frozenset[str]] = frozenset({"magnetometer", "thermometer"})
    sensor: ClassVar[type[Sensor]] = Lis3mdlMagnetometer
