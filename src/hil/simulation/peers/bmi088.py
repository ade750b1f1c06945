"""A BMI088 at register level: an accelerometer and a gyroscope, two dies with an address each.

From the vendor's driver (BMI08x_SensorAPI: registers, bits, ranges, rates, delays, the FIFO's frame counter) and from
memory of the data sheet (BST-BMI088-DS001: reset values, filters of the accelerometer, 1.28 s from one temperature to
the next).

Accelerometer, 18h or 19h: ACC_CHIP_ID 00h is 1Eh. After power-on it is suspended (ACC_PWR_CONF 7Ch is 03h, ACC_PWR_CTRL
7Dh is 00h), acceleration is 0 and the temperature 8000h, which stands for none; it measures with 7Ch = 00h and 7Dh =
04h. Acceleration at 12h, low byte first, is 3, 6, 12 or 24 g over 32768; the temperature at 22h, high byte first, has
11 bits at the upper end of two bytes, 1/8 K each from 23 degC.

Gyroscope, 68h or 69h: GYRO_CHIP_ID 00h is 0Fh. It runs after power-on, and rests with GYRO_LPM1 11h = 80h. Rates at
02h, low byte first, are 2000 deg/s, halved down to 125, over 32768. The FIFO holds 100 frames of six bytes; FIFO_STATUS
0Eh has their number in bits 6:0, and in bit 7 that one was lost, until FIFO_CONFIG_1 3Eh is written, which empties the
FIFO; 40h there stops when it is full, 80h forgets the oldest. A soft reset is B6h in 7Eh of the one, 14h of the other.

Assumed: the filters' noise bandwidths are those of Butterworth filters of second order; any change of rate, filter or
power starts the samples, and their noise, again; both dies have one supply and one temperature. Not modelled: the
accelerometer's FIFO, interrupt pins, self-test, the 450 us that a suspended accelerometer needs after each write.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import pi, sin
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from hil.clock.port import NANOSECONDS
from hil.model.notation import vector
from hil.simulation.faults import Drifting, Saturated, Stuck
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
from hil.simulation.peers.sensors.elements import AxesElement, RateTruth, limited
from hil.simulation.peers.sensors.fifo import Fifo
from hil.simulation.peers.sensors.grid import Grid
from hil.simulation.peers.sensors.inertial import Senses
from hil.simulation.peers.sensors.sampled import SampledPeer
from hil.simulation.peers.sensors.sampler import Bits, FifoSetting, Sampler, Samples
from hil.wire.checkpoint import Kept

__all__ = ["MODEL", "Accelerometer", "Gyroscope", "Rates", "build"]

_SOFT_RESET = 0xB6
_LEAST, _MOST = -32768, 32767
_BITS = Bits(new=0x80, watermark=0x10, full=0)
_BUTTERWORTH = pi / 4 / sin(pi / 4)

_ACC_X, _TEMP = 0x12, 0x22
_ACC_CONF, _ACC_RANGE, _ACC_PWR_CONF, _ACC_PWR_CTRL, _ACC_SOFTRESET = 0x40, 0x41, 0x7C, 0x7D, 0x7E
_ACC_ENABLED = 0x04
_ACC_RESET_NS = 1_000_000
_ACC_RATES = {code: 12.5 * 2 ** (code - 5) for code in range(5, 13)}
_ACC_CUT_OFFS = {5: 5.0, 6: 10.0, 7: 20.0, 8: 40.0, 9: 80.0, 10: 145.0, 11: 234.0, 12: 280.0}
_SLOWEST, _FASTEST = 5, 12
_GRAVITY = 9.80665
_NO_TEMPERATURE = -32768
_EIGHTHS_AT_25 = 16  # the register is 0 at 23 degC
_TEMPERATURE_NS = 1_280_000_000

_RATE_X, _FIFO_STATUS = 0x02, 0x0E
_GYRO_RANGE, _GYRO_BANDWIDTH, _GYRO_LPM1, _GYRO_SOFTRESET = 0x0F, 0x10, 0x11, 0x14
_FIFO_CONFIG_0, _FIFO_CONFIG_1, _FIFO_DATA = 0x3D, 0x3E, 0x3F
_ASLEEP, _ALWAYS_ONE = 0xA0, 0x80
_GYRO_RESET_NS = 30_000_000
_FRAME, _FRAMES, _OVERRUN = 6, 100, 0x80
_STREAM = 0x80
_GYRO_FILTERS = ((2000, 532), (2000, 230), (1000, 116), (400, 47), (200, 23), (100, 12), (200, 64), (100, 32))


class Accelerometer(SampledPeer):
    """The die of the accelerometer and the thermometer.

    Args:
        fitted: where it is, and how it is fed.
        senses: what it senses.
    """

    sheet: ClassVar[Datasheet] = Datasheet(
        model="BMI088",
        addresses=(0x18, 0x19),
        identity=(0x00, 0x1E),
        least_volts=2.4,
        boot_s=1e-3,
        reset={_ACC_CONF: 0xA8, _ACC_RANGE: 0x01, 0x45: 0x80, 0x46: 0x02, 0x48: 0x02, 0x49: 0x10, _ACC_PWR_CONF: 0x03},
        read_only=frozenset((*range(0x40), _ACC_SOFTRESET)),
    )
    sleep: ClassVar[tuple[int, int, int]] = (_ACC_PWR_CTRL, _ACC_ENABLED, 0)
    _start_ns: Kept[int]
    _asked: Kept[list[int]]
    _element: Kept[AxesElement]

    def __init__(self, fitted: Fitted, senses: Senses) -> None:
        super().__init__(fitted)
        self._element, self._die, self._odr = senses.accelerometer, senses.die, senses.odr
        asleep = [_NO_TEMPERATURE, 0, 0, 0]
        self._sampler = Sampler(bits=_BITS, asleep=asleep, make=self._samples, faults=fitted.faults)
        self._start_ns, self._asked = 0, []
        self._readers = {0x03: self._status, **number_at(_TEMP, self._temperature, big=lambda: True)}
        for axis in range(3):
            self._readers |= number_at(_ACC_X + 2 * axis, partial(self._axis, axis))

    def _was_reset(self) -> None:
        self._asked = []
        self._element.stop()
        self._sampler.reset(0)

    def _store(self, register: int, value: int) -> None:
        if register == _ACC_SOFTRESET:
            if value == _SOFT_RESET:
                self._reset(_ACC_RESET_NS)
            return
        self._registers[register] = self._woken(register, value)
        registers = self._registers
        on = registers[_ACC_PWR_CTRL] & _ACC_ENABLED and not registers[_ACC_PWR_CONF]
        wanted = [registers[_ACC_CONF], registers[_ACC_RANGE]] if on else []
        if wanted != self._asked:
            self._asked, self._start_ns = wanted, self._clock.now_ns()
            self._begin()

    def _begin(self) -> None:
        if not self._asked:
            self._element.stop()
            self._sampler.restart(None)
            return
        code = min(max(self._asked[0] & 0x0F, _SLOWEST), _FASTEST)
        wider = {8: 4, 9: 2}.get(self._asked[0] >> 4, 1)  # filters for four and two times the samples
        rate = _ACC_RATES[code] * self._odr
        self._element.begin(self._start_ns, rate=rate, bandwidth=_ACC_CUT_OFFS[code] / wider * _BUTTERWORTH)
        self._sampler.restart(Grid(self._start_ns, NANOSECONDS / rate))

    def _samples(self, first: int, ends_ns: NDArray[np.int64]) -> Samples:
        degrees = self._die.many(ends_ns)
        outputs = np.empty((ends_ns.size, 4), dtype=np.int16)
        outputs[:, 0] = self._temperatures(ends_ns)
        per_unit = 32768 / (3 << (self._asked[1] & 3)) / _GRAVITY
        outputs[:, 1:] = limited(self._element.measured(first, ends_ns, degrees) * per_unit, _LEAST, _MOST).T
        return Samples(ends_ns, outputs, np.zeros(ends_ns.size, dtype=np.int8))

    def _temperatures(self, ends_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        felt_ns = self._start_ns + (ends_ns - self._start_ns) // _TEMPERATURE_NS * _TEMPERATURE_NS
        eighths = np.rint(self._die.counts(self._die.many(felt_ns), 8.0) + _EIGHTHS_AT_25)
        return limited(self._as_raw(eighths * 32, ends_ns), _LEAST, _MOST)

    def _temperature(self) -> int:
        """Return the temperature; alone it does not have the axes made, which the gyroscope's die leaves unread."""
        alone = self._temperature_alone(self._temperatures)
        return self._sampler.newest[0] if alone is None else alone

    def _axis(self, axis: int) -> int:
        self._sampler.status = 0
        return self._sampler.newest[1 + axis]

    def _status(self) -> int:
        return self._sampler.status


