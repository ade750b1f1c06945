"""A sensor and its driver: a chip's class says what its data sheet says, and what is peculiar to it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

from hil.clock.port import Clock
from hil.instruments import settings
from hil.instruments.driver import Connection, Outlet
from hil.instruments.marks import drives, reads
from hil.instruments.sampled import Channel
from hil.instruments.sensors.registers import Banks, Registers
from hil.model.bench import Wire
from hil.model.errors import NoReply, Refused, WrongIdentity
from hil.model.figure import Figure
from hil.model.identity import Identity

__all__ = ["Chip", "DieThermometer", "Sensor", "SensorDriver"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Chip:
    """What identifies a chip, and how its registers are reached.

    Attributes:
        model: its name, as on the data sheet.
        driver: the driver's name in bench files.
        role: the role that it fills.
        identity: the register that names the type, and what it holds.
        identity_name: that register's name on the data sheet.
        identity_mask: bits of that register that name the type.
        strap: the pin that sets the address.
        increment, width, order, banks: see `Registers`.
    """

    model: str
    driver: str
    role: str
    identity: tuple[int, int]
    identity_name: str = "WHO_AM_I"
    identity_mask: int = 0xFFFF
    strap: str
    increment: int = 0
    width: int = 1
    order: Literal["big", "little"] = "big"
    banks: Banks | None = None

    def registers(self, connection: Connection) -> Registers:
        """Return the chip's registers; Refused where the connection is not a bus."""
        if connection.bus is None:
            raise Refused(
                f"{connection.device}: the driver {self.driver} needs an I2C bus", "give it `bus:` and `address:`"
            )
        return Registers(
            connection.device,
            connection.bus,
            connection.address,
            increment=self.increment,
            width=self.width,
            order=self.order,
            banks=self.banks,
        )

    def name_of(self, registers: Registers) -> int:
        """Return what the chip at these registers calls its type."""
        return registers.read(self.identity[0]) & self.identity_mask


class Sensor(ABC):
    """One sensor, set as its wire says. A chip's class defines `_wake`, `_sleep` and `_sample`.

    Args:
        registers: of the chip.
        clock: the bench's clock.
        wire: whose settings it reads.
    """

    chip: ClassVar[Chip]
    measures: ClassVar[tuple[Channel, ...]]

    def __init__(self, registers: Registers, clock: Clock, wire: Wire) -> None:
        del wire
        self._registers = registers
        self._device = registers.device
        self._clock = clock
        self._running = False

    @drives
    def start(self) -> None:
        """Set the sensor as the wiring says, read the settings back, and wait for its first valid sample.

        Raises:
            WrongIdentity: another device answers at this address.
            Rejected: a setting reads back otherwise.
            NoReply: no acknowledge, or no valid sample in time.
        """
        self._running = False
        self._identify()
        self._wake()
        self._running = True

    @drives
    def stop(self) -> None:
        """Put the sensor to sleep and read that back."""
        self._running = False
        self._sleep()

    def channels(self) -> tuple[Channel, ...]:
        """Return what a sample consists of."""
        return self.measures

    @reads
    def sample(self) -> tuple[float, ...]:
        """Return a sample, NaN for a channel at its rail, beyond its range, or marked invalid.

        Raises:
            NoReply: no acknowledge, no sample, or the same sample again and again.
            Garbled: what was read cannot be.
        """
        self._require_running()
        return self._sample()

    @reads
    def temperature(self) -> Figure:
        """Return the temperature of the next sample in degC.

        Raises:
            Refused: the chip does not measure it.
            NoReply, Garbled: see `sample`.
        """
        for place, channel in enumerate(self.measures):
            if channel.name == "temperature":
                return Figure(value=self.sample()[place], unit=channel.unit)
        raise Refused(f"{self._device}: the {self.chip.model} measures no temperature", "wire a thermometer")

    @property
    def running(self) -> bool:
        """Whether it was started, and not stopped since."""
        return self._running

    @abstractmethod
    def _wake(self) -> None:
        """Set everything from a known state, read it back, and wait for the first valid sample."""

    @abstractmethod
    def _sleep(self) -> None:
        """Stop measuring, and read that back."""

    @abstractmethod
    def _sample(self) -> tuple[float, ...]:
        """Return one sample of a sensor that was started."""

    def _identify(self) -> None:
        name, known = self.chip.name_of(self._registers), self.chip.identity[1]
        if name != known and self._registers.bank_lost():
            name = self.chip.name_of(self._registers)
        if name != known:
            raise WrongIdentity(
                self._device,
                f"{self.chip.identity_name} is {name:#04x}, the {self.chip.model} has {known:#04x}",
                f"compare the address in the bench file with the board's {self.chip.strap} strap",
            )

    def _wait_for(self, ready: Callable[[], bool], longest: float, poll: float, fault: tuple[str, str]) -> None:
        """Ask until it is ready, every `poll` seconds; NoReply with this text and hint after `longest`."""
        deadline = self._clock.now() + longest
        while not ready():
            if self._clock.now() >= deadline:
                raise NoReply(self._device, *fault)
            self._clock.sleep(poll)

    def _require_running(self) -> None:
        if not self._running:
            raise Refused(f"{self._device} has not been started", "call start() before the first sample")


