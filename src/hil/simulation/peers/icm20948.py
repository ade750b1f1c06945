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

from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from hil.model.notation import vector
from hil.simulation.faults import Drifting, Fault, Saturated, Stuck
from hil.simulation.peers.ak09916 import Ak09916
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
from hil.simulation.peers.sensors.elements import FieldElement, RateTruth
from hil.simulation.peers.sensors.fifo import Fifo
from hil.simulation.peers.sensors.inertial import InertialDie, Senses, Setting
from hil.simulation.peers.sensors.sampler import Bits, FifoSetting, Samples
from hil.wire.peer import Nack

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
_RATE, _UNFILTERED_GYRO, _UNFILTERED_ACCEL = 1125.0, 9000.0, 4500.0
# Noise bandwidth [Hz] by DLPFCFG; the last one is without filter.
_GYRO_BANDWIDTHS = (229.8, 187.6, 154.3, 73.3, 35.9, 17.8, 8.9, 376.5, 12316.0)
_ACCEL_BANDWIDTHS = (265.0, 265.0, 136.0, 68.8, 34.4, 17.0, 8.3, 499.0, 1248.0)
_LSB_PER_DEGREE = (131.0, 65.5, 32.8, 16.4)
_LSB_PER_G, _GRAVITY = (16384, 8192, 4096, 2048), 9.80665
_FIFO_BYTES = 512


@dataclass(frozen=True, slots=True, kw_only=True)
class BypassOff(Fault):
    """The way to the magnetometer is shut: BYPASS_EN reads 0, whatever is written."""

    name = "bypass-off"