class Gyroscope(SampledPeer):
    """The die of the gyroscope.

    Args:
        fitted: where it is, and how it is fed.
        senses: what it senses; its temperature it does not measure.
    """

    sheet: ClassVar[Datasheet] = Datasheet(
        model="BMI088",
        addresses=(0x68, 0x69),
        identity=(0x00, 0x0F),
        least_volts=2.4,
        boot_s=1e-3,
        reset={_GYRO_BANDWIDTH: 0x80, 0x16: 0x0F, 0x1E: 0x08},
        read_only=frozenset((*range(0x0F), _GYRO_SOFTRESET, _FIFO_DATA)),
        second=True,
    )
    sleep: ClassVar[tuple[int, int, int]] = (_GYRO_LPM1, _ASLEEP, 0x80)
    _start_ns: Kept[int]
    _asked: Kept[list[int]]
    _element: Kept[AxesElement]
    _fifo: Kept[Fifo]

    def __init__(self, fitted: Fitted, senses: Senses) -> None:
        super().__init__(fitted)
        self._element, self._die, self._odr = senses.gyroscope, senses.die, senses.odr
        self._fifo = Fifo(_FRAME * _FRAMES, _FRAME)
        self._sampler = Sampler(
            bits=_BITS,
            asleep=[0, 0, 0],
            make=self._samples,
            faults=fitted.faults,
            pack=lambda samples: samples.outputs.astype("<i2").tobytes(),
            look=self._look,
            fifo=self._fifo,
        )
        self._start_ns, self._asked = 0, []
        self._readers = {0x0A: self._sampler.take_status, _FIFO_STATUS: self._frames}
        for axis in range(3):
            self._readers |= number_at(_RATE_X + 2 * axis, partial(self._axis, axis))

    def _was_reset(self) -> None:
        self._asked = []
        self._fifo.flush(_FRAME)
        self._sampler.reset(0)
        self._configure()

    def _store(self, register: int, value: int) -> None:
        if register == _GYRO_SOFTRESET:
            if value == _SOFT_RESET:
                self._reset(_GYRO_RESET_NS)
            return
        self._registers[register] = self._woken(register, value) | (_ALWAYS_ONE if register == _GYRO_BANDWIDTH else 0)
        if register == _FIFO_CONFIG_1:
            self._sampler.flush(_FRAME)
        self._configure()

    def _configure(self) -> None:
        registers = self._registers
        on = not registers[_GYRO_LPM1] & _ASLEEP
        wanted = [registers[_GYRO_BANDWIDTH] & 7, registers[_GYRO_RANGE] & 7] if on else []
        if wanted != self._asked:
            self._asked, self._start_ns = wanted, self._clock.now_ns()
            self._begin()
        self._sampler.reschedule()

    def _begin(self) -> None:
        if not self._asked:
            self._element.stop()
            self._sampler.restart(None)
            return
        rate, cut_off = _GYRO_FILTERS[self._asked[0]]
        self._element.begin(self._start_ns, rate=rate * self._odr, bandwidth=cut_off * _BUTTERWORTH)
        self._sampler.restart(Grid(self._start_ns, NANOSECONDS / (rate * self._odr)))

    def _look(self) -> FifoSetting:
        mode = self._registers[_FIFO_CONFIG_1] & 0xC0
        return FifoSetting(active=mode != 0, newest_go=mode != _STREAM, watermark=0, every=False, sources=0)

    def _samples(self, first: int, ends_ns: NDArray[np.int64]) -> Samples:
        per_unit = 32768 / (2000 / (1 << min(self._asked[1], 4)))
        measured = self._element.measured(first, ends_ns, self._die.many(ends_ns)) * per_unit
        outputs = limited(measured, _LEAST, _MOST).T.astype(np.int16)
        return Samples(ends_ns, outputs, np.zeros(ends_ns.size, dtype=np.int8))

    def _axis(self, axis: int) -> int:
        return self._sampler.newest[axis]

    def _frames(self) -> int:
        return self._fifo.packets | (_OVERRUN if self._fifo.lost else 0)

    def _burst(self, register: int, count: int) -> bytes:
        """Take from the FIFO: a transfer stays at its data."""
        return self._sampler.take(count, resume=True) if register == _FIFO_DATA else b""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rates(RateTruth):
    """What the gyroscope's elements are; the white noise is that of the data sheet, 14 mdeg/s/sqrt(Hz) one-sided."""

    white: Annotated[tuple[float, float, float], vector(3, minimum=0)] = (9.9e-3,) * 3


def build(setup: PeerSetup) -> Package:
    """Build the chip; terminals `rate` (deg/s), `acceleration` (m/s2), `temperature` and `power` go to plant signals.

    The gyroscope's truth stands beside that of the chip, that of the accelerometer below `accelerometer`.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    senses = Senses.read(setup, setup.truth.part(Rates))
    accelerometer = Accelerometer(Fitted.read(setup, Accelerometer.sheet), senses)
    gyroscope = Gyroscope(Fitted.read(setup, Gyroscope.sheet), senses)
    setup.finish()
    return Package(accelerometer, gyroscope)


MODEL = PeerModel(
    link="bus", fault_kinds=(Asleep, Drifting, OtherIdentity, Saturated, Stuck, TemperatureRaw), build=build
)
"""The model for the driver `bmi088`."""
