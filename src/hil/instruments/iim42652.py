"""TDK InvenSense IIM-42652 gyroscope on an I2C bus, of the host or of an OBC.

Registers, ranges and rates: the vendor's header Ixm42xxxDefs.h (InvenSenseInc/public.mcu.iim42652) and Linux
inv_icm42600. Filter bandwidths: the family's data sheets (GYRO_ACCEL_CONFIG0 of the ICM-42688-P): half the rate, or the
larger of 400 Hz and the rate over 4, 5, 8, 10, 16, 20 or 40.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, ClassVar

import numpy as np

from hil.clock.port import Clock
from hil.instruments import settings
from hil.instruments.sampled import Channel
from hil.instruments.sensors.axes import Sampling, three_axes
from hil.instruments.sensors.fifo import Fifo, Packets
from hil.instruments.sensors.recorder import FifoSensor
from hil.instruments.sensors.registers import Banks, Registers
from hil.instruments.sensors.scale import Scale
from hil.instruments.sensors.sensor import Chip, Sensor, SensorDriver
from hil.model.bench import Wire
from hil.model.errors import Rejected
from hil.model.notation import measured, whole

__all__ = ["CELSIUS", "FIFO", "Iim42652", "Iim42652Gyroscope", "Iim42652Settings"]


class Register(IntEnum):
    """Registers of bank 0."""

    DEVICE_CONFIG = 0x11
    INT_CONFIG = 0x14
    FIFO_CONFIG = 0x16
    TEMP_DATA = 0x1D
    GYRO_DATA = 0x25
    INT_STATUS = 0x2D
    FIFO_COUNT = 0x2E
    FIFO_DATA = 0x30
    SIGNAL_PATH_RESET = 0x4B
    INTF_CONFIG0 = 0x4C
    PWR_MGMT0 = 0x4E
    GYRO_CONFIG0 = 0x4F
    GYRO_CONFIG1 = 0x51
    GYRO_ACCEL_CONFIG0 = 0x52
    FIFO_CONFIG1 = 0x5F
    FIFO_CONFIG2 = 0x60
    FIFO_CONFIG3 = 0x61
    INT_CONFIG1 = 0x64
    INT_SOURCE0 = 0x65
    FIFO_LOST_PKT = 0x6C
    WHO_AM_I = 0x75
    REG_BANK_SEL = 0x76


# Range in deg/s: (code, counts per deg/s).
_RANGES = {
    2000.0: (0, 16.4),
    1000.0: (1, 32.8),
    500.0: (2, 65.5),
    250.0: (3, 131.0),
    125.0: (4, 262.0),
    62.5: (5, 524.3),
    31.25: (6, 1048.6),
    15.625: (7, 2097.2),
}
# Rate in Hz: code. The chip has faster ones, but the bus cannot carry them.
_RATES = {12.5: 11, 25.0: 10, 50.0: 9, 100.0: 8, 200.0: 7, 500.0: 15, 1000.0: 6}
_DIVISORS = (4, 5, 8, 10, 16, 20, 40)  # codes 1 to 7
_ORDER = 3
_THIRD_ORDER = 0x1A  # with the decimation filter's bits at their reset value
_ACCEL_FILTER = 1 << 4  # as after reset
_BIG_ENDIAN_COUNTED_IN_BYTES = 0x30
_NOISE_DENSITY = 0.0038  # deg/s/sqrt(Hz), one-sided, typical
_MOST_LINE = 255
_INVALID, _RAIL = -32768, 32767
_GYRO_ON = 0b11 << 2  # low-noise mode, the accelerometer off
_SOFT_RESET = 1
_RESET_DONE = 1 << 4
_RESET_S = 0.002  # 1 ms
_START_UP_S = 0.06
_LONGEST_START_S = 0.5  # after less than 150 ms off, start-up takes up to that much longer

CELSIUS = Scale(per_unit=132.48, zero=25.0, rails=(-8612, 10599))
"""Die temperature; the chip is rated from -40 to 105 degC."""

_PACKET = np.dtype([("header", "u1"), ("gyro", ">i2", (3,)), ("temperature", "i1")])
# Header, bit 7: the FIFO is empty; 6: accelerometer; 5: gyroscope; 4: 20 bits. The others concern clocks.
_EMPTY = 0x80
_KIND = 0xF0
_GYROSCOPE_ALONE = 0x20
_GYRO_AND_TEMPERATURE = 1 << 1 | 1 << 2
_PULSES_UP_PUSH_PULL = 0b011
_WATERMARK_ON_INT1 = 1 << 2
_STREAM_TO_FIFO = 0b01 << 6
_FLUSH = 1 << 1


def _prepared(watermark: int) -> Mapping[int, int]:
    level = watermark * _PACKET.itemsize
    return {
        Register.FIFO_CONFIG1: _GYRO_AND_TEMPERATURE,
        Register.FIFO_CONFIG2: level & 0xFF,
        Register.FIFO_CONFIG3: level >> 8,
        Register.INT_CONFIG: _PULSES_UP_PUSH_PULL,
    }


def _filling(interrupt: bool) -> Mapping[int, int]:
    return {Register.INT_SOURCE0: _WATERMARK_ON_INT1 if interrupt else 0, Register.FIFO_CONFIG: _STREAM_TO_FIFO}


def _decoded(data: bytes) -> Packets:
    """Decode gyroscope-only packets, up to the first one marked empty."""
    packets = np.frombuffer(data, _PACKET)
    headers = packets["header"]
    if len(headers) and headers.max() >= _EMPTY:
        packets = packets[: int(np.argmax(headers >= _EMPTY))]
        headers = packets["header"]
    return Packets(packets["gyro"].astype(np.int16), (headers & _KIND) == _GYROSCOPE_ALONE)


FIFO = Fifo(
    size=2048,
    packet=_PACKET.itemsize,
    count=Register.FIFO_COUNT,
    data=Register.FIFO_DATA,
    lost=Register.FIFO_LOST_PKT,
    temperature=Register.TEMP_DATA,
    prepare=_prepared,
    flush=(Register.SIGNAL_PATH_RESET, _FLUSH),
    fill=_filling,
    off={Register.INT_SOURCE0: 0, Register.FIFO_CONFIG: 0},
    decode=_decoded,
)
"""Packets of 8 bytes: header, three axes with the high byte first, 8-bit temperature."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Iim42652Settings:
    """Wire settings.

    Attributes:
        range: [deg/s].
        rate: sampling rate [Hz].
        bandwidth: -3 dB bandwidth [Hz], None for half the rate.
        line: interrupt line of the OBC to which INT1 is wired.
    """

    range: Annotated[float, measured("deg/s", choices=tuple(_RANGES))] = 125.0
    rate: Annotated[float, measured("Hz", choices=tuple(_RATES))] = 100.0
    bandwidth: Annotated[float | None, measured("Hz")] = None
    line: Annotated[int, whole(0, _MOST_LINE)] = 0


