"""Base classes of sensors and their drivers; a chip's class adds its data sheet and its peculiarities."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

from hil.clock.port import Clock
from hil.instruments import settings
from hil.instruments.driver import Connection, Outlet, Strap
from hil.instruments.marks import drives, reads
from hil.instruments.sampled import Channel
from hil.instruments.sensors.registers import Banks, Registers
from hil.model.bench import Wire
from hil.model.errors import Garbled, NoReply, Refused, WrongIdentity
from hil.model.figure import Figure
from hil.model.identity import Identity

__all__ = ["Chip", "DieThermometer", "Sensor", "SensorDriver"]

_MARGIN_S = 0.1
_POLLS_PER_SAMPLE = 8
_NAMED_S = 2.0  # interval of the ID checks that detect corrupted bits on the bus, which has no checksum
_RESTART = "check the sensor's power; after a power cut it has to be started again"


@dataclass(frozen=True, slots=True, kw_only=True)
class Chip:
    """Identity of a chip, and access to its registers.

    Attributes:
        model: its name in the data sheet.
        driver: the driver's name in bench files.
        role: the role that it fills.
        identity: the ID register and its expected content.
        identity_name: that register's name in the data sheet.
        identity_mask: mask of the bits that identify the type.
        strap: the pin that selects the address, empty where the address is fixed.
        addresses: the selectable addresses, the usual one first; empty where unknown.
        second: whether its registers are at the instrument's second address, as those of a second die are.
        hidden: whether the chip answers only once the first die has been configured.
        increment, width, order, banks: see `Registers`.
    """

    model: str
    driver: str
    role: str
    identity: tuple[int, int]
    identity_name: str = "WHO_AM_I"
    identity_mask: int = 0xFFFF
    strap: str
    addresses: tuple[int, ...] = ()
    second: bool = False
    hidden: bool = False
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
        second = connection.second_address or (self.addresses[0] if self.addresses else 0)
        return Registers(
            connection.device,
            connection.bus,
            second if self.second else connection.address,
            increment=self.increment,
            width=self.width,
            order=self.order,
            banks=self.banks,
            sparing=connection.sparing,
        )

    def name_of(self, registers: Registers) -> int:
        """Read the chip's type from its ID register."""
        return registers.read(self.identity[0]) & self.identity_mask


