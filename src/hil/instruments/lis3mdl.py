"""ST LIS3MDL three-axis magnetometer on an I2C bus.

Registers and their meaning: LIS3MDL data sheet (DocID024204) and AN4602. Two traps are avoided.
A block read that starts at the X axis rolls over from the Z axis back to X, so the temperature is
read by itself; and its zero is at 25 degC, 8 counts per degree (AN4602).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from hil.clock.port import Clock
from hil.instruments import settings
from hil.instruments.driver import Connection, Outlet
from hil.instruments.i2c_registers import I2cRegisters
from hil.instruments.marks import drives, reads
from hil.instruments.roles import Magnetometer
from hil.instruments.sampled import Channel
from hil.model.bench import Wire
from hil.model.errors import Garbled, NoReply, Refused, Rejected, WrongIdentity
from hil.model.identity import Identity
from hil.wire.port import I2cBus

__all__ = ["Lis3mdl", "Lis3mdlMagnetometer"]

_WHO_AM_I, _ITS_NAME = 0x0F, 0x3D
_CTRL_REG1, _CTRL_REG2, _CTRL_REG3, _CTRL_REG4, _CTRL_REG5 = range(0x20, 0x25)
_STATUS_REG = 0x27
_OUT_X_L = 0x28
_TEMP_OUT_L = 0x2E
_AUTO_INCREMENT = 0x80  # in the register's number

_TEMPERATURE_ON = 1 << 7
_ULTRA_HIGH_XY = 0b11 << 5
_FAST_RATE = 1 << 1
_ULTRA_HIGH_Z = 0b11 << 2
_BLOCK_DATA_UPDATE = 1 << 6
_CONTINUOUS, _POWER_DOWN = 0b00, 0b11
_NEW_XYZ = 1 << 3

# Range in gauss: (full-scale bits, counts per gauss).
_RANGES = {4.0: (0b00, 6842.0), 8.0: (0b01, 3421.0), 12.0: (0b10, 2281.0), 16.0: (0b11, 1711.0)}
# Rate in Hz: bits of CTRL_REG1; 155 Hz is the fast rate of the ultra-high performance mode.
_RATES = {0.625 * 2**code: code << 2 for code in range(8)} | {155.0: _FAST_RATE}
_MICROTESLA_PER_GAUSS = 100.0
_RAILS = (-32768, 32767)
_MARGIN_S = 0.1
_POLLS_PER_SAMPLE = 8
# At 16 gauss the noise is 5 counts rms on each axis: three axes repeat once in 10,000 samples.
_MOST_EQUAL_SAMPLES = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class _Mode:
    """What a wire asks for: rate in Hz and range in gauss."""

    rate: float
    full_scale: float

    @property
    def registers(self) -> bytes:
        """CTRL_REG1 to CTRL_REG5."""
        return bytes(
            (
                _TEMPERATURE_ON | _ULTRA_HIGH_XY | _RATES[self.rate],
                _RANGES[self.full_scale][0] << 5,
                _CONTINUOUS,
                _ULTRA_HIGH_Z,
                _BLOCK_DATA_UPDATE,
            )
        )

    def field(self, raw: int) -> float:
        """Return the field in uT; NaN at the converter's rail or beyond full scale."""
        gauss = raw / _RANGES[self.full_scale][1]
        if raw in _RAILS or abs(gauss) > self.full_scale:
            return math.nan
        return gauss * _MICROTESLA_PER_GAUSS