class DieThermometer:
    """The temperature of a chip that is there for something else; fills the role `thermometer`.

    Args:
        sensor: returns the chip, as its own role sets it; where it is wired as a thermometer alone, as this wire does.
    """

    def __init__(self, sensor: Callable[[], Sensor]) -> None:
        self._sensor = sensor

    @drives
    def start(self) -> None:
        """Start the sensor, unless it runs."""
        if not self._sensor().running:
            self._sensor().start()

    @drives
    def stop(self) -> None:
        """Put the sensor to sleep, whoever started it."""
        self._sensor().stop()

    @reads
    def temperature(self) -> Figure:
        """Return the temperature of the chip in degC."""
        return self._sensor().temperature()

    def channels(self) -> tuple[Channel, ...]:
        """Return the temperature."""
        return (Channel("temperature", "degC"),)

    @reads
    def sample(self) -> tuple[float, ...]:
        """Return the temperature of the chip."""
        return (self.temperature().value,)


class SensorDriver:
    """A driver for one sensor, which fills the role of its chip; and `thermometer`, where `roles` says so.

    A chip's driver names `roles` and the class `sensor`.
    """

    roles: ClassVar[frozenset[str]]
    sensor: ClassVar[type[Sensor]]

    def __init__(self, connection: Connection) -> None:
        self._registers = self.sensor.chip.registers(connection)
        self._clock = connection.clock
        self._sensors: dict[str, Sensor] = {}
        self._set: set[str] = set()

    def identify(self) -> Identity:
        """Read the register that names the type; nothing names the article."""
        chip = self.sensor.chip
        name = chip.name_of(self._registers)
        return Identity(model=chip.model if name == chip.identity[1] else f"{chip.identity_name} {name:#04x}")

    def outlets(self) -> Sequence[Outlet]:
        """Return nothing: a sensor has no outputs."""
        return ()

    def role(self, wire: Wire) -> Sensor | DieThermometer:
        """Return the sensor, set as the wire says; or its temperature."""
        own = self.sensor.chip.role
        settings.fits(wire, self.sensor.chip.driver, self.roles)
        self._sensors[wire.role] = sensor = self.sensor(self._registers, self._clock, wire)
        self._set.update({wire.role} if wire.settings else ())
        if own in self._sensors and self._set - {own}:
            raise Refused(f"{wire.name}: the settings of this chip are those of its role {own}", "move them there")
        return sensor if wire.role == own else DieThermometer(lambda: self._sensors.get(own, sensor))
