"""An IIM-42652 gyroscope and accelerometer at register level.

TDK InvenSense DS-000440, as far as public sources tell it: the vendor's header Ixm42xxxDefs.h (registers, bits,
ranges, rates, filter orders), Linux inv_icm42600 (60 ms to start, 150 ms to stop, -32768 for invalid, packets, 2048
bytes), and for the filter's bandwidths, reset values and INT_ASYNC_RESET drivers of its family (ICM-42688,
ICM-40609).

WHO_AM_I 75h is 6Fh; registers lie in banks selected by REG_BANK_SEL 76h; after power-on both sensors are off and data
are -32768 (8000h), big-endian. PWR_MGMT0 4Eh with gyroscope mode 3 (low noise) starts it: 60 ms until data are valid,
150 ms from off to on. Ranges are 2000 deg/s halved down to 15.625 deg/s (16.4 to 2097.2 LSB/(deg/s)), rates 8 kHz to
12.5 Hz. The filter's -3 dB bandwidth is rate/2, or the larger of 400 Hz and the rate over 4, 5, 8, 10, 16, 20, 40.
Temperature is 25 degC + counts/132.48, in the FIFO 25 degC + counts/2.07. The FIFO holds 2048 bytes. FIFO_COUNT is
big-endian, in bytes or packets (INTF_CONFIG0). A burst continues at the next register, and stays at FIFO_DATA once it
is there.

Assumed, for these sources leave it open: samples come at the gyroscope's rate where both sensors are on; the filter's
noise bandwidth is that of a Butterworth filter of GYRO_UI_FILT_ORD, and it does not delay or smooth the rate itself;
any change of rate, filter or power starts the samples, and their noise, again; the watermark interrupt comes when the
level is reached from below, with FIFO_WM_GT_TH at every sample while it is; a change of what goes into the FIFO
empties it; without FIFO_TEMP_EN the temperature byte is 80h; lost packets are counted until the FIFO is flushed;
nothing is acknowledged within 1 ms after a reset; the accelerometer sees a constant without noise. A pulse of INT1
lasts 100 us, or 8 us with INT_TPULSE_DURATION; while INT_ASYNC_RESET is not cleared (it is set after power-on, and has
to be 0 for the pins to work) nothing comes. Not modelled: filters of the codes 8 to 15 (they count as rate/2), packets
of 20 bits, low-power mode of the gyroscope, TEMP_DIS, FSYNC, INT2, APEX, self-test, clock input, and the user offsets
of bank 4, which are stored and do nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from hil.clock.port import NANOSECONDS
from hil.model.notation import number, vector
from hil.simulation.faults import Drifting, Saturated, Stuck
from hil.simulation.peers.iim42652_registers import (
    READ_ONLY,
    RESET,
    SENSORS,
    Register,
    Setting,
    fifo_setting,
    packet_bytes,
    pin_setting,
)
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.sensors.chip import Asleep, Datasheet, Fitted, OtherIdentity, TemperatureRaw, number_at
from hil.simulation.peers.sensors.elements import AxesElement, Die, limited
from hil.simulation.peers.sensors.fifo import Fifo
from hil.simulation.peers.sensors.grid import Grid
from hil.simulation.peers.sensors.pin import Pin
from hil.simulation.peers.sensors.sampled import SampledPeer
from hil.simulation.peers.sensors.sampler import Bits, Sampler, Samples
from hil.wire.checkpoint import Kept

__all__ = ["MODEL", "Iim42652", "IimTruth", "build"]


_INVALID, _MOST = -32768, 32767
_RESET_NS, _START_UP_NS, _STOP_NS = 1_000_000, 60_000_000, 150_000_000
_LSB_PER_DEGREE = (16.4, 32.8, 65.5, 131.0, 262.0, 524.3, 1048.6, 2097.2)
_LSB_PER_G = (2048, 4096, 8192, 16384)
_LSB_PER_KELVIN, _FIFO_LSB_PER_KELVIN = 132.48, 2.07
_SOFT_RESET, _FLUSH, _RESTART, _STROBE = 0x01, 0x02, 0x08, 0x04
_RECORDS, _BIG_COUNT, _BIG_DATA = 0x40, 0x20, 0x10
_MODES, _BY_READING, _RESET_DONE = 0x0F, 0x08, 0x10
_BITS = Bits(new=0x08, watermark=0x04, full=0x02)
_ACCEL, _GYRO, _TEMPERATURE, _TIMESTAMP, _CONTENTS = 0x01, 0x02, 0x04, 0x08, 0x0F
_RESUME = 0x40
_HEADER_ACCEL, _HEADER_GYRO, _HEADER_TIMESTAMP = 0x40, 0x20, 0x08
_NO_TEMPERATURE = -128
_NS_PER_STAMP, _NS_PER_LONG_STAMP, _LONG_STAMP = 1000, 16000, 0x08
_FIFO_BYTES = 2048


class Iim42652(SampledPeer):
    """The sensor on its bus.

    Args:
        fitted: where it is, and how it is fed.
        element: its gyroscope.
        die: its temperature.
        acceleration: what the accelerometer sees [g].
        odr_error: relative error of the oscillator.
    """

    sheet: ClassVar[Datasheet] = Datasheet(
        model="IIM-42652",
        addresses=(0x68, 0x69),
        identity=(Register.WHO_AM_I, 0x6F),
        least_volts=1.71,
        boot_s=1e-3,
        reset=RESET,
        read_only=READ_ONLY,
        select=Register.REG_BANK_SEL,
    )
    sleep: ClassVar[tuple[int, int, int]] = (Register.PWR_MGMT0, _MODES, 0)
    _stamp: Kept[int]
    _start_ns: Kept[int]
    _valid_ns: Kept[int]
    _off_ns: Kept[int | None]
    _reset_ns: Kept[int]
    _element: Kept[AxesElement]
    _fifo: Kept[Fifo]
    _pin: Kept[Pin]

    def __init__(
        self, fitted: Fitted, element: AxesElement, die: Die, *, acceleration: tuple[float, ...], odr_error: float
    ) -> None:
        super().__init__(fitted)
        self._element = element
        self._die = die
        self._acceleration = acceleration
        self._odr = 1 + odr_error
        self._setting = Setting.read(self._registers)
        self._fifo = Fifo(_FIFO_BYTES, 8)
        self._pin = Pin(partial(pin_setting, self._registers))
        self._sampler = Sampler(
            bits=_BITS,
            asleep=[_INVALID] * 4,
            make=self._samples,
            pack=self._packed,
            look=partial(fifo_setting, self._registers),
            fifo=self._fifo,
            pin=self._pin,
            faults=fitted.faults,
        )
        self._readers = self._computed()
        self._stamp = self._start_ns = self._valid_ns = self._reset_ns = 0
        self._off_ns = None

    def on_interrupt(self, callback: Callable[[], None]) -> None:
        """Call back at every rising edge of INT1."""
        self._pin.listen(callback)

    def restored(self) -> None:
        """Read what the registers ask for."""
        self._setting = Setting.read(self._registers)

    def _connected(self) -> None:
        self._pin.attach(self._clock)
        super()._connected()

    def _was_reset(self) -> None:
        self._setting, self._stamp = Setting.read(self._registers), 0
        self._off_ns, self._reset_ns = None, self._clock.now_ns()
        self._fifo.flush(8)
        self._pin.reset()
        self._begin()
        self._sampler.reset(_RESET_DONE)

    def _store(self, register: int, value: int) -> None:
        before = self._registers[register]
        if register == Register.DEVICE_CONFIG and value & _SOFT_RESET:
            self._reset(_RESET_NS)
        elif register == Register.SIGNAL_PATH_RESET:  # acts once; its bits clear themselves
            if value & _STROBE:
                self._stamp = int(self._stamps(np.array([self._clock.now_ns()]))[0]) % (1 << 20)
            if value & (_FLUSH | _RESTART):
                self._sampler.flush(packet_bytes(self._registers))
        else:
            self._registers[register] = self._woken(register, value)
            bypassed = register == Register.FIFO_CONFIG and not self._registers[register] >> 6
            if bypassed or (register == Register.FIFO_CONFIG1 and (before ^ value) & _CONTENTS):
                self._sampler.flush(packet_bytes(self._registers))
            self._configure()

    def _configure(self) -> None:
        """Follow the registers; what changes rate, filter or power starts the samples again."""
        now_ns, before, wanted = self._clock.now_ns(), self._setting, Setting.read(self._registers)
        if wanted != before:
            if not (wanted.gyro and before.gyro):  # it takes time to start, and to stop before that
                self._off_ns = now_ns if before.gyro else self._off_ns
                stopped_ns = now_ns if self._off_ns is None else max(now_ns, self._off_ns + _STOP_NS)
                self._valid_ns = stopped_ns + _START_UP_NS
            self._setting, self._start_ns = wanted, now_ns
            self._begin()
            running = wanted.gyro or wanted.accel
            self._sampler.restart(Grid(now_ns, NANOSECONDS / (wanted.rate * self._odr)) if running else None)
        self._sampler.reschedule()

    def _begin(self) -> None:
        """Let the gyroscope sense, or not."""
        if self._setting.gyro:
            rate = self._setting.rate * self._odr
            self._element.begin(self._start_ns, rate=rate, bandwidth=self._setting.bandwidth)
        else:
            self._element.stop()

    def _samples(self, first: int, ends_ns: NDArray[np.int64]) -> Samples:
        """Make samples: temperature and three rates, and the temperature as the FIFO has it."""
        degrees = self._die.many(ends_ns)
        outputs = np.full((ends_ns.size, 4), _INVALID, dtype=np.int16)
        if self._setting.gyro:
            measured = self._element.measured(first, ends_ns, degrees)
            measured *= _LSB_PER_DEGREE[self._registers[Register.GYRO_CONFIG0] >> 5]
            outputs[:, 1:] = limited(measured, -_MOST, _MOST).T
            outputs[ends_ns < self._valid_ns, 1:] = _INVALID
        counts = self._as_raw(self._die.counts(degrees, _LSB_PER_KELVIN), ends_ns)
        outputs[:, 0] = limited(counts, -_MOST, _MOST)
        short = limited(counts * (_FIFO_LSB_PER_KELVIN / _LSB_PER_KELVIN), -128, 127)
        return Samples(ends_ns, outputs, short.astype(np.int8))

    def _accelerations(self) -> NDArray[np.int16]:
        """Return the accelerometer's three counts."""
        if not self._setting.accel:
            return np.full(3, _INVALID, dtype=np.int16)
        scale = _LSB_PER_G[self._registers[Register.ACCEL_CONFIG0] >> 5 & 3]
        return np.asarray(np.clip(np.rint(np.array(self._acceleration) * scale), -_MOST, _MOST), dtype=np.int16)

    def _stamps(self, times_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the time-stamp counter, 20 bits of 1 us or 16 us by the sensor's own oscillator."""
        long = self._registers[Register.TMST_CONFIG] & _LONG_STAMP
        passed = (times_ns - self._reset_ns) * self._odr
        return np.asarray(passed // (_NS_PER_LONG_STAMP if long else _NS_PER_STAMP), dtype=np.int64)

    def _packed(self, samples: Samples) -> bytes:
        """One sensor: header, three axes, temperature. Both: header, accelerometer, gyroscope, temperature, stamp."""
        config = self._registers[Register.FIFO_CONFIG1]
        order = ">" if self._interface(_BIG_DATA) else "<"
        packets = np.zeros(samples.ends_ns.size, dtype=_layout(config & SENSORS, order))
        packets["header"] = (_HEADER_ACCEL if config & _ACCEL else 0) | (_HEADER_GYRO if config & _GYRO else 0)
        packets["temperature"] = samples.aside if config & _TEMPERATURE else _NO_TEMPERATURE
        if config & _ACCEL:
            packets["accel"] = self._accelerations()
        if config & _GYRO:
            packets["gyro"] = samples.outputs[:, 1:]
        if packet_bytes(self._registers) > 8 and config & _TIMESTAMP:
            packets["header"] |= _HEADER_TIMESTAMP
            packets["stamp"] = self._stamps(samples.ends_ns).astype(np.uint16)
        return packets.tobytes()

    def _computed(self) -> Mapping[int, Callable[[], int]]:
        """Return the registers whose bytes are made when they are read."""
        readers: dict[int, Callable[[], int]] = {Register.INT_STATUS: self._status}
        for place in range(7):
            readers |= number_at(
                Register.TEMP_DATA + 2 * place, partial(self._output, place), big=partial(self._interface, _BIG_DATA)
            )
        readers |= number_at(Register.FIFO_COUNT, self._count, big=partial(self._interface, _BIG_COUNT))
        readers |= number_at(Register.FIFO_LOST_PKT, lambda: self._fifo.lost)
        return readers | number_at(Register.TMSTVAL, lambda: self._stamp, 3)

    def _interface(self, bit: int) -> bool:
        return bool(self._registers[Register.INTF_CONFIG0] & bit)

    def _output(self, place: int) -> int:
        """Return one number: temperature, accelerometer, gyroscope, in this order."""
        outputs = self._sampler.newest
        return int(self._accelerations()[place - 1]) if 1 <= place < 4 else outputs[max(0, place - 3)]

    def _count(self) -> int:
        return self._fifo.filled // packet_bytes(self._registers) if self._interface(_RECORDS) else self._fifo.filled

    def _status(self) -> int:
        self._pin.clear()
        return self._sampler.take_status()

    def _burst(self, register: int, count: int) -> bytes:
        """Take from the FIFO: a transfer stays at its data."""
        if register != Register.FIFO_DATA:
            return b""
        by_reading = self._registers[Register.INT_CONFIG0] & _BY_READING
        if by_reading and self._sampler.status & (_BITS.watermark | _BITS.full):
            self._pin.clear()
        return self._sampler.take(count, resume=bool(self._registers[Register.FIFO_CONFIG1] & _RESUME))


@lru_cache
def _layout(sensors: int, order: str) -> np.dtype[np.void]:
    """Return what a packet holds."""
    fields = [("header", "u1")]
    fields += [("accel", f"3{order}i2")] if sensors & _ACCEL else []
    fields += [("gyro", f"3{order}i2")] if sensors & _GYRO else []
    fields += [("temperature", "i1")]
    fields += [("stamp", f"{order}u2")] if sensors == SENSORS else []
    return np.dtype(fields)


@dataclass(frozen=True, slots=True, kw_only=True)
class IimTruth:
    """One device: what its accelerometer reads [g], and the relative error of its sample rate."""

    acceleration: Annotated[tuple[float, ...], vector(3)] = (0.0, 0.0, 1.0)
    odr_error: Annotated[float, number(-0.1, 0.1)] = 0.0


def build(setup: PeerSetup) -> Iim42652:
    """Build the sensor; terminals `rate` (three axes, deg/s), `temperature` (degC) and `power` (V) go to plant signals.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    fitted, element, die = Fitted.read(setup, Iim42652.sheet), AxesElement(setup), Die(setup, most=105)
    own = setup.truth.part(IimTruth)
    setup.finish()
    return Iim42652(fitted, element, die, acceleration=own.acceleration, odr_error=own.odr_error)


MODEL = PeerModel(
    link="bus", fault_kinds=(Asleep, Drifting, OtherIdentity, Saturated, Stuck, TemperatureRaw), build=build
)
"""The model for the driver `iim42652`."""
