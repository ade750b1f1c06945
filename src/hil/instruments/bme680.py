"""Bosch BME680 on an I2C bus, as a reference thermometer: humidity, pressure and gas are not measured.

Registers and temperature compensation: data sheet BST-BME680-DS001, as implemented by public drivers (Bosch,
Pimoroni). Each unit has factory calibration coefficients, without which its raw counts mean nothing. The gas heater
would warm the thermometer, so it stays off.
"""

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
from hil.instruments.sensors.stillness import Stillness
from hil.model.bench import Wire
from hil.model.errors import Garbled
from hil.model.notation import measured

__all__ = ["Bme680", "Bme680Settings", "Bme680Thermometer", "Coefficients"]

_STATUS, _TEMPERATURE = 0x1D, 0x22
_GAS_0, _GAS_1, _HUMIDITY, _MEASURE, _CONFIG, _RESET = 0x70, 0x71, 0x72, 0x74, 0x75, 0xE0
_T1, _T2 = 0xE9, 0x8A  # the third follows the second
_NEW, _MEASURING = 0x80, 0x20
_HEATER_OFF, _FORCED, _SOFT_RESET = 0x08, 0x01, 0xB6
_RESET_S = 0.005
_NONE = 0x80000  # register content while the temperature measurement is skipped
_AVERAGES = {1.0: 1, 2.0: 2, 4.0: 3, 8.0: 4, 16.0: 5}
_FILTERS = {0.0: 0, 1.0: 1, 3.0: 2, 7.0: 3, 15.0: 4, 31.0: 5, 63.0: 6, 127.0: 7}
_CONVERSION_S, _OVERHEAD_S, _MARGIN_S = 0.001963, 0.0053, 0.05
_POLLS = 4
_LOWEST, _HIGHEST = -40.0, 85.0
_TYPICAL_NOISE = 10.0  # counts rms of one conversion at 16x oversampling


@dataclass(frozen=True, slots=True)
class Coefficients:
    """Factory calibration of one unit's thermometer: par_t1 to par_t3."""

    t1: int
    t2: int
    t3: int

    def celsius(self, counts: int) -> float:
        """Return the temperature in degC for a 20-bit reading, by the data sheet's floating-point formula."""
        first = (counts / 16384.0 - self.t1 / 1024.0) * self.t2
        second = (counts / 131072.0 - self.t1 / 8192.0) ** 2 * self.t3 * 16.0
        return (first + second) / 5120.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Bme680Settings:
    """Wire settings: number of conversions averaged, and the filter coefficient, 0 for no filter."""

    averages: Annotated[float, measured(choices=tuple(_AVERAGES))] = 16.0
    filter: Annotated[float, measured(choices=tuple(_FILTERS))] = 0.0


class Bme680Thermometer(Sensor):
    """One sensor in forced mode; fills the role `thermometer`. It measures on request, and sleeps in between."""

    chip: ClassVar[Chip] = Chip(
        model="BME680",
        driver="bme680",
        role="thermometer",
        identity=(0xD0, 0x61),
        identity_name="chip_id",
        strap="SDO",
        addresses=(0x76, 0x77),
    )
    measures: ClassVar[tuple[Channel, ...]] = (Channel("temperature", "degC"),)

    def __init__(self, registers: Registers, clock: Clock, wire: Wire) -> None:
        super().__init__(registers, clock, wire)
        own = settings.read(wire, Bme680Settings)
        self._measure = _AVERAGES[own.averages] << 5
        self._settings = {_GAS_0: _HEATER_OFF, _GAS_1: 0, _HUMIDITY: 0, _CONFIG: _FILTERS[own.filter] << 2}
        self._longest = own.averages * _CONVERSION_S + _OVERHEAD_S
        self._noise = _TYPICAL_NOISE * math.sqrt(16.0 / own.averages) if not own.filter else math.inf
        self._coefficients = Coefficients(0, 0, 0)
        self._stillness = Stillness(self._device, Scale(per_unit=1.0), self._noise)

    def _wake(self) -> None:
        """Reset the sensor, read its coefficients, configure it, read the settings back, and measure once."""
        self._registers.write(_RESET, _SOFT_RESET)
        self._clock.sleep(_RESET_S)
        self._coefficients = self._read_coefficients()
        self._registers.set(self._settings)
        self._registers.expect(self._settings)
        self._stillness = Stillness(self._device, Scale(per_unit=1.0), self._noise)
        self._sample()

    def _sleep(self) -> None:
        """Put the sensor to sleep, and read that back."""
        self._registers.set({_MEASURE: 0})
        self._registers.expect({_MEASURE: 0})

    def _sample(self) -> tuple[float, ...]:
        """Trigger one measurement, and wait for its result."""
        self._registers.write(_MEASURE, self._measure | _FORCED)
        self._clock.sleep(self._longest)  # until then the flag may be the previous measurement's
        longest = 2.0 * self._longest + _MARGIN_S
        fault = (f"no new sample within {longest:.3g} s", "look at its power; after a power cut start it again")
        self._wait_for(self._is_ready, longest, self._longest / _POLLS, fault)
        counts = int.from_bytes(self._registers.block(_TEMPERATURE, 3), "big") >> 4
        if self.chip.name_of(self._registers) != self.chip.identity[1]:
            raise Garbled(self._device, "the sensor forgot its name", "look at its power and its SDA wire")
        self._stillness.judge((counts,))
        celsius = self._coefficients.celsius(counts)
        return (celsius if counts != _NONE and _LOWEST <= celsius <= _HIGHEST else math.nan,)

    def _is_ready(self) -> bool:
        status = self._registers.read(_STATUS)
        return bool(status & _NEW) and not status & _MEASURING

    def _read_coefficients(self) -> Coefficients:
        """Read the coefficients twice: they have no checksum that would show a transfer error."""
        one, other = ((self._registers.block(_T1, 2), self._registers.block(_T2, 3)) for _ in range(2))
        first, rest = one
        found = Coefficients(
            int.from_bytes(first, "little"),
            int.from_bytes(rest[:2], "little", signed=True),
            int.from_bytes(rest[2:], "little", signed=True),
        )
        if one != other or not found.t1 or found.t2 <= 0 or first == b"\xff\xff":
            raise Garbled(
                self._device,
                f"its factory coefficients cannot be: {first.hex(' ')}, {rest.hex(' ')}",
                "look at its power and its wires; where that is right, replace it",
            )
        return found


class Bme680(SensorDriver):
    """Driver `bme680`: role `thermometer`. A wire may set `averages` (1 to 16) and `filter` (0 to 127)."""

    roles: ClassVar[frozenset[str]] = frozenset({"thermometer"})
    sensor: ClassVar[type[Sensor]] = Bme680Thermometer