class Iim42652Gyroscope(FifoSensor):
    """The gyroscope, with the accelerometer off; readings marked invalid, as while it is off, are NaN."""

    chip: ClassVar[Chip] = Chip(
        model="IIM-42652",
        driver="iim42652",
        role="gyroscope",
        identity=(Register.WHO_AM_I, 0x6F),
        strap="AD0",
        addresses=(0x68, 0x69),
        banks=Banks(register=Register.REG_BANK_SEL, most=4),
    )
    measures: ClassVar[tuple[Channel, ...]] = three_axes("deg/s")
    fifo: ClassVar[Fifo] = FIFO
    axes_at: ClassVar[int] = Register.GYRO_DATA
    temperature_at: ClassVar[int] = Register.TEMP_DATA
    together: ClassVar[bool] = True  # with the accelerometer between them
    invalid: ClassVar[int | None] = _INVALID

    def __init__(self, registers: Registers, clock: Clock, wire: Wire) -> None:
        own = settings.read(wire, Iim42652Settings)
        rate = own.rate
        cut_off = rate / 2 if own.bandwidth is None else own.bandwidth
        if cut_off not in _filters(rate):
            known = ", ".join(f"{each:g}" for each in sorted(_filters(rate)))
            raise settings.wrong(wire, "bandwidth", f"must be one of {known} Hz at {rate:g} Hz")
        code, sensitivity = _RANGES[own.range]
        self._settings: dict[int, int] = {
            Register.INTF_CONFIG0: _BIG_ENDIAN_COUNTED_IN_BYTES,
            Register.GYRO_CONFIG0: code << 5 | _RATES[rate],
            Register.GYRO_CONFIG1: _THIRD_ORDER,
            Register.GYRO_ACCEL_CONFIG0: _ACCEL_FILTER | _filters(rate)[cut_off],
            Register.INT_CONFIG1: 0,  # INT_ASYNC_RESET must be cleared for the interrupt pin to work
            Register.PWR_MGMT0: _GYRO_ON,
        }
        angle = math.pi / (2 * _ORDER)  # a Butterworth filter's noise bandwidth exceeds -3 dB by angle / sin(angle)
        sampling = Sampling(
            rate=rate,
            axes=Scale(per_unit=sensitivity, rails=(-_RAIL, _RAIL)),
            temperature=CELSIUS,
            order="big",
            full_scale=own.range,
            density=_NOISE_DENSITY,
            bandwidth=cut_off * angle / math.sin(angle),
            awake={Register.PWR_MGMT0: _GYRO_ON},
            line=own.line,
        )
        super().__init__(registers, clock, wire, sampling)

    def _wake(self) -> None:
        """Reset and configure the sensor, switch the gyroscope on, read all back, and wait for valid data."""
        self._registers.write(Register.DEVICE_CONFIG, _SOFT_RESET)
        self._clock.sleep(_RESET_S)
        if not self._registers.read(Register.INT_STATUS) & _RESET_DONE:
            raise Rejected(self._device, "it does not report that its reset is done", "check the sensor's power")
        self._registers.set(self._settings)
        self._clock.sleep(_START_UP_S)
        self._registers.expect(self._settings)
        waited = _START_UP_S + _LONGEST_START_S
        self._wait_until_valid(_LONGEST_START_S, f"{waited:.2f} s after the gyroscope was switched on")

    def _sleep(self) -> None:
        """Switch the gyroscope off and read it back."""
        self._registers.put({Register.PWR_MGMT0: 0})


class Iim42652(SensorDriver):
    """Driver `iim42652`: role `gyroscope`, over a bus of the host or of an OBC.

    A wire may set `range` (deg/s), `rate` (Hz), `bandwidth` (-3 dB, Hz), and `line`, the OBC line wired to INT1.
    """

    roles: ClassVar[frozenset[str]] = frozenset({"gyroscope", "thermometer"})
    sensor: ClassVar[type[Sensor]] = Iim42652Gyroscope


def _filters(rate: float) -> dict[float, int]:
    """Return the filter code of each -3 dB bandwidth in Hz; half the rate has a code of its own."""
    wide = {max(400.0, rate) / divisor: code for code, divisor in enumerate(_DIVISORS, 1)}
    return wide | {rate / 2: 0}
