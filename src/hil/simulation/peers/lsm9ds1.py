"""An LSM9DS1 at register level: gyroscope and accelerometer on one die, magnetometer on another, an address each.

The data sheet (DocID025715) as public drivers have it (ST, Adafruit, SparkFun); cut-off frequencies and FIFO
from memory.

First die, 6Ah or 6Bh: WHO_AM_I 0Fh is 68h. After power-on CTRL_REG1_G 10h and CTRL_REG6_XL 20h are 0, both sensors off,
CTRL_REG4 and CTRL_REG5_XL 38h, CTRL_REG8 04h (a transfer goes on to the next register). ODR_G, the upper three bits of
10h, is 14.9, 59.5, 119, 238, 476, 952 Hz; with the gyroscope on, the accelerometer samples at that rate, else at
ODR_XL: 10, 50, 119, 238, 476, 952 Hz. FS_G is 245, 500, 2000 deg/s by 00, 01, 11 (8.75, 17.5, 70 mdeg/s per count);
FS_XL is 2, 16, 4, 8 g by 00, 01, 10, 11 (0.061, 0.732, 0.122, 0.244 mg). OUT_TEMP 15h has 16 counts per degC and is 0
at 25 degC. STATUS_REG 17h and 27h tell of new acceleration, rate, temperature in bits 0, 1, 2. Low byte first.

With FIFO_EN, bit 1 of CTRL_REG9 23h, and FMODE, the upper three bits of FIFO_CTRL 2Eh, 001 (stops when full) or 110
(the oldest level goes), samples go into a FIFO of 32 levels; 000 empties it. FIFO_SRC 2Fh tells in bit 7 that FTH, the
lower bits of 2Eh, is reached, in bit 6 (OVRN) that a level was overwritten, and below how many are stored. A transfer
from 18h on goes on from 1Dh to 28h and from 2Dh to 18h, level by level.

Second die, 1Ch or 1Eh: WHO_AM_I_M 0Fh is 3Dh, and registers as of the LIS3MDL, with 0.14, 0.29, 0.43, 0.58 mgauss per
count and no thermometer; bit 7 of CTRL_REG1_M compensates the sensitivity for temperature.

Assumed: the noise bandwidth is that of a Butterworth filter of second order at the first filter's cut-off frequency;
any change of rate or range starts the samples, and their noise, again, of both sensors; a read of any data takes away
the bits of the status; a level has the axes of both sensors, 0 of one that is off, and is gone, and OVRN with it, once
its last byte was read. Not modelled: second filters, high-pass filters, low-power mode, triggered modes of the FIFO and
that of the accelerometer alone, interrupts, self-test.
"""

from __future__ import annotations

from functools import partial
from math import pi, sin
from typing import ClassVar

from hil.simulation.faults import Drifting, Saturated, Stuck
from hil.simulation.peers.lis3mdl import Lis3mdl
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.sensors.chip import (
    Asleep,
    Datasheet,
    Fitted,
    OtherIdentity,
    Package,
    TemperatureRaw,
    number_at,
)
from hil.simulation.peers.sensors.elements import FieldElement
from hil.simulation.peers.sensors.fifo import Fifo
from hil.simulation.peers.sensors.inertial import InertialDie, Senses, Setting
from hil.simulation.peers.sensors.sampler import Bits, FifoSetting, Samples

__all__ = ["MODEL", "Inertial", "Magnetometer", "build"]

_CTRL1_G, _CTRL6_XL, _CTRL8 = 0x10, 0x20, 0x22
_TEMP, _OUT_G, _OUT_XL = 0x15, 0x18, 0x28
_STATUS = (0x17, 0x27)
_CTRL9, _FIFO_CTRL, _FIFO_SRC, _FIFO_EN = 0x23, 0x2E, 0x2F, 0x02
_LEVELS, _LEVEL, _WHEN_FULL_STOP, _CONTINUOUS = 32, 12, 1, 6
_RESET, _INCREMENT = 0x01, 0x04
_ACCEL_NEW, _GYRO_NEW, _TEMP_NEW = 1, 2, 4
_GYRO_RATES = (0.0, 14.9, 59.5, 119.0, 238.0, 476.0, 952.0, 0.0)
_GYRO_CUT_OFFS = (0.0, 5.0, 19.0, 38.0, 76.0, 100.0, 100.0, 0.0)
_ACCEL_RATES = (0.0, 10.0, 50.0, 119.0, 238.0, 476.0, 952.0, 0.0)
_ACCEL_CUT_OFFS = {119.0: 50.0, 238.0: 105.0, 476.0: 211.0}
_WIDEST = 408.0
_MDPS, _MG = (8.75, 17.5, 17.5, 70.0), (0.061, 0.732, 0.122, 0.244)
_GRAVITY = 9.80665
_IN_FIFO = (3, 4, 5, 0, 1, 2)  # rates before accelerations
_BUTTERWORTH = pi / 4 / sin(pi / 4)


