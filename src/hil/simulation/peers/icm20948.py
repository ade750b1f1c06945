"""An ICM-20948 gyroscope, accelerometer and magnetometer at register level.

TDK InvenSense DS-000189, as far as public sources tell it: the SparkFun and PX4 drivers (registers, banks, scales,
temperature), pages of the data sheet (PWR_MGMT_1, LP_CONFIG, magnetometer), and from memory its tables of filters and
of times. WHO_AM_I is EAh in bank 0; REG_BANK_SEL 7Fh selects one of four banks with bits 5:4. After power-on it
sleeps (PWR_MGMT_1 06h is 41h). Ranges are 250 deg/s to 2000 deg/s (131 to 16.4 LSB/(deg/s)) and 2 g to 16 g
(16384 to 2048 LSB/g), high byte first; samples come at 1125 Hz/(1 + divisor), at 9000 or 4500 Hz without filter. The
temperature is 21 degC + counts/333.87. The magnetometer, an AK09916 at 0Ch, hangs on the chip's own second bus: the
host reaches it while the chip is awake, INT_PIN_CFG 0Fh has BYPASS_EN (bit 1) and USER_CTRL 03h has not I2C_MST_EN
(bit 5). The FIFO holds 512 bytes, in the order of the registers: accelerometer, gyroscope, temperature. FIFO_COUNT 70h
is in bytes, big-endian; INT_STATUS_2 1Bh says once that something was lost. A burst continues at the next register, and
stays at FIFO_R_W 72h once it is there.

Assumed, for these sources leave it open: samples come at the gyroscope's rate where both sensors are on; data are 0
until the sensor has started, which takes 35 ms; any change of rate, filter or power starts the samples, and their
noise, again; a full FIFO loses whole packets. Not modelled: the DMP, the chip as master of its second bus, duty cycles,
self-test, offsets, FSYNC, interrupts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from functools import partial
from typing import Annotated, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from hil.clock.port import NANOSECONDS
from hil.model.notation import number, vector
from hil.simulation.faults import Drifting, Fault, Saturated, Stuck
from hil.simulation.peers.ak09916 import Ak09916
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.sensors.chip import Asleep, Datasheet, Fitted, OtherIdentity, TemperatureRaw, number_at
from hil.simulation.peers.sensors.elements import AccelerationTruth, AxesElement, Die, FieldElement, RateTruth, limited
from hil.simulation.peers.sensors.fifo import Fifo
from hil.simulation.peers.sensors.grid import Grid
from hil.simulation.peers.sensors.registers import RegisterFile
from hil.simulation.peers.sensors.sampled import SampledPeer
from hil.simulation.peers.sensors.sampler import Bits, FifoSetting, Sampler, Samples
from hil.wire.checkpoint import Kept
from hil.wire.peer import Nack, PeerClock

__all__ = ["MODEL", "Icm20948", "build"]


class Register(IntEnum):
    """Registers by bank (high byte) and number (low byte)."""

    USER_CTRL, LP_CONFIG, PWR_MGMT_1, PWR_MGMT_2, INT_PIN_CFG = 0x03, 0x05, 0x06, 0x07, 0x0F
    INT_STATUS_1, INT_STATUS_2, ACCEL_OUT = 0x1A, 0x1B, 0x2D
    FIFO_EN_2, FIFO_RST, FIFO_MODE, FIFO_COUNT, FIFO_R_W, REG_BANK_SEL = 0x67, 0x68, 0x69, 0x70, 0x72, 0x7F
    GYRO_SMPLRT_DIV, GYRO_CONFIG_1 = 0x200, 0x201
    ACCEL_SMPLRT_DIV_1, ACCEL_SMPLRT_DIV_2, ACCEL_CONFIG = 0x210, 0x211, 0x214


_DEVICE_RESET, _SLEEP, _TEMP_DIS = 0x80, 0x40, 0x08
_FIFO_EN, _I2C_MST_EN, _BYPASS_EN = 0x40, 0x20, 0x02
_ACCEL_TO_FIFO, _GYRO_TO_FIFO, _TEMP_TO_FIFO, _TO_FIFO = 0x10, 0x0E, 0x01, 0x1F
_START_UP_NS = 35_000_000
_RATE, _UNFILTERED_GYRO, _UNFILTERED_ACCEL = 1125.0, 9000.0, 4500.0
# Noise bandwidth [Hz] by DLPFCFG; the last one is without filter.
_GYRO_BANDWIDTHS = (229.8, 187.6, 154.3, 73.3, 35.9, 17.8, 8.9, 376.5, 12316.0)
_ACCEL_BANDWIDTHS = (265.0, 265.0, 136.0, 68.8, 34.4, 17.0, 8.3, 499.0, 1248.0)
_LSB_PER_DEGREE = (131.0, 65.5, 32.8, 16.4)
_LSB_PER_G, _GRAVITY = (16384, 8192, 4096, 2048), 9.80665
_LSB_PER_KELVIN, _COLDER = 333.87, 4.0  # counts are 0 at 21 degC
_LEAST, _MOST = -32768, 32767
_TEMPERATURE = 6  # its place in a sample
_FIFO_BYTES = 512
_BITS = Bits(new=0x01, watermark=0x00, full=0x00)
_MAGNETOMETER = 0x0C


@dataclass(frozen=True, slots=True, kw_only=True)
class BypassOff(Fault):
    """The way to the magnetometer is shut: BYPASS_EN reads 0, whatever is written."""

    name = "bypass-off"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Setting:
    """What the registers ask for.

    Attributes:
        gyro, accel: which of them is on; none of them is sleep.
        rate: nominal samples per second.
        gyro_bandwidth, accel_bandwidth: noise bandwidths of their filters [Hz].
    """

    gyro: bool
    accel: bool
    rate: float
    gyro_bandwidth: float
    accel_bandwidth: float

    @classmethod
    def read(cls, registers: RegisterFile) -> Self:
        """Read the registers."""
        awake, disabled = not registers[Register.PWR_MGMT_1] & _SLEEP, registers[Register.PWR_MGMT_2]
        gyro, accel = awake and disabled & 0x07 != 0x07, awake and disabled & 0x38 != 0x38
        rates, accelerations = registers[Register.GYRO_CONFIG_1], registers[Register.ACCEL_CONFIG]
        if gyro or not accel:
            rate = _RATE / (1 + registers[Register.GYRO_SMPLRT_DIV]) if rates & 1 else _UNFILTERED_GYRO
        else:
            divisor = (registers[Register.ACCEL_SMPLRT_DIV_1] & 0x0F) << 8 | registers[Register.ACCEL_SMPLRT_DIV_2]
            rate = _RATE / (1 + divisor) if accelerations & 1 else _UNFILTERED_ACCEL
        return cls(
            gyro=gyro,
            accel=accel,
            rate=rate,
            gyro_bandwidth=_GYRO_BANDWIDTHS[rates >> 3 & 7 if rates & 1 else 8],
            accel_bandwidth=_ACCEL_BANDWIDTHS[accelerations >> 3 & 7 if accelerations & 1 else 8],
        )


class Icm20948(SampledPeer):
    """The sensor on its bus.

    Args:
        fitted: where it is, and how it is fed.
        gyroscope, accelerometer: what it senses [deg/s, m/s2].
        die: its temperature.
        magnetometer: on the second bus.
        odr_error: relative error of the oscillator.
    """

    sheet: ClassVar[Datasheet] = Datasheet(
        model="ICM-20948",
        addresses=(0x68, 0x69),
        identity=(0x00, 0xEA),
        least_volts=1.71,
        boot_s=0.011,
        reset={Register.LP_CONFIG: 0x40, Register.PWR_MGMT_1: 0x41, 0x201: 0x01, 0x214: 0x01},
        read_only=frozenset((0x00, *range(0x17, 0x66), *range(0x70, 0x73))),
        select=Register.REG_BANK_SEL,
    )
    sleep: ClassVar[tuple[int, int, int]] = (Register.PWR_MGMT_1, _SLEEP, _SLEEP)
    _start_ns: Kept[int]
    _valid_ns: Kept[int]
    _lost: Kept[int]
    _gyroscope: Kept[AxesElement]
    _accelerometer: Kept[AxesElement]
    _magnetometer: Kept[Ak09916]
    _fifo: Kept[Fifo]

    def __init__(
        self,
        fitted: Fitted,
        gyroscope: AxesElement,
        accelerometer: AxesElement,
        die: Die,
        magnetometer: Ak09916,
        *,
        odr_error: float,
    ) -> None:
        super().__init__(fitted)
        self._gyroscope, self._accelerometer, self._magnetometer = gyroscope, accelerometer, magnetometer
        self._die = die
        self._odr = 1 + odr_error
        self._setting = _Setting.read(self._registers)
        self._fifo = Fifo(_FIFO_BYTES, 1)
        self._sampler = Sampler(
            bits=_BITS,
            asleep=[0] * 7,
            make=self._samples,
            pack=self._packed,
            look=self._fifo_setting,
            fifo=self._fifo,
            faults=fitted.faults,
        )
        self._sampler.make_packed = self._packed_samples
        self._readers = self._computed()
        self._start_ns = self._valid_ns = self._lost = 0

    @property
    def addresses(self) -> tuple[int, ...]:
        """The address that is strapped, and the magnetometer's."""
        return (self._fitted.address, _MAGNETOMETER)

    def attach(self, clock: PeerClock) -> None:
        """Connect the clock, and watch the supply voltage."""
        self._magnetometer.attach(clock)
        super().attach(clock)

    def write(self, address: int, data: bytes) -> None:
        """Take what is written to the chip, or through it to the magnetometer."""
        if address == _MAGNETOMETER:
            self._require_bypass()
            self._magnetometer.write(address, data)
        else:
            super().write(address, data)

    def read(self, address: int, count: int) -> bytes:
        """Give registers of the chip, or of the magnetometer."""
        if address == _MAGNETOMETER:
            self._require_bypass()
            return self._magnetometer.read(address, count)
        return super().read(address, count)

    def restored(self) -> None:
        """Read what the registers ask for."""
        self._setting = _Setting.read(self._registers)

    def _require_bypass(self) -> None:
        self._require_answer()
        asleep = self._registers[Register.PWR_MGMT_1] & _SLEEP
        if asleep or self._registers[Register.USER_CTRL] & _I2C_MST_EN or not self._pins() & _BYPASS_EN:
            raise Nack

    def _was_reset(self) -> None:
        self._setting = _Setting.read(self._registers)
        self._fifo.flush(1)
        self._lost = 0
        self._gyroscope.stop()
        self._accelerometer.stop()
        self._sampler.reset(0)

    def _store(self, register: int, value: int) -> None:
        before = self._registers[register]
        if register == Register.REG_BANK_SEL:
            self._registers.bank = value >> 4 & 3
            return
        if register == Register.PWR_MGMT_1 and value & _DEVICE_RESET:
            self._reset(self._fitted.boot_ns)
            return
        self._registers[register] = self._woken(register, value)
        contents = register == Register.FIFO_EN_2 and before != value
        if contents or (register == Register.FIFO_RST and value & _TO_FIFO):
            self._sampler.flush(max(1, self._packet_bytes()))
            self._lost = 0
        self._configure()

    def _configure(self) -> None:
        """Follow the registers; what changes rate, filter or power starts the samples again."""
        before, wanted = self._setting, _Setting.read(self._registers)
        if wanted != before:
            now_ns = self._clock.now_ns()
            woken = (wanted.gyro and not before.gyro) or (wanted.accel and not before.accel)
            self._valid_ns = now_ns + _START_UP_NS if woken else self._valid_ns
            self._setting, self._start_ns = wanted, now_ns
            rate = wanted.rate * self._odr
            for sensor, on, bandwidth in (
                (self._gyroscope, wanted.gyro, wanted.gyro_bandwidth),
                (self._accelerometer, wanted.accel, wanted.accel_bandwidth),
            ):
                if on:
                    sensor.begin(now_ns, rate=rate, bandwidth=bandwidth)
                else:
                    sensor.stop()
            running = wanted.gyro or wanted.accel
            self._sampler.restart(Grid(now_ns, NANOSECONDS / rate) if running else None)
        self._sampler.reschedule()

    def _packed_samples(self, first: int, ends_ns: NDArray[np.int64]) -> Samples:
        """Make samples with those numbers alone that go into the FIFO, where one of each sensor's does."""
        contents = self._contents()
        return self._samples(first, ends_ns, accel=min(contents) < 3, gyro=any(3 <= each < 6 for each in contents))

    def _samples(self, first: int, ends_ns: NDArray[np.int64], *, accel: bool = True, gyro: bool = True) -> Samples:
        """Make samples: three accelerations, three rates, the temperature."""
        degrees = self._die.many(ends_ns)
        outputs = np.zeros((ends_ns.size, 7), dtype=np.int16)
        if accel and self._setting.accel:
            measured = self._accelerometer.measured(first, ends_ns, degrees)
            measured *= _LSB_PER_G[self._registers[Register.ACCEL_CONFIG] >> 1 & 3] / _GRAVITY
            outputs[:, :3] = limited(measured, _LEAST, _MOST).T
        if gyro and self._setting.gyro:
            measured = self._gyroscope.measured(first, ends_ns, degrees)
            measured *= _LSB_PER_DEGREE[self._registers[Register.GYRO_CONFIG_1] >> 1 & 3]
            outputs[:, 3:6] = limited(measured, _LEAST, _MOST).T
        outputs[ends_ns < self._valid_ns] = 0
        outputs[:, _TEMPERATURE] = self._temperatures(ends_ns, degrees)
        return Samples(ends_ns, outputs, np.zeros(ends_ns.size, dtype=np.int8))

    def _temperatures(self, ends_ns: NDArray[np.int64], degrees: NDArray[np.float64]) -> NDArray[np.float64]:
        if self._registers[Register.PWR_MGMT_1] & _TEMP_DIS:
            return np.zeros(ends_ns.size)
        counts = self._as_raw(self._die.counts(degrees + _COLDER, _LSB_PER_KELVIN), ends_ns)
        return limited(counts, _LEAST, _MOST)

    def _contents(self) -> list[int]:
        """Return which numbers of a sample go into the FIFO."""
        asked = self._registers[Register.FIFO_EN_2]
        accel = [0, 1, 2] if asked & _ACCEL_TO_FIFO else []
        gyro = [3 + axis for axis in range(3) if asked & 2 << axis]
        return accel + gyro + ([6] if asked & _TEMP_TO_FIFO else [])

    def _packet_bytes(self) -> int:
        return 2 * len(self._contents())

    def _packed(self, samples: Samples) -> bytes:
        return samples.outputs[:, self._contents()].astype(">i2").tobytes()

    def _fifo_setting(self) -> FifoSetting:
        held = self._registers[Register.FIFO_RST] & _TO_FIFO
        on = self._registers[Register.USER_CTRL] & _FIFO_EN and self._contents()
        newest_go = bool(self._registers[Register.FIFO_MODE] & 1)
        return FifoSetting(active=bool(on and not held), newest_go=newest_go, watermark=0, every=False, sources=0)

    def _computed(self) -> Mapping[int, Callable[[], int]]:
        """Return the registers whose bytes are made when they are read."""
        readers: dict[int, Callable[[], int]] = {
            Register.INT_PIN_CFG: self._pins,
            Register.INT_STATUS_1: self._new,
            Register.INT_STATUS_2: self._overflowed,
            Register.REG_BANK_SEL: lambda: self._registers.bank << 4,
        }
        for place in range(7):
            output = partial(self._output, place)
            readers |= number_at(Register.ACCEL_OUT + 2 * place, output, big=lambda: True)
        return readers | number_at(Register.FIFO_COUNT, lambda: self._fifo.filled, big=lambda: True)

    def _output(self, place: int) -> int:
        """Return one number; the temperature alone does not have the axes made, which a magnetometer leaves unread."""
        if place == _TEMPERATURE:
            alone = self._temperature_alone(lambda ends_ns: self._temperatures(ends_ns, self._die.many(ends_ns)))
            if alone is not None:
                return alone
        return self._sampler.newest[place]

    def _pins(self) -> int:
        shut = self._faults.now(BypassOff, self._clock.now_ns())
        return self._registers[Register.INT_PIN_CFG] & (~_BYPASS_EN if shut else 0xFF)

    def _new(self) -> int:
        status, self._sampler.status = self._sampler.status, 0
        return status & _BITS.new

    def _overflowed(self) -> int:
        lost, self._lost = self._fifo.lost != self._lost, self._fifo.lost
        return int(lost)

    def _burst(self, register: int, count: int) -> bytes:
        """Take from the FIFO: a transfer stays at its data."""
        if register != Register.FIFO_R_W:
            return b""
        data = self._fifo.take(count, resume=True)
        self._sampler.reschedule()
        return data