class Lis3mdlMagnetometer:
    """One sensor; fills the role `magnetometer`.

    An axis at the converter's rail or beyond the chosen full scale is NaN, which no check passes: the
    true field is larger than the number, by an unknown amount. A sensor that gives the same numbers again
    and again does not measure: noise moves the last bits of one that does.

    Args:
        device: the sensor's name, for messages.
        bus: its bus.
        address: its 7-bit address.
        clock: the bench's clock.
        mode: rate and range.
    """

    def __init__(self, *, device: str, bus: I2cBus, address: int, clock: Clock, mode: _Mode) -> None:
        self._registers = I2cRegisters(device, bus, address)
        self._device = device
        self._clock = clock
        self._mode = mode
        self._running = False
        self._newest = b""
        self._equal = 0

    @drives
    def start(self) -> None:
        """Set range and rate from power-down, read the settings back, and wait for the first new sample.

        Raises:
            WrongIdentity: another device answers at this address.
            Rejected: a setting reads back otherwise.
            NoReply: no acknowledge, or no sample within two periods and a margin.
        """
        self._running = False
        name = self._registers.read(_WHO_AM_I)
        if name != _ITS_NAME:
            raise WrongIdentity(
                self._device,
                f"WHO_AM_I is {name:#04x}, a LIS3MDL says {_ITS_NAME:#04x}",
                "compare the address in the bench file with the board's SA1 strap",
            )
        wanted = self._mode.registers
        self._registers.write(_CTRL_REG3, _POWER_DOWN)
        for register in (_CTRL_REG1, _CTRL_REG2, _CTRL_REG4, _CTRL_REG5):
            self._registers.write(register, wanted[register - _CTRL_REG1])
        self._registers.block(_OUT_X_L | _AUTO_INCREMENT, 6)  # takes away the flag of a sample from before
        self._registers.write(_CTRL_REG3, _CONTINUOUS)
        self._expect(_CTRL_REG1, wanted)
        self._await_sample()
        self._newest, self._equal = b"", 0
        self._running = True

    @drives
    def stop(self) -> None:
        """Put the sensor into power-down and read it back."""
        self._running = False
        self._registers.write(_CTRL_REG3, _POWER_DOWN)
        self._expect(_CTRL_REG3, bytes((_POWER_DOWN,)))

    def channels(self) -> tuple[Channel, ...]:
        """Return x, y, z in uT and temperature in degC."""
        return (Channel("x", "uT"), Channel("y", "uT"), Channel("z", "uT"), Channel("temperature", "degC"))

    @reads
    def sample(self) -> tuple[float, ...]:
        """Wait for a sample that was not read yet, and return it.

        Raises:
            NoReply: no new sample within two periods and a margin: the sensor lost its settings, or is
                gone; or sixteen samples in a row were equal.
            Garbled: nothing but ones is read, and the sensor does not know its name any more.
        """
        if not self._running:
            raise Refused(f"{self._device} has not been started", "call start() before the first sample")
        self._await_sample()
        data = self._registers.block(_OUT_X_L | _AUTO_INCREMENT, 6)
        temperature = self._registers.block(_TEMP_OUT_L | _AUTO_INCREMENT, 2)
        if set(data + temperature) == {0xFF} and self._registers.read(_WHO_AM_I) != _ITS_NAME:
            raise Garbled(self._device, "the bus reads nothing but ones", "look at the sensor's power and its SDA wire")
        counts = struct.unpack("<hhh", data)
        self._must_move(data, saturated=all(raw in _RAILS for raw in counts))
        axes = tuple(self._mode.field(raw) for raw in counts)
        return (*axes, 25.0 + struct.unpack("<h", temperature)[0] / 8.0)

    def _must_move(self, data: bytes, *, saturated: bool) -> None:
        self._equal = self._equal + 1 if data == self._newest and not saturated else 1
        self._newest = data
        if self._equal >= _MOST_EQUAL_SAMPLES:
            raise NoReply(
                self._device,
                f"{self._equal} samples in a row are equal, the sensor stands still",
                "switch the sensor off and on, and start it again",
            )

    def _await_sample(self) -> None:
        longest = 2.0 / self._mode.rate + _MARGIN_S
        deadline = self._clock.now() + longest
        while not self._registers.read(_STATUS_REG) & _NEW_XYZ:
            if self._clock.now() >= deadline:
                raise NoReply(
                    self._device,
                    f"no new sample within {longest:.3g} s at {self._mode.rate:g} Hz",
                    "look at the sensor's power; after a power cut it has to be started again",
                )
            self._clock.sleep(1.0 / (self._mode.rate * _POLLS_PER_SAMPLE))

    def _expect(self, register: int, wanted: bytes) -> None:
        found = self._registers.block(register | _AUTO_INCREMENT, len(wanted))
        if found != wanted:
            raise Rejected(
                self._device,
                f"registers from {register:#04x} on were set to {wanted.hex(' ')} and read back {found.hex(' ')}",
                "look at the sensor's power and who else talks to it",
            )


class Lis3mdl:
    """Driver `lis3mdl`: role `magnetometer`.

    A wire may set `range` (4, 8, 12 or 16 gauss; 4 where it does not) and `rate` (0.625, 1.25, 2.5, 5,
    10, 20, 40, 80 or 155 Hz; 80 where it does not).
    """

    roles: ClassVar[frozenset[str]] = frozenset({"magnetometer"})

    def __init__(self, connection: Connection) -> None:
        if connection.bus is None:
            raise Refused(f"{connection.device}: a lis3mdl is reached by an I2C bus", "give it `bus:` and `address:`")
        self._bus = connection.bus
        self._connection = connection

    def identify(self) -> Identity:
        """Read WHO_AM_I; it names the type, and nothing names the article."""
        device, address = self._connection.device, self._connection.address
        name = I2cRegisters(device, self._bus, address).read(_WHO_AM_I)
        return Identity(model="LIS3MDL" if name == _ITS_NAME else f"WHO_AM_I {name:#04x}")

    def outlets(self) -> Sequence[Outlet]:
        """Return nothing: a sensor has no outputs."""
        return ()

    def role(self, wire: Wire) -> Magnetometer:
        """Return the sensor at the wire's range and rate."""
        if wire.role not in self.roles:
            raise Refused(f"wiring {wire.name}: a lis3mdl is no {wire.role}", "it fills the role magnetometer")
        if wire.channel:
            raise Refused(f"wiring {wire.name}: a lis3mdl has no channels", "leave `channel` out")
        settings.only(wire, "range", "rate")
        mode = _Mode(
            rate=settings.choice(wire, "rate", "Hz", tuple(_RATES), 80.0),
            full_scale=settings.choice(wire, "range", "gauss", tuple(_RANGES), 4.0),
        )
        return Lis3mdlMagnetometer(
            device=self._connection.device,
            bus=self._bus,
            address=self._connection.address,
            clock=self._connection.clock,
            mode=mode,
        )
