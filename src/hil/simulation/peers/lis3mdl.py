"""An LIS3MDL magnetometer at register level, as its datasheet describes it.

DocID024204: WHO_AM_I 0Fh is 3Dh; after power-on CTRL_REG1..5 are 10h, 00h, 03h (power-down), 00h, 00h. Bit 7 of the
register address asks for auto-increment, and a burst goes from 2Dh back to 28h. Sensitivity is 6842, 3421, 2281, 1711
LSB/gauss. The temperature has 8 LSB/degC and is 0 at 25 degC (AN4602). Assumed: any change of rate, range or mode
starts the conversions again; noise falls with the root of the conversion time of the performance mode; readings stop
at the ends of 16 bits.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace
from functools import partial
from math import sqrt
from typing import ClassVar, Self

from hil.clock.port import NANOSECONDS
from hil.simulation.faults import Drifting, Saturated, Stuck
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.sensors.chip import (
    Asleep,
    Datasheet,
    Fitted,
    OtherIdentity,
    SensorPeer,
    TemperatureRaw,
    number_at,
)
from hil.simulation.peers.sensors.elements import AXES, Die, FieldElement
from hil.simulation.peers.sensors.grid import Grid
from hil.simulation.peers.sensors.registers import RegisterFile
from hil.simulation.peers.timing import Alarm, Alarms
from hil.wire.checkpoint import Kept

__all__ = ["MODEL", "Lis3mdl", "build"]

_OFFSETS = range(0x05, 0x0B)
_CTRL1, _CTRL2, _CTRL3, _CTRL4, _CTRL5 = range(0x20, 0x25)
_STATUS = 0x27
_DATA = range(0x28, 0x2E)
_TEMPERATURE = 0x2E
_WRITABLE = frozenset((*_OFFSETS, *range(_CTRL1, _CTRL5 + 1), 0x30, 0x32, 0x33))
_REBOOT, _SOFT_RESET = 0x08, 0x04
_BLOCK_DATA_UPDATE = 0x40
_ALL_AXES = 0x08
_SLOW_RATES = (0.625, 1.25, 2.5, 5.0, 10.0, 20.0, 40.0, 80.0)
_FAST_RATES = (1000.0, 560.0, 300.0, 155.0)  # Hz, by performance mode of x and y
_LSB_PER_GAUSS = (6842.0, 3421.0, 2281.0, 1711.0)
_MICROTESLA_PER_GAUSS = 100.0
_LSB_PER_KELVIN = 8
_POWER_DOWN, _SINGLE, _CONTINUOUS = 3, 1, 0
_MOST, _LEAST = 32767, -32768


@dataclass(frozen=True, slots=True)
class _Conversion:
    """What the control registers ask for, and when conversions began; a single one ends after the first sample."""

    mode: int = _POWER_DOWN
    period_ns: int = 0
    lsb_per_gauss: float = _LSB_PER_GAUSS[0]
    performance: int = 0
    performance_z: int = 0
    warm: int = 0
    start_ns: int = 0

    @classmethod
    def read(cls, registers: RegisterFile, lsb_per_gauss: tuple[float, ...]) -> Self:
        """Read the control registers of a chip with these sensitivities; all reserved modes are power-down."""
        ctrl1, mode = registers[_CTRL1], registers[_CTRL3] & 3
        performance = ctrl1 >> 5 & 3
        rate = _FAST_RATES[performance] if ctrl1 & 0x02 else _SLOW_RATES[ctrl1 >> 2 & 7]
        return cls(
            mode=mode if mode in {_CONTINUOUS, _SINGLE} else _POWER_DOWN,
            period_ns=round(NANOSECONDS / rate),
            lsb_per_gauss=lsb_per_gauss[registers[_CTRL2] >> 5 & 3],
            performance=performance,
            performance_z=registers[_CTRL4] >> 2 & 3,
            warm=ctrl1 >> 7,
        )

    @property
    def single(self) -> bool:
        """Whether it stops after one sample."""
        return self.mode == _SINGLE

    @property
    def grid(self) -> Grid:
        """When samples end."""
        return Grid(self.start_ns, self.period_ns)

    def count(self, now_ns: int) -> int:
        """Return how many samples have ended."""
        if self.mode == _POWER_DOWN:
            return 0
        ended = self.grid.count(now_ns)
        return min(ended, 1) if self.single else ended


class Lis3mdl(SensorPeer):
    """The sensor on its bus: conversions on their own grid, made when somebody reads them.

    Attributes:
        lsb_per_gauss: counts per gauss, by the code of the range.
        thermometer: whether it has one.

    Args:
        fitted: where it is, and how it is fed.
        element: what it senses.
        die: its temperature.
    """

    sheet: ClassVar[Datasheet] = Datasheet(
        model="LIS3MDL",
        addresses=(0x1C, 0x1E),
        identity=(0x0F, 0x3D),
        least_volts=1.9,
        boot_s=1e-2,
        reset={_CTRL1: 0x10, _CTRL3: 0x03, 0x30: 0xE8},
        read_only=frozenset(range(0x80)) - _WRITABLE,
        increment=0x80,
        follows={_DATA.stop - 1: _DATA.start},
    )
    lsb_per_gauss: ClassVar[tuple[float, ...]] = _LSB_PER_GAUSS
    thermometer: ClassVar[bool] = True
    _conversion: Kept[_Conversion]
    _held: Kept[list[int]]
    _frozen: Kept[list[int] | None]
    _read: Kept[list[int]]
    _latched: Kept[dict[int, list[int]]]
    _single: Kept[Alarm]
    _changes: Kept[Alarms]

    def __init__(self, fitted: Fitted, element: FieldElement, die: Die) -> None:
        super().__init__(fitted)
        self._element = element
        self._die = die
        self._conversion = _Conversion()
        self._made: tuple[_Conversion, int, list[int]] | None = None
        self._held = [0] * 4  # x, y, z, temperature
        self._frozen = None
        self._read = [0, 0, 0]
        self._latched = {}
        self._readers = {
            _STATUS: self._status,
            **{register: partial(self._data, register - _DATA.start) for register in _DATA},
            **number_at(_TEMPERATURE, lambda: self._newest()[3]),
            _CTRL3: self._mode,
        }

    def _connected(self) -> None:
        self._single = Alarm(self._clock, self._take_single)
        stuck = self._faults.of(Stuck)
        changes = [((fault.start_ns, self._freeze), (fault.end_ns, self._thaw)) for fault in stuck]
        naps = [(fault.start_ns, self._fall_asleep) for fault in self._faults.of(Asleep)]
        self._changes = Alarms(self._clock, [*(change for pair in changes for change in pair), *naps])

    def _was_reset(self) -> None:
        self._conversion, self._held = _Conversion(), [0] * 4
        self._forget()

    def _fall_asleep(self) -> None:
        if self._ready_ns is not None:
            self._reset(0)

    def _forget(self) -> None:
        """Nothing was read of these conversions yet."""
        self._read, self._latched = [0, 0, 0], {}

    def _store(self, register: int, value: int) -> None:
        if register == _CTRL2 and value & _SOFT_RESET:
            self._reset(0)
        elif register == _CTRL2 and value & _REBOOT:
            # Reboot loads the trimming values again; registers and conversions stay.
            self._registers[register] = value & ~_REBOOT
        elif register in _WRITABLE:
            asleep = register == _CTRL3 and self._faults.now(Asleep, self._clock.now_ns())
            self._registers[register] = value | _POWER_DOWN if asleep else value
            self._configure(again=register == _CTRL3)

    def _configure(self, *, again: bool) -> None:
        wanted = _Conversion.read(self._registers, self.lsb_per_gauss)
        if wanted != replace(self._conversion, start_ns=0) or (again and wanted.single):
            self._held = self._newest()
            self._conversion = replace(wanted, start_ns=self._clock.now_ns())
            self._forget()
            if wanted.single:
                self._single.set(self._conversion.grid.end_ns(1))

    def _take_single(self) -> None:
        # After a reset, or in continuous mode by now, nothing is awaited any more.
        if self._conversion.single:
            self._held = self._outputs(1)

    def _mode(self) -> int:
        done = self._conversion.single and self._count()
        return self._registers[_CTRL3] | (0x03 if done else 0)

    def _burst(self, register: int, count: int) -> bytes:
        """Give all three axes at once, as byte by byte; after them the transfer starts over with the first."""
        whole = register == _DATA.start and count >= len(_DATA) and self._pointer & self.sheet.increment
        if not whole or self._latched:
            return b""
        self._read = [self._count()] * len(AXES)
        newest = self._newest()
        return struct.pack("<hhh", *(self._less_offset(axis, newest[axis]) for axis in range(len(AXES))))

    def _data(self, place: int) -> int:
        """Return one byte of an axis; with block data update an axis keeps still until both were read."""
        axis, high = divmod(place, 2)
        value, count, halves = self._latched.pop(axis, None) or (self._reading(axis), self._count(), 0)
        halves |= 1 << high
        if halves != 0b11 and self._registers[_CTRL5] & _BLOCK_DATA_UPDATE:
            self._latched[axis] = [value, count, halves]
        if high:
            self._read[axis] = count
        return value >> 8 * high & 0xFF

    def _reading(self, axis: int) -> int:
        """Return an axis less its offset registers."""
        return self._less_offset(axis, self._newest()[axis])

    def _less_offset(self, axis: int, counts: int) -> int:
        low = _OFFSETS.start + 2 * axis
        offset = self._registers[low] | self._registers[low + 1] << 8
        return max(_LEAST, min(_MOST, counts - (offset - 0x10000 if offset & 0x8000 else offset)))

    def _count(self) -> int:
        return self._conversion.count(self._clock.now_ns())

    def _status(self) -> int:
        """Return data available (low half) and overrun (high half) per axis, and for all three."""
        count = self._count()
        fresh = sum(1 << axis for axis in range(len(AXES)) if count > self._read[axis])
        lost = sum(1 << axis for axis in range(len(AXES)) if count > self._read[axis] + 1)
        status = fresh | (_ALL_AXES if fresh == _ALL_AXES - 1 else 0)
        return status | (lost | (_ALL_AXES if lost else 0)) << 4

    def _newest(self) -> list[int]:
        """Return what the output registers show: x, y, z, temperature."""
        if self._frozen is not None:
            return self._frozen
        count = self._count()
        # A single conversion was taken over when it ended; nobody knows how late it is read.
        return self._outputs(count) if count and not self._conversion.single else self._held

    def _outputs(self, number: int) -> list[int]:
        """Return the output registers after sample `number`, counted from 1."""
        conversion = self._conversion
        if self._made is None or self._made[:2] != (conversion, number):
            at_ns = conversion.grid.end_ns(number)
            warm = self._warm(at_ns) if conversion.warm and self.thermometer else 0
            self._made = conversion, number, [*self._axes(number, at_ns), warm]
        return self._made[2]

    def _warm(self, at_ns: int) -> int:
        raw = self._faults.now(TemperatureRaw, at_ns)
        return raw.counts if raw else _clipped(self._die.counts_at(at_ns, _LSB_PER_KELVIN))

    def _axes(self, number: int, at_ns: int) -> list[int]:
        conversion = self._conversion
        across, along = (
            sqrt(_FAST_RATES[each] / _FAST_RATES[-1]) for each in (conversion.performance, conversion.performance_z)
        )
        fields = self._element.measured(number, at_ns, start_ns=conversion.start_ns, louder=(across, across, along))
        return [_clipped(field / _MICROTESLA_PER_GAUSS * conversion.lsb_per_gauss) for field in fields]

    def _freeze(self) -> None:
        self._frozen = self._newest()

    def _thaw(self) -> None:
        self._frozen = None


def _clipped(value: float) -> int:
    return max(_LEAST, min(_MOST, round(value)))


def build(setup: PeerSetup) -> Lis3mdl:
    """Build the sensor; terminals `field` (three axes, uT), `temperature` (degC) and `power` (V) go to plant signals.

    The noise of the datasheet (3.2 and 4.1 mgauss) is what the truth does not say.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    fitted = Fitted.read(setup, Lis3mdl.sheet)
    element, die = FieldElement(setup, noise=(0.32, 0.32, 0.41)), Die(setup, most=125)
    setup.finish()
    return Lis3mdl(fitted, element, die)


MODEL = PeerModel(
    link="bus", fault_kinds=(Asleep, Drifting, OtherIdentity, Saturated, Stuck, TemperatureRaw), build=build
)
"""The model for the driver `lis3mdl`."""
