"""Three-axis sensors: single samples, scaling and noise from the data sheet."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

from hil.clock.port import Clock
from hil.instruments.marks import reads
from hil.instruments.sampled import Channel
from hil.instruments.sensors.registers import Registers
from hil.instruments.sensors.scale import Scale
from hil.instruments.sensors.sensor import Sensor
from hil.instruments.sensors.stillness import Stillness
from hil.model.bench import Wire
from hil.model.errors import NoReply
from hil.model.figure import Figure

__all__ = ["Axes", "Field", "Sampling", "three_axes"]

_WARMED_S = 0.5


def three_axes(unit: str) -> tuple[Channel, ...]:
    """Return the channels x, y, z in a unit, and temperature."""
    return (*(Channel(axis, unit) for axis in "xyz"), Channel("temperature", "degC"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """Sampling configuration of a sensor.

    Attributes:
        rate: nominal sampling rate [Hz].
        axes: scale of the axes.
        temperature: scale of the temperature, to degC.
        order: byte order of the axes.
        temperature_order: byte order of the temperature, where it differs.
        full_scale: full scale of the range, in the unit of the axes.
        density: typical one-sided white-noise density, in the data sheet's unit per root Hz; infinite where no data
            sheet states it.
        bandwidth: noise bandwidth of the filter [Hz].
        awake: registers that distinguish a measuring sensor from one that lost its settings.
        line: interrupt line of the OBC to which the sensor's interrupt is wired.
    """

    rate: float
    axes: Scale
    temperature: Scale
    order: Literal["big", "little"]
    temperature_order: Literal["", "big", "little"] = ""
    full_scale: float
    density: float
    bandwidth: float
    awake: Mapping[int, int]
    line: int = 0

    @property
    def period(self) -> float:
        """Nominal sampling period in s."""
        return 1.0 / self.rate

    @property
    def noise(self) -> float:
        """Typical noise of an axis in counts rms."""
        return self.density * math.sqrt(self.bandwidth) * self.axes.per_unit

    def temperature_counts(self, data: bytes) -> int:
        """Return the temperature counts in two bytes."""
        return int.from_bytes(data, self.temperature_order or self.order, signed=True)

    def celsius(self, data: bytes) -> float:
        """Return the temperature in degC from two bytes; NaN where they are marked invalid."""
        return self.temperature.number(self.temperature_counts(data))


class Axes(Sensor):
    """Three-axis sensor; fills the role `gyroscope`, `accelerometer` or `magnetometer` of its chip.

    The chip's class defines `_wake`, `_sleep` and these attributes.

    Attributes:
        measures: the channels, from `three_axes`.
        axes_at: first register of the three 16-bit axes.
        temperature_at: register of the 16-bit temperature.
        temperature_on_other: whether that register is on the chip's other die.
        together: whether temperature and axes can be read in one transfer.
        invalid: counts that mark an invalid reading, None where there are none.

    Args:
        registers: the chip's registers.
        clock: the bench's clock.
        wire: the wire with the settings.
        sampling: the resulting sampling configuration.
    """

    axes_at: ClassVar[int]
    temperature_at: ClassVar[int]
    temperature_on_other: ClassVar[bool] = False
    together: ClassVar[bool] = False
    invalid: ClassVar[int | None] = None

    def __init__(self, registers: Registers, clock: Clock, wire: Wire, sampling: Sampling) -> None:
        super().__init__(registers, clock, wire)
        self._sampling = sampling
        self._judged = 0.0
        self._reset_stillness()

    @reads
    def temperature(self) -> Figure:
        """Return the die temperature in degC; its uncertainty is unknown.

        Raises:
            NoReply: no acknowledge, or a reading marked invalid: the sensor sleeps.
        """
        self._require_running()
        temperature = self._sampling.celsius(self._temperature_bytes())
        if math.isnan(temperature):
            raise NoReply(
                self._device, "its temperature is marked invalid, it sleeps", "check its power, and start it again"
            )
        return Figure(value=temperature, unit="degC")

    @reads
    def bandwidth(self) -> Figure:
        """Return the filter's noise bandwidth in Hz."""
        return Figure(value=self._sampling.bandwidth, unit="Hz")

    @reads
    def resolution(self) -> Figure:
        """Return the resolution of the selected range, one count, in the unit of the axes."""
        return Figure(value=self._sampling.axes.resolution, unit=self.measures[0].unit)

    @reads
    def full_scale(self) -> Figure:
        """Return the full scale of the selected range, in the unit of the axes."""
        return Figure(value=self._sampling.full_scale, unit=self.measures[0].unit)

    def _sample(self) -> tuple[float, ...]:
        """Read temperature and axes; samples at least one period apart must differ."""
        temperature, counts = self._read_outputs()
        now = self._clock.now()
        if now - self._judged >= self._sampling.period:
            self._judged = now
            self._stillness.judge(counts)
        return (*(self._sampling.axes.number(axis) for axis in counts), self._sampling.temperature.number(temperature))

    def _wait_until_valid(self, longest: float, since: str) -> None:
        """Wait until temperature and axes are valid; `since` names the preceding action, for the message."""

        def valid() -> bool:
            temperature, counts = self._read_outputs()
            return self._sampling.temperature.usable(temperature) and self.invalid not in counts

        self._reset_stillness()
        self._wait_for(valid, longest, self._sampling.period, (f"no valid data {since}", "check the sensor's power"))

    @property
    def _patience(self) -> float:
        """Correlation length of the noise in samples."""
        return max(1.0, self._sampling.rate / (2.0 * self._sampling.bandwidth))

    def _reset_stillness(self) -> None:
        """Discard the stillness statistics from before a start."""
        self._stillness = Stillness(self._device, self._sampling.axes, self._sampling.noise, self._patience)
        self._judged = 0.0

    def _read_outputs(self) -> tuple[int, tuple[int, ...]]:
        """Return the counts of temperature and axes, read in one transfer where the chip allows it."""
        if self.together:
            first, last = min(self.axes_at, self.temperature_at), max(self.axes_at + 6, self.temperature_at + 2)
            data = self._registers.block(first, last - first)
            axes, temperature = data[self.axes_at - first :], data[self.temperature_at - first :]
        else:
            axes, temperature = self._registers.block(self.axes_at, 6), self._temperature_bytes()
        counts = tuple(int.from_bytes(axes[at : at + 2], self._sampling.order, signed=True) for at in range(0, 6, 2))
        return self._sampling.temperature_counts(temperature[:2]), counts

    def _temperature_bytes(self) -> bytes:
        """Read the two bytes of the temperature."""
        die = self._registers.other if self.temperature_on_other else None
        return (die or self._registers).block(self.temperature_at, 2)


