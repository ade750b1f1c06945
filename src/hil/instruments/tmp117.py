"""TI TMP117 temperature sensor on an I2C bus (data sheet SNOSD82), with 16-bit registers, high byte first."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

from hil.clock.port import Clock
from hil.instruments import settings
from hil.instruments.sampled import Channel
from hil.instruments.sensors.registers import Registers
from hil.instruments.sensors.scale import Scale
from hil.instruments.sensors.sensor import Chip, Sensor, SensorDriver
from hil.model.bench import Wire
from hil.model.errors import Garbled, Rejected
from hil.model.notation import measured

__all__ = ["Tmp117", "Tmp117Settings", "Tmp117Thermometer"]

_TEMP_RESULT, _CONFIGURATION, _DEVICE_ID = 0x00, 0x01, 0x0F
_CONTINUOUS, _SHUTDOWN = 0b00 << 10, 0b01 << 10
_DATA_READY, _SETTINGS = 1 << 13, 0x0FFC
# Averaged conversions: the AVG bits, and the duration in s, which is the cycle time where CONV is 0.
_AVERAGES = {1.0: (0b00 << 5, 0.0155), 8.0: (0b01 << 5, 0.125), 32.0: (0b10 << 5, 0.5), 64.0: (0b11 << 5, 1.0)}
_RAILS = (-32768, 32767)  # the lower one is the register content until the first conversion ends
_LOWEST, _HIGHEST = -55.0, 150.0
_MARGIN_S = 0.1
_POLLS = 8
_HINT = "look at the sensor's power; after a power cut it has to be started again"


@dataclass(frozen=True, slots=True, kw_only=True)
class Tmp117Settings:
    """Wire settings: number of conversions averaged."""

    averages: Annotated[float, measured(choices=tuple(_AVERAGES))] = 8.0


class Tmp117Thermometer(Sensor):
    """One sensor; fills the role `thermometer`. Each sample is a new one."""

    chip: ClassVar[Chip] = Chip(
        model="TMP117",
        driver="tmp117",
        role="thermometer",
        identity=(_DEVICE_ID, 0x117),
        identity_name="DEVICE_ID",
        identity_mask=0x0FFF,
        strap="ADD0",
        addresses=(0x48, 0x49, 0x4A, 0x4B),
        width=2,
    )
    measures: ClassVar[tuple[Channel, ...]] = (Channel("temperature", "degC"),)

    def __init__(self, registers: Registers, clock: Clock, wire: Wire) -> None:
        super().__init__(registers, clock, wire)
        self._averages, self._cycle = _AVERAGES[settings.read(wire, Tmp117Settings).averages]
        self._scale = Scale(per_unit=128.0, rails=_RAILS)

    def _wake(self) -> None:
        self._put(_SHUTDOWN)
        self._put(_CONTINUOUS | self._averages)
        self._await_sample()

    def _sleep(self) -> None:
        self._put(_SHUTDOWN)

    def _sample(self) -> tuple[float, ...]:
        self._await_sample()
        counts = int.from_bytes(self._registers.block(_TEMP_RESULT, 2), "big", signed=True)
        if self.chip.name_of(self._registers) != self.chip.identity[1]:
            raise Garbled(self._device, "the sensor forgot its name", "look at its power and its SDA wire")
        celsius = self._scale.number(counts)
        return (celsius if _LOWEST <= celsius <= _HIGHEST else math.nan,)

    def _put(self, configuration: int) -> None:
        """Write the configuration and read it back, ignoring its flags."""
        self._registers.write(_CONFIGURATION, configuration)
        found = self._registers.read(_CONFIGURATION) & _SETTINGS
        if found != configuration:
            message = f"CONFIGURATION was set to {configuration:#06x} and reads back {found:#06x}"
            raise Rejected(self._device, message, "look at the sensor's power and who else talks to it")

    def _await_sample(self) -> None:
        longest = 2.0 * self._cycle + _MARGIN_S
        fault = (f"no new sample within {longest:.3g} s", _HINT)
        # Reading the configuration clears the flag, so it is read once per sample.
        self._wait_for(self._is_ready, longest, self._cycle / _POLLS, fault)

    def _is_ready(self) -> bool:
        return bool(self._registers.read(_CONFIGURATION) & _DATA_READY)


class Tmp117(SensorDriver):
    """Driver `tmp117`: role `thermometer`. A wire may set `averages` (1, 8, 32 or 64; 8 where it does not)."""

    roles: ClassVar[frozenset[str]] = frozenset({"thermometer"})
    sensor: ClassVar[type[Sensor]] = Tmp117Thermometer