class Sensor(ABC):
    """One sensor with its wire's settings. A chip's class defines `_wake`, `_sleep` and `_sample`.

    Attributes:
        chip: the die that it is on.
        measures: the channels of a sample.
        names_asked: whether its ID is re-read between samples.
        beside: every wired sensor of the same chip, by role, itself included.

    Args:
        registers: the chip's registers.
        clock: the bench's clock.
        wire: the wire with the settings.
    """

    chip: ClassVar[Chip]
    measures: ClassVar[tuple[Channel, ...]]

    def __init__(self, registers: Registers, clock: Clock, wire: Wire) -> None:
        del wire
        self._registers = registers
        self._device = registers.device
        self._clock = clock
        self._running = False
        self._sampled = self._pause = self._named = 0.0
        self.beside: Mapping[str, Sensor] = {}
        self.names_asked = True

    @drives
    def start(self) -> None:
        """Apply the wiring's settings, read them back, and wait for the first valid sample.

        Raises:
            WrongIdentity: another device answers at this address.
            Rejected: a setting reads back differently.
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
        """Return the channels of a sample."""
        return self.measures

    @reads
    def sample(self) -> tuple[float, ...]:
        """Return a sample; NaN for a channel at a rail, beyond its range, or marked invalid.

        Raises:
            NoReply: no acknowledge, no new sample, or the same sample repeatedly.
            Garbled: the reading is impossible.
        """
        self._require_running()
        began = self._clock.now()
        sample = self._sample()
        pause, before, self._sampled = began - self._sampled, self._pause, began
        self._pause = pause
        if pause > 2.0 * before:  # first of a series, which must not lag more than the others
            self._named = began
        else:
            self._recheck_id()
        return sample

    @reads
    def temperature(self) -> Figure:
        """Return the temperature of the next sample in degC.

        Raises:
            Refused: the chip does not measure temperature.
            NoReply, Garbled: see `sample`.
        """
        for place, channel in enumerate(self.measures):
            if channel.name == "temperature":
                return Figure(value=self.sample()[place], unit=channel.unit)
        raise Refused(f"{self._device}: the {self.chip.model} measures no temperature", "wire a thermometer")

    @property
    def running(self) -> bool:
        """Whether it has been started, and not stopped since."""
        return self._running

    @abstractmethod
    def _wake(self) -> None:
        """Configure everything from a known state, read it back, and wait for the first valid sample."""

    @abstractmethod
    def _sleep(self) -> None:
        """Stop measuring, and read that back."""

    @abstractmethod
    def _sample(self) -> tuple[float, ...]:
        """Return one sample of a started sensor."""

    def _others_run(self) -> bool:
        """Return whether another sensor of the chip is running, on either die."""
        return any(each.running for each in self.beside.values() if each is not self)

    def _identify(self) -> None:
        self._require_id(self._registers, self.chip)

    def _recheck_id(self) -> None:
        """Check the ID every two seconds: corrupted bits are obvious in an ID, but not in a sample."""
        if not self.names_asked or self._clock.now() - self._named < _NAMED_S:
            return
        name, known = self.chip.name_of(self._registers), self.chip.identity[1]
        if name != known:
            raise Garbled(
                self._device,
                f"{self.chip.identity_name} reads {name:#04x} beside samples, the {self.chip.model} has {known:#04x}",
                "check its wires and its power, and record again: samples from before may be wrong as well",
            )
        self._named = self._clock.now()

    def _require_id(self, registers: Registers, chip: Chip) -> None:
        """Refuse a die with another ID; one that was left in another bank is read a second time."""
        name, known = chip.name_of(registers), chip.identity[1]
        if name != known and registers.bank_lost():
            name = chip.name_of(registers)
        if name != known:
            raise WrongIdentity(
                self._device,
                f"{chip.identity_name} is {name:#04x}, the {chip.model} has {known:#04x}",
                f"compare the address in the bench file with the board's {chip.strap or 'own'} strap",
            )

    def _wait_for(self, ready: Callable[[], bool], longest: float, poll: float, fault: tuple[str, str]) -> None:
        """Poll every `poll` seconds until `ready`; NoReply with this text and hint after `longest` seconds."""
        deadline = self._clock.now() + longest
        while not ready():
            if self._clock.now() >= deadline:
                raise NoReply(self._device, *fault)
            self._clock.sleep(poll)

    def _await_new(self, is_new: Callable[[], bool], rate: float) -> None:
        """Wait for a new sample, for two sampling periods at `rate` [Hz] and a margin; NoReply after that."""
        longest = 2.0 / rate + _MARGIN_S
        fault = (f"no new sample within {longest:.3g} s at {rate:g} Hz", _RESTART)
        self._wait_for(is_new, longest, 1.0 / (rate * _POLLS_PER_SAMPLE), fault)

    def _require_running(self) -> None:
        if not self._running:
            raise Refused(f"{self._device} has not been started", "call start() before the first sample")


class DieThermometer:
    """The die temperature of another sensor's chip; fills the role `thermometer`.

    Args:
        sensor: returns the sensor, with its own role's settings, or this wire's if it is wired only as a thermometer.
    """

    def __init__(self, sensor: Callable[[], Sensor]) -> None:
        self._sensor = sensor

    @drives
    def start(self) -> None:
        """Start the sensor, unless it is running."""
        if not self._sensor().running:
            self._sensor().start()

    @drives
    def stop(self) -> None:
        """Put the sensor to sleep, even if another role started it."""
        self._sensor().stop()

    @reads
    def temperature(self) -> Figure:
        """Return the die temperature in degC."""
        return self._sensor().temperature()

    def channels(self) -> tuple[Channel, ...]:
        """Return the temperature channel."""
        return (Channel("temperature", "degC"),)

    @reads
    def sample(self) -> tuple[float, ...]:
        """Return a sample of the die temperature in degC."""
        return (self.temperature().value,)


class SensorDriver:
    """Base driver of one chip: each of its sensors fills a role, and its die `thermometer` where `roles` says so.

    Sensors on one die share its registers. A chip of two dies has two addresses: the second die's is the bench file's
    `second_address`, or the usual one; the registers of each die refer to the other's.

    Attributes:
        roles: the roles that it fills.
        sensor: class of the first sensor.
        others: classes of the other sensors, each with its own role.
    """

    roles: ClassVar[frozenset[str]]
    sensor: ClassVar[type[Sensor]]
    others: ClassVar[tuple[type[Sensor], ...]] = ()

    def __init__(self, connection: Connection) -> None:
        self._dies = {chip.second: chip.registers(connection) for chip in self._chips()}
        for second, registers in self._dies.items():
            registers.other = self._dies.get(not second)
        self._clock = connection.clock
        self._names_asked = connection.names_asked
        self._sensors: dict[str, Sensor] = {}
        self._set: set[str] = set()

    @classmethod
    def straps(cls) -> tuple[Strap, ...]:
        """Return how each die's address is selected, the first die's first."""
        return tuple(Strap(chip.strap, chip.addresses) for chip in cls._chips())

    def identify(self) -> Identity:
        """Read the ID register of every die that already answers; there is no serial number."""
        for chip in self._chips():
            name = 0 if chip.hidden else chip.name_of(self._dies[chip.second])
            if not chip.hidden and name != chip.identity[1]:
                return Identity(model=f"{chip.identity_name} {name:#04x}")
        return Identity(model=self.sensor.chip.model)

    def outlets(self) -> Sequence[Outlet]:
        """Return an empty list: a sensor has no outputs."""
        return ()

    def role(self, wire: Wire) -> Sensor | DieThermometer:
        """Return the sensor of the wire's role with its settings, or the chip's thermometer."""
        settings.fits(wire, self.sensor.chip.driver, self.roles)
        kinds = {kind.chip.role: kind for kind in (self.sensor, *self.others)}
        kind = kinds.get(wire.role, self.sensor)
        self._set.update({wire.role} if wire.settings else ())
        own = [role for role in kinds if role in {*self._sensors, wire.role}]
        if own and self._set - kinds.keys():
            raise Refused(f"{wire.name}: the settings of this chip are those of its role {own[0]}", "move them there")
        self._sensors[wire.role] = sensor = kind(self._dies[kind.chip.second], self._clock, wire)
        sensor.beside, sensor.names_asked = self._sensors, self._names_asked
        return sensor if wire.role in kinds else DieThermometer(lambda: self._measuring(kinds, sensor))

    def _measuring(self, roles: Iterable[str], alone: Sensor) -> Sensor:
        """Return the sensor that a thermometer reads: a running one, else the first wired one, else its own."""
        wired = [self._sensors[role] for role in roles if role in self._sensors]
        return next((sensor for sensor in wired if sensor.running), wired[0] if wired else alone)

    @classmethod
    def _chips(cls) -> tuple[Chip, ...]:
        """Return the `Chip` of each die, the first die's first."""
        dies = {kind.chip.second: kind.chip for kind in (*cls.others, cls.sensor)}
        return tuple(dies[second] for second in sorted(dies))
