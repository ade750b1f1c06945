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

from dataclasses import dataclass, field
from functools import partial
from math import pi, sin
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from hil.clock.port import NANOSECONDS
from hil.model.notation import number
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
from hil.simulation.peers.sensors.elements import AccelerationTruth, AxesElement, Die, FieldElement, limited
from hil.simulation.peers.sensors.fifo import Fifo
from hil.simulation.peers.sensors.grid import Grid
from hil.simulation.peers.sensors.sampled import SampledPeer
from hil.simulation.peers.sensors.sampler import Bits, FifoSetting, Sampler, Samples
from hil.wire.checkpoint import Kept

__all__ = ["MODEL", "Inertial", "Lsm9ds1Truth", "Magnetometer", "build"]

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
_LEAST, _MOST = -32768, 32767
_BUTTERWORTH = pi / 4 / sin(pi / 4)


class Inertial(SampledPeer):
    """The die of gyroscope, accelerometer and thermometer.

    Args:
        fitted: where it is, and how it is fed.
        rates, accelerations: its axes [deg/s, m/s2].
        die: its temperature.
        odr_error: relative error of its oscillator.
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
    _start_ns: Kept[int]
    _asked: Kept[list[int]]
    _rates: Kept[AxesElement]
    _accelerations: Kept[AxesElement]
    _fifo: Kept[Fifo]
    _lost: Kept[int]

    def __init__(
        self, fitted: Fitted, rates: AxesElement, accelerations: AxesElement, die: Die, odr_error: float
    ) -> None:
        super().__init__(fitted)
        self._rates, self._accelerations, self._die, self._odr = rates, accelerations, die, 1 + odr_error
        self._fifo, self._lost = Fifo(_LEVELS * _LEVEL, _LEVEL), 0
        self._sampler = Sampler(
            bits=Bits(1, 0, 0),
            asleep=[0] * 7,
            make=self._samples,
            faults=fitted.faults,
            pack=lambda samples: samples.outputs[:, 1:].astype("<i2").tobytes(),
            look=self._look,
            fifo=self._fifo,
        )
        self._start_ns, self._asked = 0, [0, 0]
        self._readers = {**dict.fromkeys(_STATUS, self._status), _FIFO_SRC: self._levels}
        for place, register in enumerate((_TEMP, *range(_OUT_G, _OUT_G + 6, 2), *range(_OUT_XL, _OUT_XL + 6, 2))):
            self._readers |= number_at(register, partial(self._output, place))

    def _was_reset(self) -> None:
        self._asked = [0, 0]
        self._rates.stop()
        self._accelerations.stop()
        self._empty()
        self._sampler.reset(0)

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
        wanted = [self._registers[_CTRL1_G], self._registers[_CTRL6_XL]]
        if wanted != self._asked:
            self._asked, self._start_ns = wanted, self._clock.now_ns()
            self._begin()
        if register == _FIFO_CTRL and not value >> 5:
            self._empty()
        self._sampler.reschedule()

    def _empty(self) -> None:
        self._lost = 0
        self._sampler.flush(_LEVEL)

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
        data = self._fifo.take(count, resume=False)
        self._lost = self._fifo.lost
        self._sampler.reschedule()
        return data

    def _sleeps_by(self, register: int, value: int) -> bool:
        return super()._sleeps_by(register, value) and not self._asked[1]  # else the accelerometer goes on

    def _begin(self) -> None:
        gyro, accel = (control >> 5 for control in self._asked)
        rate = (_GYRO_RATES[gyro] or _ACCEL_RATES[accel]) * self._odr
        turning, pulled = _GYRO_CUT_OFFS[gyro], _ACCEL_CUT_OFFS.get(rate / self._odr, _WIDEST)
        for element, on, cut_off in ((self._rates, gyro, turning), (self._accelerations, accel, pulled)):
            if on and rate:
                element.begin(self._start_ns, rate=rate, bandwidth=cut_off * _BUTTERWORTH)
            else:
                element.stop()
        self._sampler.restart(Grid(self._start_ns, NANOSECONDS / rate) if rate else None)

    def _samples(self, first: int, ends_ns: NDArray[np.int64]) -> Samples:
        degrees = self._die.many(ends_ns)
        outputs = np.zeros((ends_ns.size, 7), dtype=np.int16)
        outputs[:, 0] = self._temperatures(ends_ns)
        gyro, accel = self._asked
        for element, control, milli, at, unit in (
            (self._rates, gyro, _MDPS, 1, 1.0),
            (self._accelerations, accel, _MG, 4, _GRAVITY),
        ):
            if control >> 5:
                measured = element.measured(first, ends_ns, degrees) * (1000.0 / milli[control >> 3 & 3] / unit)
                outputs[:, at : at + 3] = limited(measured, _LEAST, _MOST).T
        return Samples(ends_ns, outputs, np.zeros(ends_ns.size, dtype=np.int8))

    def _temperatures(self, ends_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        return limited(self._as_raw(self._die.counts(self._die.many(ends_ns), 16.0), ends_ns), _LEAST, _MOST)

    def _output(self, place: int) -> int:
        self._sampler.status = 0
        alone = self._temperature_alone(self._temperatures) if not place else None
        return self._sampler.newest[place] if alone is None else alone

    def _status(self) -> int:
        gyro, accel = (control >> 5 for control in self._asked)
        fresh = _TEMP_NEW | (_GYRO_NEW if gyro else 0) | (_ACCEL_NEW if accel else 0)
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Lsm9ds1Truth:
    """One device: its accelerometer, and the relative error of its sample rates."""

    accelerometer: AccelerationTruth = field(default_factory=AccelerationTruth)
    odr_error: Annotated[float, number(-0.1, 0.1)] = 0.0


def build(setup: PeerSetup) -> Package:
    """Build the chip; terminals `rate`, `acceleration`, `field`, `temperature` and `power` go to plant signals.

    The gyroscope's truth and the magnetometer's stand beside that of the chip, that of the accelerometer below
    `accelerometer`.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    own, die = setup.truth.part(Lsm9ds1Truth), Die(setup, most=85)
    accelerations = AxesElement(setup, "acceleration", own.accelerometer, own.accelerometer.acceleration)
    inertial = Inertial(Fitted.read(setup, Inertial.sheet), AxesElement(setup), accelerations, die, own.odr_error)
    fitted, field_element = Fitted.read(setup, Magnetometer.sheet), FieldElement(setup, noise=(0.32, 0.32, 0.41))
    setup.finish()
    return Package(inertial, Magnetometer(fitted, field_element, die))


MODEL = PeerModel(
    link="bus", fault_kinds=(Asleep, Drifting, OtherIdentity, Saturated, Stuck, TemperatureRaw), build=build
)
"""The model for the driver `lsm9ds1`."""
