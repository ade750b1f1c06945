"""A BNO055 gyroscope, accelerometer and magnetometer at register level, in its modes without fusion.

Bosch BST-BNO055-DS000-14: CHIP_ID 00h is A0h, followed by FBh, 32h and 0Fh of the three sensors in it; PAGE_ID 07h, in
both pages, selects one. After power-on it acknowledges nothing for 650 ms and is in CONFIGMODE, in which all data are
0; from there to another mode OPR_MODE 3Dh takes 7 ms, and 19 ms back. All other settings can be written in CONFIGMODE
only: UNIT_SEL 3Bh, PWR_MODE 3Eh, and in page 1 ACC_Config 08h, MAG_Config 09h and GYR_Config_0 0Ah, which are 0Dh, 6Dh
and 38h (4 g; 2000 deg/s and 32 Hz). Numbers have the low byte first and their scale whatever the range is:
16 LSB/(deg/s) or 900 LSB/(rad/s), 100 LSB/(m/s^2) or 1 LSB/mg, 16 LSB/uT; the temperature has 8 bits, 1 LSB/degC or
2 degF/LSB.

From memory: rates of the magnetometer, bandwidths of the gyroscope, SYS_STATUS, ranges of 1300 and 2500 uT; UNIT_SEL is
80h after power-on. Assumed: a mode that is asked for counts, and is read, once its time is over, and nothing that is
written before then does; the gyroscope's and accelerometer's data are new 100 times a second; readings stop at the
ends of the range; the magnetometer's noise is white, 0.5 uT rms; TEMP_SOURCE does nothing. Not modelled: fusion (its
modes only switch sensors on), calibration, axis remapping, interrupts, low power.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from math import pi, sqrt
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from hil.analysis.noise.numbers import RandomStream
from hil.clock.port import NANOSECONDS
from hil.model.notation import vector
from hil.simulation.faults import Drifting, LinkFault, Saturated, Share, Stuck
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
from hil.simulation.peers.sensors.elements import (
    AXES,
    AccelerationTruth,
    AxesElement,
    Die,
    FieldElement,
    RateTruth,
    limited,
)
from hil.simulation.peers.sensors.grid import Grid
from hil.simulation.peers.timing import Alarms
from hil.wire.checkpoint import Kept

__all__ = ["MODEL", "Bno055", "build"]

_PAGE, _ACC_DATA, _MAG_DATA, _GYR_DATA, _TEMP = 0x07, 0x08, 0x0E, 0x14, 0x34
_SYS_STATUS, _UNIT_SEL, _OPR_MODE, _PWR_MODE, _SYS_TRIGGER = 0x39, 0x3B, 0x3D, 0x3E, 0x3F
_ACC_CONFIG, _MAG_CONFIG, _GYR_CONFIG = 0x108, 0x109, 0x10A
_WRITABLE = frozenset((*range(0x3B, 0x43), *range(0x55, 0x6B), *range(0x108, 0x10E), *range(0x10F, 0x120)))
_ALWAYS_WRITABLE = frozenset((_SYS_TRIGGER, 0x10F, 0x110))
_RESET, _MODE, _SUSPEND = 0x20, 0x0F, 2
_IDLE, _NO_FUSION, _FUSION, _FIRST_FUSION = 0, 6, 5, 8
_MG, _RADIANS, _FAHRENHEIT = 0x01, 0x02, 0x10
_SENSORS = ("", "a", "m", "g", "am", "ag", "mg", "amg", "ag", "am", "am", "amg", "amg")
"""Which sensors are on, by mode."""
_TO_CONFIG_NS, _FROM_CONFIG_NS = 19_000_000, 7_000_000
_RATE = 100.0
_GYRO_BANDWIDTHS = (523.0, 230.0, 116.0, 47.0, 23.0, 12.0, 64.0, 32.0)
_ACCEL_BANDWIDTHS = (7.81, 15.63, 31.25, 62.5, 125.0, 250.0, 500.0, 1000.0)
_GYRO_RANGES, _ACCEL_RANGES = (2000.0, 1000.0, 500.0, 250.0, 125.0), (2.0, 4.0, 8.0, 16.0)
_MAG_RATES = (2.0, 6.0, 8.0, 10.0, 15.0, 20.0, 25.0, 30.0)
_MAG_RANGES = (1300.0, 1300.0, 2500.0)
_GRAVITY, _MOST = 9.80665, 32767
_DATA = {"a": _ACC_DATA, "m": _MAG_DATA, "g": _GYR_DATA}
_BITS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockStretch(LinkFault):
    """The bus does not wait where the chip holds the clock: a share of the transfers is late by a bit."""

    name = "clock-stretch"
    links = frozenset({"bus"})

    share: Share = 1.0

    def spoiled(self, data: bytes, noise: RandomStream, now_ns: int) -> bytes:
        """Put a bit in somewhere; the last one is not read any more."""
        if noise.uniform(2 * now_ns) >= self.share:
            return data
        bits = "".join(f"{byte:08b}" for byte in data)
        place = int(noise.uniform(2 * now_ns + 1) * _BITS)
        late = bits[:place] + "1" + bits[place:-1]
        return bytes(int(late[at : at + _BITS], 2) for at in range(0, len(bits), _BITS))


class Bno055(SensorPeer):
    """The sensor on its bus; data are made when somebody reads.

    Args:
        fitted: where it is, and how it is fed.
        gyroscope, accelerometer: what it senses [deg/s, m/s2].
        field: its magnetometer.
        die: its temperature.
    """

    sheet: ClassVar[Datasheet] = Datasheet(
        model="BNO055",
        addresses=(0x28, 0x29),
        identity=(0x00, 0xA0),
        least_volts=2.4,
        boot_s=0.65,
        reset={
            0x01: 0xFB, 0x02: 0x32, 0x03: 0x0F, 0x04: 0x08, 0x05: 0x03, 0x36: 0x0F, _UNIT_SEL: 0x80,
            _ACC_CONFIG: 0x0D, _MAG_CONFIG: 0x6D, _GYR_CONFIG: 0x38,
        },
        read_only=frozenset(range(0x180)) - _WRITABLE,
        select=_PAGE,
        banks=2,
    )  # fmt: skip
    _mode: Kept[int]
    _coming: Kept[int | None]
    _coming_ns: Kept[int]
    _start_ns: Kept[int]
    _taken: Kept[dict[str, int]]
    _counts: Kept[dict[str, list[int]]]
    _elements: Kept[dict[str, AxesElement]]
    _naps: Kept[Alarms]

    def __init__(
        self, fitted: Fitted, gyroscope: AxesElement, accelerometer: AxesElement, field: FieldElement, die: Die
    ) -> None:
        super().__init__(fitted)
        self._elements, self._field, self._die = {"a": accelerometer, "g": gyroscope}, field, die
        self._coming, self._coming_ns = None, 0
        self._plain: tuple[int, int, bytes, int] | None = None
        self._enter(0, 0)
        self._readers = {
            _OPR_MODE: lambda: self._mode,
            _SYS_STATUS: self._status,
            _TEMP: self._temperature,
        }
        for name, first in _DATA.items():
            for axis in range(len(AXES)):
                self._readers |= number_at(first + 2 * axis, partial(self._count, name, axis))

    def _connected(self) -> None:
        self._naps = Alarms(self._clock, [(fault.start_ns, self._fall_asleep) for fault in self._faults.of(Asleep)])

    def _was_reset(self) -> None:
        self._coming = None
        self._enter(0, 0)

    def _fall_asleep(self) -> None:
        if self._ready_ns is not None:
            self._reset(0)

    def _store(self, register: int, value: int) -> None:
        self._plain = None
        if register == _SYS_TRIGGER and value & _RESET:
            self._reset(self._fitted.boot_ns)
        elif self._coming is not None:
            return
        elif register == _OPR_MODE:
            wanted, now_ns = value & _MODE, self._clock.now_ns()
            if wanted != self._mode and wanted < len(_SENSORS) and not self._faults.now(Asleep, now_ns):
                self._coming = wanted
                self._coming_ns = now_ns + (_FROM_CONFIG_NS if wanted and not self._mode else _TO_CONFIG_NS)
        elif not self._mode or register in _ALWAYS_WRITABLE:
            super()._store(register, value)

    def _settle(self) -> None:
        """Change the mode whose time has come, and take over the newest samples."""
        now_ns = self._clock.now_ns()
        if self._coming is not None and now_ns >= self._coming_ns:
            wanted, self._coming = self._coming, None
            self._enter(wanted, self._coming_ns)
        if self._registers[_PWR_MODE] & 3 == _SUSPEND:
            return
        for name in _SENSORS[self._mode]:
            grid = self._grid(name)
            ended = grid.count(now_ns)
            at_ns = grid.end_ns(ended)
            stuck = self._taken[name] and self._faults.now(Stuck, at_ns)
            if ended > self._taken[name]:
                self._counts[name] = (
                    self._counts[name] if stuck else self._counts_of(name, ended, np.array([at_ns]))[0].tolist()
                )
                self._taken[name] = ended

    def remembers(self, register: int, length: int) -> bool:
        """Return whether `remembered` can tell these registers, until somebody writes to it."""
        measured = self._measured_in(register, length)
        known = register < self.sheet.size and not self._registers.bank and not self._faults.faults
        if not known or self._ready_ns is None or self._coming is not None or measured is None:
            return False
        if self._registers[_PWR_MODE] & 3 == _SUSPEND:
            return False
        now_ns = self._clock.now_ns()
        return now_ns >= self._ready_ns and all(self._grid(name).count(now_ns) for name in measured)

    def remembered(self, register: int, length: int, times_ns: Sequence[int]) -> list[bytes]:
        """Return the bytes of registers in a row as they would have been read at rising instants of the last seconds.

        Nobody has written in the meantime, and nothing was wrong.
        """
        plain, self._pointer = self._plain_registers(register, length)
        rows = np.tile(np.frombuffer(plain, dtype=np.uint8), (len(times_ns), 1))
        for name in self._measured_in(register, length) or "":
            grid = self._grid(name)
            ended = np.array([grid.count(each) for each in times_ns])
            first = int(ended[0])
            counts = self._counts_of(name, first, grid.ends_ns(first, int(ended[-1]) - first + 1))[ended - first]
            self._taken[name], self._counts[name] = int(ended[-1]), counts[-1].tolist()
            at = _DATA[name] - register
            rows[:, at : at + 6] = counts.astype("<i2").view(np.uint8)
        if register <= _TEMP < register + length:
            degrees = self._die.counts(self._die.many(np.array(times_ns)), 1.0) + 25.0
            rows[:, _TEMP - register] = self._thermal(degrees).astype(np.int8).view(np.uint8)
        return [row.tobytes() for row in rows]

    def _plain_registers(self, register: int, length: int) -> tuple[bytes, int]:
        """Return registers of the first page as they are now, 0 for what is measured; and where the pointer ends."""
        known = self._plain
        if known is None or known[:2] != (register, length):
            data = bytearray()
            self._pointer = register
            for _ in range(length):
                at = self._register()
                data.append(0 if at == _TEMP or _ACC_DATA <= at < _GYR_DATA + 6 else self._load(at))
                self._step()
            self._plain = known = (register, length, bytes(data), self._pointer)
        return known[2:]

    def _measured_in(self, register: int, length: int) -> str | None:
        """Return the sensors whose data are all among some registers; None where a part of one's data is."""
        whole = [name for name, at in _DATA.items() if register <= at and at + 6 <= register + length]
        part = [name for name, at in _DATA.items() if register < at + 6 and at < register + length]
        return "".join(name for name in whole if name in _SENSORS[self._mode]) if whole == part else None

    def _grid(self, name: str) -> Grid:
        rate = _MAG_RATES[self._registers[_MAG_CONFIG] & 7] if name == "m" else _RATE
        return Grid(self._start_ns, NANOSECONDS / rate)

    def _enter(self, mode: int, at_ns: int) -> None:
        """Count samples afresh, in this mode."""
        self._mode, self._start_ns, self._plain = mode, at_ns, None
        self._taken = dict.fromkeys("amg", 0)
        self._counts = {name: [0] * len(AXES) for name in "amg"}
        for name, element in self._elements.items():
            if name in _SENSORS[mode]:
                codes = self._registers[_GYR_CONFIG] >> 3 & 7, self._registers[_ACC_CONFIG] >> 2 & 7
                cut_off = _GYRO_BANDWIDTHS[codes[0]] if name == "g" else _ACCEL_BANDWIDTHS[codes[1]]
                # The noise bandwidth of a filter of second order.
                element.begin(at_ns, rate=_RATE, bandwidth=cut_off * pi / sqrt(8))
            else:
                element.stop()

    def _counts_of(self, name: str, first: int, ends_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the three counts of samples of one sensor from number `first` on, shape (n, 3)."""
        units = self._registers[_UNIT_SEL]
        if name == "m":
            ranges, scale = _MAG_RANGES, 16.0
            numbered = enumerate(ends_ns.tolist(), first)
            seen = np.array([self._field.measured(each, at_ns, start_ns=self._start_ns) for each, at_ns in numbered])
        else:
            seen = self._elements[name].measured(first, ends_ns, self._die.many(ends_ns)).T
            if name == "a":
                most = _ACCEL_RANGES[self._registers[_ACC_CONFIG] & 3] * _GRAVITY
                scale = 1000.0 / _GRAVITY if units & _MG else 100.0
            else:
                most = _GYRO_RANGES[min(self._registers[_GYR_CONFIG] & 7, len(_GYRO_RANGES) - 1)]
                scale = 900.0 * pi / 180 if units & _RADIANS else 16.0
            ranges = (most, most, most)
        limits = np.array([min(_MOST, round(most * scale)) for most in ranges])
        return np.clip(np.rint(seen * scale), -limits, limits).astype(np.int64)

    def _count(self, name: str, axis: int) -> int:
        return self._counts[name][axis]

    def _temperature(self) -> int:
        now_ns = self._clock.now_ns()
        raw = self._faults.now(TemperatureRaw, now_ns)
        degrees = np.array([self._die.counts_at(now_ns, 1.0) + 25.0])
        return max(-128, min(127, raw.counts if raw else int(self._thermal(degrees)[0]))) & 0xFF

    def _thermal(self, degrees: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the counts of temperatures in degC."""
        return limited((degrees * 1.8 + 32) / 2 if self._registers[_UNIT_SEL] & _FAHRENHEIT else degrees, -128, 127)

    def _status(self) -> int:
        if not self._mode:
            return _IDLE
        return _FUSION if self._mode >= _FIRST_FUSION else _NO_FUSION


@dataclass(frozen=True, slots=True, kw_only=True)
class BnoTruth(RateTruth):
    """One device: its gyroscope, with the data sheet's 0.014 deg/s/sqrt(Hz) one-sided, and its accelerometer."""

    white: Annotated[tuple[float, float, float], vector(3, minimum=0)] = (9.9e-3,) * 3
    accelerometer: AccelerationTruth = field(default_factory=AccelerationTruth)


def build(setup: PeerSetup) -> Bno055:
    """Build the sensor.

    Terminals `rate` (three axes, deg/s), `acceleration` (three axes, m/s2), `field` (three axes, uT), `temperature`
    (degC) and `power` (V) go to plant signals.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    fitted, die = Fitted.read(setup, Bno055.sheet), Die(setup, most=85)
    own = setup.truth.part(BnoTruth)
    gyroscope = AxesElement(setup, "rate", own)
    accelerometer = AxesElement(setup, "acceleration", own.accelerometer, own.accelerometer.acceleration)
    magnetometer = FieldElement(setup, noise=(0.5, 0.5, 0.5))
    setup.finish()
    return Bno055(fitted, gyroscope, accelerometer, magnetometer, die)


MODEL = PeerModel(
    link="bus",
    fault_kinds=(Asleep, ClockStretch, Drifting, OtherIdentity, Saturated, Stuck, TemperatureRaw),
    build=build,
)
"""The model for the driver `bno055`."""