class Inertial(InertialDie):
    """The die of gyroscope, accelerometer and thermometer.

    Args:
        fitted: where it is, and how it is fed.
        senses: what it senses.
    """

    sheet: ClassVar[Datasheet] = Datasheet(
        model="LSM9DS1",
        addresses=(0x6A, 0x6B),
        identity=(0x0F, 0x68),
        least_volts=1.9,
        boot_s=5e-3,
        reset={0x1E: 0x38, 0x1F: 0x38, _CTRL8: _INCREMENT},
        read_only=frozenset((0x0F, *range(0x14, 0x1E), *range(0x26, 0x2E), 0x2F)),
    )
    sleep: ClassVar[tuple[int, int, int]] = (_CTRL1_G, 0xE0, 0)
    bits: ClassVar[Bits] = Bits(1, 0, 0)
    heat: ClassVar[tuple[float, float]] = (16.0, 0.0)

    def __init__(self, fitted: Fitted, senses: Senses) -> None:
        super().__init__(fitted, senses, Fifo(_LEVELS * _LEVEL, _LEVEL))
        self._readers = {**dict.fromkeys(_STATUS, self._status), _FIFO_SRC: self._levels}
        for place, register in enumerate((*range(_OUT_XL, _OUT_XL + 6, 2), *range(_OUT_G, _OUT_G + 6, 2), _TEMP)):
            self._readers |= number_at(register, partial(self._output, place))

    def _step(self) -> None:
        if self._registers[_CTRL8] & _INCREMENT:
            super()._step()

    def _store(self, register: int, value: int) -> None:
        if register == _CTRL8 and value & _RESET:
            self._reset(0)
            return
        # One that fell asleep cannot be woken by either sensor.
        napping = register == _CTRL6_XL and self._faults.now(Asleep, self._clock.now_ns())
        self._registers[register] = 0 if napping else self._woken(register, value)
        if register == _FIFO_CTRL and not value >> 5:
            self._empty()
        self._configure()

    def _wanted(self) -> Setting:
        controls = self._registers[_CTRL1_G], self._registers[_CTRL6_XL]
        gyro, accel = (control >> 5 for control in controls)
        rate = _GYRO_RATES[gyro] or _ACCEL_RATES[accel]
        return Setting(
            gyro=bool(gyro),
            accel=bool(accel),
            rate=rate,
            gyro_bandwidth=_GYRO_CUT_OFFS[gyro] * _BUTTERWORTH,
            accel_bandwidth=_ACCEL_CUT_OFFS.get(rate, _WIDEST) * _BUTTERWORTH,
            more=controls,
        )

    def _counts_per_unit(self) -> tuple[float, float]:
        per_count = _MG[self._registers[_CTRL6_XL] >> 3 & 3], _MDPS[self._registers[_CTRL1_G] >> 3 & 3]
        return 1000.0 / per_count[0] / _GRAVITY, 1000.0 / per_count[1]

    def _packed(self, samples: Samples) -> bytes:
        return samples.outputs[:, _IN_FIFO].astype("<i2").tobytes()

    def _look(self) -> FifoSetting:
        mode = self._registers[_FIFO_CTRL] >> 5
        on = bool(self._registers[_CTRL9] & _FIFO_EN) and mode in {_WHEN_FULL_STOP, _CONTINUOUS}
        return FifoSetting(active=on, newest_go=mode == _WHEN_FULL_STOP, watermark=0, every=False, sources=0)

    def _levels(self) -> int:
        stored = self._fifo.packets
        reached = stored >= (self._registers[_FIFO_CTRL] & 0x1F)
        return reached << 7 | (self._fifo.lost != self._lost) << 6 | stored

    def _burst(self, register: int, count: int) -> bytes:
        """Take levels from the FIFO, where it is on."""
        if register != _OUT_G or not self._look().active or not self._registers[_CTRL8] & _INCREMENT:
            return b""
        data = self._sampler.take(count, resume=False)
        self._lost = self._fifo.lost
        return data

    def _sleeps_by(self, register: int, value: int) -> bool:
        return super()._sleeps_by(register, value) and not self._setting.accel  # else the accelerometer goes on

    def _output(self, place: int) -> int:
        self._sampler.status = 0
        return super()._output(place)

    def _status(self) -> int:
        fresh = _TEMP_NEW | (_GYRO_NEW if self._setting.gyro else 0) | (_ACCEL_NEW if self._setting.accel else 0)
        return fresh if self._sampler.status else 0


class Magnetometer(Lis3mdl):
    """The die of the magnetometer."""

    sheet: ClassVar[Datasheet] = Datasheet(
        model="LSM9DS1",
        addresses=(0x1C, 0x1E),
        identity=(0x0F, 0x3D),
        least_volts=1.9,
        boot_s=5e-3,
        reset={0x20: 0x10, 0x22: 0x03},
        read_only=Lis3mdl.sheet.read_only,
        increment=0x80,
        follows=Lis3mdl.sheet.follows,
        second=True,
    )
    lsb_per_gauss: ClassVar[tuple[float, ...]] = tuple(1000.0 / milli for milli in (0.14, 0.29, 0.43, 0.58))
    thermometer: ClassVar[bool] = False


def build(setup: PeerSetup) -> Package:
    """Build the chip; terminals `rate`, `acceleration`, `field`, `temperature` and `power` go to plant signals.

    The gyroscope's truth and the magnetometer's stand beside that of the chip, that of the accelerometer below
    `accelerometer`.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    senses = Senses.read(setup)
    inertial = Inertial(Fitted.read(setup, Inertial.sheet), senses)
    fitted, field_element = Fitted.read(setup, Magnetometer.sheet), FieldElement(setup, noise=(0.32, 0.32, 0.41))
    setup.finish()
    return Package(inertial, Magnetometer(fitted, field_element, senses.die))


MODEL = PeerModel(
    link="bus", fault_kinds=(Asleep, Drifting, OtherIdentity, Saturated, Stuck, TemperatureRaw), build=build
)
"""The model for the driver `lsm9ds1`."""
