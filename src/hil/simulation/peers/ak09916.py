"""An AK09916 magnetometer at register level, as it sits in an ICM-20948.

AKM AK09916 data sheet, as the PX4 and SparkFun drivers have it: WIA1 00h is 48h, WIA2 01h is 09h; a transfer continues
from 03h at 10h, from 18h at 00h and from 32h at 30h. CNTL2 31h selects power-down or 10, 20, 50 or 100 Hz; CNTL3 32h
resets. 0.15 uT/LSB, low byte first. ST1 10h has DRDY, and DOR where a measurement was never read. Once data are read,
they stay until ST2 18h is read; its HOFL says that the three magnitudes together are 4912 uT or more.
Assumed, from memory: readings stop at 32752 LSB; the noise, which no data sheet tells, is white and 0.3 uT rms.
Not modelled: single measurements, self-test, the chip's own temperature.
"""

from __future__ import annotations

import struct
from functools import partial
from typing import ClassVar

from hil.clock.port import NANOSECONDS
from hil.simulation.faults import Stuck
from hil.simulation.peers.sensors.chip import Datasheet, Fitted, SensorPeer, number_at
from hil.simulation.peers.sensors.elements import AXES, FieldElement
from hil.simulation.peers.sensors.grid import Grid
from hil.wire.checkpoint import Kept

__all__ = ["Ak09916"]

_ST1, _HXL, _ST2, _CNTL2, _CNTL3 = 0x10, 0x11, 0x18, 0x31, 0x32
_RATES = {0x02: 10.0, 0x04: 20.0, 0x06: 50.0, 0x08: 100.0}
_WHOLE = 9
_MODE, _SOFT_RESET = 0x1F, 0x01
_READY, _OVERRUN, _OVERFLOW = 0x01, 0x02, 0x08
_MICROTESLA_PER_LSB, _MOST, _OVERFLOW_MICROTESLA = 0.15, 32752, 4912.0


class Ak09916(SensorPeer):
    """The magnetometer on its bus: measurements on their own grid, made when somebody reads them.

    Args:
        fitted: how it is fed, and what goes wrong with it.
        element: what it senses.
    """

    sheet: ClassVar[Datasheet] = Datasheet(
        model="AK09916",
        addresses=(0x0C,),
        identity=(0x01, 0x09),
        least_volts=1.71,
        boot_s=1e-3,
        reset={0x00: 0x48},
        read_only=frozenset(range(0x80)) - {_CNTL2, _CNTL3},
        follows={0x03: 0x10, 0x18: 0x00, 0x32: 0x30},
        second=True,
    )
    _start_ns: Kept[int]
    _ended: Kept[int]
    _flags: Kept[int]
    _reading: Kept[bool]
    _counts: Kept[list[int]]
    _overflow: Kept[int]

    def __init__(self, fitted: Fitted, element: FieldElement) -> None:
        super().__init__(fitted)
        self._element = element
        self._begin(0)
        self._readers = {_ST1: lambda: self._flags, _ST2: self._end_of_data}
        for axis in range(len(AXES)):
            self._readers |= number_at(_HXL + 2 * axis, partial(self._data, axis))

    def _was_reset(self) -> None:
        self._begin(0)

    def _begin(self, start_ns: int) -> None:
        """Count measurements afresh; none has ended."""
        self._start_ns = start_ns
        self._ended = self._flags = self._overflow = 0
        self._reading = False
        self._counts = [0] * len(AXES)

    def _store(self, register: int, value: int) -> None:
        if register == _CNTL3 and value & _SOFT_RESET:
            self._reset(0)
        elif register == _CNTL2:
            self._registers[_CNTL2] = value & _MODE
            self._begin(self._clock.now_ns())

    def _settle(self) -> None:
        """Take over the newest measurement, unless the last one is being read."""
        rate = _RATES.get(self._registers[_CNTL2])
        if rate is None:
            return
        grid = Grid(self._start_ns, NANOSECONDS / rate)
        before, self._ended = self._ended, grid.count(self._clock.now_ns())
        if self._ended == before:
            return
        if before and (self._reading or self._flags & _READY or self._ended > before + 1):
            self._flags |= _OVERRUN
        if not self._reading:
            self._flags |= _READY
            self._measure(self._ended, grid.end_ns(self._ended))

    def _measure(self, number: int, at_ns: int) -> None:
        if any(self._counts) and self._faults.now(Stuck, at_ns):
            return
        field = self._element.measured(number, at_ns, start_ns=self._start_ns)
        self._overflow = _OVERFLOW if sum(map(abs, field)) >= _OVERFLOW_MICROTESLA else 0
        self._counts = [max(-_MOST, min(_MOST, round(each / _MICROTESLA_PER_LSB))) for each in field]

    def _burst(self, register: int, count: int) -> bytes:
        """Give a whole measurement with its flags at once, as byte by byte."""
        if register != _ST1 or count < _WHOLE:
            return b""
        flags = self._flags
        data = struct.pack("<BhhhBB", flags, *self._counts, 0, self._end_of_data())
        self._pointer = 0
        return data

    def _data(self, axis: int) -> int:
        self._reading, self._flags = True, self._flags & ~_READY
        return self._counts[axis]

    def _end_of_data(self) -> int:
        self._reading, self._flags = False, 0
        return self._overflow