class Field(Sensor):
    """A magnetometer without a filter; the chip's class reads the samples.

    Args:
        registers: the chip's registers.
        clock: the bench's clock.
        wire: the wire with the settings.
        rate: sampling rate [Hz].
        axes: scale from counts to uT.
        full_scale: full scale of the range [uT].
        noise: typical noise in counts rms, see `Stillness`.
    """

    measures: ClassVar[tuple[Channel, ...]] = three_axes("uT")

    def __init__(
        self,
        registers: Registers,
        clock: Clock,
        wire: Wire,
        *,
        rate: float,
        axes: Scale,
        full_scale: float,
        noise: float = math.inf,
    ) -> None:
        super().__init__(registers, clock, wire)
        self._rate, self._axes, self._full_scale, self._noise = rate, axes, full_scale, noise
        self._celsius, self._warming = math.nan, 0.0
        self._reset_stillness()

    @reads
    def bandwidth(self) -> Figure:
        """Return half the sampling rate in Hz: the noise of the samples is independent."""
        return Figure(value=self._rate / 2.0, unit="Hz")

    @reads
    def resolution(self) -> Figure:
        """Return the resolution of the selected range, one count, in uT."""
        return Figure(value=self._axes.resolution, unit="uT")

    @reads
    def full_scale(self) -> Figure:
        """Return the full scale of the selected range in uT."""
        return Figure(value=self._full_scale, unit="uT")

    def _reset_stillness(self) -> None:
        """Discard the stillness statistics from before a start."""
        self._stillness = Stillness(self._device, self._axes, self._noise)
        self._warmed = -math.inf

    def _die_temperature(self) -> float:
        """Return the die temperature in degC, read at most twice a second: a die does not change faster.

        When it is not read, the time that a read takes passes all the same, so that sample spacing stays uniform.
        """
        now = self._clock.now()
        if not self._registers.sparing or now - self._warmed >= _WARMED_S:
            self._celsius, self._warmed = self._read_die_temperature(), now
            self._warming = self._clock.now() - now
        else:
            self._clock.sleep(self._warming)
        return self._celsius

    @abstractmethod
    def _read_die_temperature(self) -> float:
        """Read the temperature in degC."""