class Icm20948(InertialDie):
    """The first die.

    Args:
        fitted: where it is, and how it is fed.
        senses: what it senses.
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
        shift=4,
        banks=4,
    )
    sleep: ClassVar[tuple[int, int, int]] = (Register.PWR_MGMT_1, _SLEEP, _SLEEP)
    bits: ClassVar[Bits] = Bits(new=0x01, watermark=0x00, full=0x00)
    heat: ClassVar[tuple[float, float]] = (333.87, 4.0)
    start_up_ns: ClassVar[int] = 35_000_000

    def __init__(self, fitted: Fitted, senses: Senses) -> None:
        super().__init__(fitted, senses, Fifo(_FIFO_BYTES, 1))
        self._sampler.make_packed = self._packed_samples
        self._readers = {
            Register.INT_PIN_CFG: self._pins,
            Register.INT_STATUS_1: self._sampler.take_status,
            Register.INT_STATUS_2: self._overflowed,
            **number_at(Register.FIFO_COUNT, lambda: self._fifo.filled, big=lambda: True),
        }
        for place in range(7):
            output = partial(self._output, place)
            self._readers |= number_at(Register.ACCEL_OUT + 2 * place, output, big=lambda: True)

    def require_bypass(self) -> None:
        """Raise Nack while nobody reaches the second bus through it."""
        self._require_answer()
        asleep = self._registers[Register.PWR_MGMT_1] & _SLEEP
        if asleep or self._registers[Register.USER_CTRL] & _I2C_MST_EN or not self._pins() & _BYPASS_EN:
            raise Nack

    def _store(self, register: int, value: int) -> None:
        before = self._registers[register]
        if register == Register.PWR_MGMT_1 and value & _DEVICE_RESET:
            self._reset(self._fitted.boot_ns)
            return
        self._registers[register] = self._woken(register, value)
        contents = register == Register.FIFO_EN_2 and before != value
        if contents or (register == Register.FIFO_RST and value & _TO_FIFO):
            self._empty()
        self._configure()

    def _wanted(self) -> Setting:
        registers = self._registers
        awake, disabled = not registers[Register.PWR_MGMT_1] & _SLEEP, registers[Register.PWR_MGMT_2]
        gyro, accel = awake and disabled & 0x07 != 0x07, awake and disabled & 0x38 != 0x38
        rates, accelerations = registers[Register.GYRO_CONFIG_1], registers[Register.ACCEL_CONFIG]
        if gyro or not accel:
            rate = _RATE / (1 + registers[Register.GYRO_SMPLRT_DIV]) if rates & 1 else _UNFILTERED_GYRO
        else:
            divisor = (registers[Register.ACCEL_SMPLRT_DIV_1] & 0x0F) << 8 | registers[Register.ACCEL_SMPLRT_DIV_2]
            rate = _RATE / (1 + divisor) if accelerations & 1 else _UNFILTERED_ACCEL
        return Setting(
            gyro=gyro,
            accel=accel,
            rate=rate,
            gyro_bandwidth=_GYRO_BANDWIDTHS[rates >> 3 & 7 if rates & 1 else 8],
            accel_bandwidth=_ACCEL_BANDWIDTHS[accelerations >> 3 & 7 if accelerations & 1 else 8],
        )

    def _counts_per_unit(self) -> tuple[float, float]:
        per_g = _LSB_PER_G[self._registers[Register.ACCEL_CONFIG] >> 1 & 3]
        return per_g / _GRAVITY, _LSB_PER_DEGREE[self._registers[Register.GYRO_CONFIG_1] >> 1 & 3]

    def _packed_samples(self, first: int, ends_ns: NDArray[np.int64]) -> Samples:
        """Make samples with those numbers alone that go into the FIFO, where one of each sensor's does."""
        contents = self._contents()
        return self._samples(first, ends_ns, accel=min(contents) < 3, gyro=any(3 <= each < 6 for each in contents))

    def _temperatures(self, ends_ns: NDArray[np.int64], degrees: NDArray[np.float64]) -> NDArray[np.float64]:
        if self._registers[Register.PWR_MGMT_1] & _TEMP_DIS:
            return np.zeros(ends_ns.size)
        return super()._temperatures(ends_ns, degrees)

    def _contents(self) -> list[int]:
        """Return which numbers of a sample go into the FIFO."""
        asked = self._registers[Register.FIFO_EN_2]
        accel = [0, 1, 2] if asked & _ACCEL_TO_FIFO else []
        gyro = [3 + axis for axis in range(3) if asked & 2 << axis]
        return accel + gyro + ([6] if asked & _TEMP_TO_FIFO else [])

    def _packet_bytes(self) -> int:
        return max(1, 2 * len(self._contents()))

    def _packed(self, samples: Samples) -> bytes:
        return samples.outputs[:, self._contents()].astype(">i2").tobytes()

    def _look(self) -> FifoSetting:
        held = self._registers[Register.FIFO_RST] & _TO_FIFO
        on = self._registers[Register.USER_CTRL] & _FIFO_EN and self._contents()
        newest_go = bool(self._registers[Register.FIFO_MODE] & 1)
        return FifoSetting(active=bool(on and not held), newest_go=newest_go, watermark=0, every=False, sources=0)

    def _pins(self) -> int:
        shut = self._faults.now(BypassOff, self._clock.now_ns())
        return self._registers[Register.INT_PIN_CFG] & (~_BYPASS_EN if shut else 0xFF)

    def _overflowed(self) -> int:
        lost, self._lost = self._fifo.lost != self._lost, self._fifo.lost
        return int(lost)

    def _burst(self, register: int, count: int) -> bytes:
        """Take from the FIFO: a transfer stays at its data."""
        return self._sampler.take(count, resume=True) if register == Register.FIFO_R_W else b""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rates(RateTruth):
    """What the gyroscope's elements are; the white noise is that of the data sheet, 15 mdeg/s/sqrt(Hz) one-sided."""

    white: Annotated[tuple[float, float, float], vector(3, minimum=0)] = (1.06e-2,) * 3


def build(setup: PeerSetup) -> Package:
    """Build the sensor.

    Terminals `rate` (three axes, deg/s), `acceleration` (three axes, m/s2), `field` (three axes, uT), `temperature`
    (degC) and `power` (V) go to plant signals.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    die = Icm20948(Fitted.read(setup, Icm20948.sheet), Senses.read(setup, setup.truth.part(Rates)))
    magnetometer = Ak09916(Fitted.read(setup, Ak09916.sheet), FieldElement(setup, noise=(0.3, 0.3, 0.3)))
    setup.finish()
    return Package(die, magnetometer, way=die.require_bypass)


MODEL = PeerModel(
    link="bus", fault_kinds=(Asleep, BypassOff, Drifting, OtherIdentity, Saturated, Stuck, TemperatureRaw), build=build
)
"""The model for the driver `icm20948`."""
