"""TI INA226 power monitor on an I2C bus (data sheet SBOS547). Its registers have 16 bits, the high byte first."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from hil.clock.port import Clock
from hil.instruments import settings
from hil.instruments.marks import reads
from hil.instruments.sampled import Channel
from hil.instruments.sensors.registers import Registers
from hil.instruments.sensors.scale import Scale
from hil.instruments.sensors.sensor import Chip, Sensor, SensorDriver
from hil.model.bench import Wire
from hil.model.errors import Garbled, Rejected
from hil.model.figure import Figure
from hil.model.notation import measured

__all__ = ["Ina226", "Ina226Monitor", "Ina226Settings"]

_CONFIGURATION, _SHUNT, _BUS, _MASK, _DIE_ID = 0x00, 0x01, 0x02, 0x06, 0xFF
_READY, _CONTINUOUS, _POWER_DOWN = 1 << 3, 0b100_100_111, 0
_AVERAGES = {1.0: 0b000 << 9, 4.0: 0b001 << 9, 16.0: 0b010 << 9, 64.0: 0b011 << 9}
_CONVERSION_S = 2 * 1.1e-3
_POLLS = 8
_MARGIN_S = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Ina226Settings:
    """What a wire may set: conversions that are averaged, and the shunt [ohm]."""

    averages: Annotated[float, measured(choices=tuple(_AVERAGES))] = 16.0
    shunt: Annotated[float, measured("ohm", above=0.0)] = 0.1


class Ina226Monitor(Sensor):
    """One chip; fills the role `power_monitor`. A sample is one that was not read yet."""

    chip: ClassVar[Chip] = Chip(
        model="INA226",
        driver="ina226",
        role="power_monitor",
        identity=(_DIE_ID, 0x2260),
        identity_name="Die ID",
        strap="A0",
        width=2,
    )
    measures: ClassVar[tuple[Channel, ...]] = (Channel("voltage", "V"), Channel("current", "A"))

    def __init__(self, registers: Registers, clock: Clock, wire: Wire) -> None:
        super().__init__(registers, clock, wire)
        own = settings.read(wire, Ina226Settings)
        self._configuration = _AVERAGES[own.averages] | _CONTINUOUS
        self._cycle = own.averages * _CONVERSION_S
        self._volts = Scale(per_unit=800.0)
        self._amperes = Scale(per_unit=400_000.0 * own.shunt, rails=(-32768, 32767))

    @reads
    def voltage(self) -> Figure:
        """Return the next voltage in V."""
        return Figure(value=self.sample()[0], unit="V")

    @reads
    def current(self) -> Figure:
        """Return the next current in A."""
        return Figure(value=self.sample()[1], unit="A")

    def _wake(self) -> None:
        self._put(self._configuration)
        self._await_sample()

    def _sleep(self) -> None:
        self._put(_POWER_DOWN)

    def _sample(self) -> tuple[float, ...]:
        self._await_sample()
        shunt, bus = (int.from_bytes(self._registers.block(each, 2), "big", signed=True) for each in (_SHUNT, _BUS))
        if self.chip.name_of(self._registers) != self.chip.identity[1]:
            raise Garbled(self._device, "the chip forgot its name", "look at its power and its SDA wire")
        return self._volts.number(bus), self._amperes.number(shunt)

    def _put(self, configuration: int) -> None:
        self._registers.write(_CONFIGURATION, configuration)
        found = self._registers.read(_CONFIGURATION) & 0x0FFF
        if found != configuration:
            message = f"the configuration was set to {configuration:#06x} and reads back {found:#06x}"
            raise Rejected(self._device, message, "look at the chip's power and who else talks to it")

    def _await_sample(self) -> None:
        longest = 2.0 * self._cycle + _MARGIN_S
        fault = (f"no new sample within {longest:.3g} s", "look at its power, and start it again")
        self._wait_for(lambda: bool(self._registers.read(_MASK) & _READY), longest, self._cycle / _POLLS, fault)


class Ina226(SensorDriver):
    """Driver `ina226`: role `power_monitor`. A wire may set `averages` (1, 4, 16 or 64) and `shunt`."""

    roles: ClassVar[frozenset[str]] = frozenset({"power_monitor"})
    sensor: ClassVar[type[Sensor]] = Ina226Monitor