@dataclass(frozen=True, slots=True, kw_only=True)
class IcmTruth(RateTruth):
    """One device: the relative error of its sample rate, its gyroscope, and its accelerometer.

    The gyroscope has the data sheet's 0.015 deg/s/sqrt(Hz), one-sided.
    """

    white: Annotated[tuple[float, float, float], vector(3, minimum=0)] = (1.06e-2,) * 3
    odr_error: Annotated[float, number(-0.1, 0.1)] = 0.0
    accelerometer: AccelerationTruth = field(default_factory=AccelerationTruth)


def build(setup: PeerSetup) -> Icm20948:
    """Build the sensor.

    Terminals `rate` (three axes, deg/s), `acceleration` (three axes, m/s2), `field` (three axes, uT), `temperature`
    (degC) and `power` (V) go to plant signals.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    fitted, die = Fitted.read(setup, Icm20948.sheet), Die(setup, most=85)
    own = setup.truth.part(IcmTruth)
    gyroscope = AxesElement(setup, "rate", own)
    accelerometer = AxesElement(setup, "acceleration", own.accelerometer, own.accelerometer.acceleration)
    magnetometer = Ak09916(Fitted.read(setup, Ak09916.sheet), FieldElement(setup, noise=(0.3, 0.3, 0.3)))
    setup.finish()
    return Icm20948(fitted, gyroscope, accelerometer, die, magnetometer, odr_error=own.odr_error)


MODEL = PeerModel(
    link="bus", fault_kinds=(Asleep, BypassOff, Drifting, OtherIdentity, Saturated, Stuck, TemperatureRaw), build=build
)
"""The model for the driver `icm20948`."""
