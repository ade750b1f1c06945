"""A sensor with three axes: single samples, and what its data sheet says of its numbers."""

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
    """Return the channels of three axes in a unit, and of the temperature."""
    return (*(Channel(axis, unit) for axis in "xyz"), Channel("temperature", "degC"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """How a sensor has been set to sample.

    Attributes:
        rate: nominal samples per second.
        axes: how counts of the axes become quantities.
        temperature: how counts of the temperature become degC.
        order: which byte of a number comes first.
        temperature_order: which byte of the temperature comes first, where that is another one.
        full_scale: the largest number of the range, in the unit of the axes.
        density: white noise of a typical article, one-sided, in the data sheet's unit over the root of Hz; infinite
            where no data sheet tells it.
        bandwidth: noise bandwidth of the filter in Hz.
        awake: registers that tell a sensor which measures from one that lost its settings.
        line: interrupt line of the OBC at which the sensor's interrupt ends.
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
        """Nominal seconds from sample to sample."""
        return 1.0 / self.rate

    @property
    def noise(self) -> float:
        """Standard deviation in counts that a typical article shows on an axis."""
        return self.density * math.sqrt(self.bandwidth) * self.axes.per_unit

    def temperature_counts(self, data: bytes) -> int:
        """Return the counts in two bytes of the temperature."""
        return int.from_bytes(data, self.temperature_order or self.order, signed=True)

    def celsius(self, data: bytes) -> float:
        """Return the temperature in degC of two bytes; NaN where they are marked invalid."""
        return self.temperature.number(self.temperature_counts(data))


class Axes(Sensor):
    """Three axes; fills the role `gyroscope`, `accelerometer` or `magnetometer` of its chip.

    Its chip's class defines `_wake` and `_sleep`, and names these.

    Attributes:
        measures: made by `three_axes`.
        axes_at: register of the first of three numbers of two bytes.
        temperature_at: register of the temperature, two bytes.
        temperature_on_other: whether that is on the chip's other die.
        together: whether temperature and axes can be read in one transfer.
        invalid: counts that stand for no number at all, None where there are none.

    Args:
        registers: of the chip.
        clock: the bench's clock.
        wire: whose settings it reads.
        sampling: what they come to.
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
        self._rejudge()

    @reads
    def temperature(self) -> Figure:
        """Return the temperature of the sensor's die in degC; its uncertainty is not known.

        Raises:
            NoReply: no acknowledge, or a number that is marked invalid: it sleeps.
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
        """Return the noise bandwidth of the filter in Hz."""
        return Figure(value=self._sampling.bandwidth, unit="Hz")

    @reads
    def resolution(self) -> Figure:
        """Return one count of the chosen range, in the unit of the axes."""
        return Figure(value=self._sampling.axes.resolution, unit=self.measures[0].unit)

    @reads
    def full_scale(self) -> Figure:
        """Return the largest number of the chosen range, in the unit of the axes."""
        return Figure(value=self._sampling.full_scale, unit=self.measures[0].unit)

    def _sample(self) -> tuple[float, ...]:
        """Read temperature and axes; samples at least a period apart must differ."""
        temperature, counts = self._read_outputs()
        now = self._clock.now()
        if now - self._judged >= self._sampling.period:
            self._judged = now
            self._stillness.judge(counts)
        return (*(self._sampling.axes.number(axis) for axis in counts), self._sampling.temperature.number(temperature))

    def _wait_until_valid(self, longest: float, since: str) -> None:
        """Wait until temperature and axes are valid; `since` says what has been done before, for the message."""

        def valid() -> bool:
            temperature, counts = self._read_outputs()
            return self._sampling.temperature.usable(temperature) and self.invalid not in counts

        self._rejudge()
        self._wait_for(valid, longest, self._sampling.period, (f"no valid data {since}", "check the sensor's power"))

    @property
    def _patience(self) -> float:
        """Over how many samples the noise is one and the same."""
        return max(1.0, self._sampling.rate / (2.0 * self._sampling.bandwidth))

    def _rejudge(self) -> None:
        """Forget the samples from before a start."""
        self._stillness = Stillness(self._device, self._sampling.axes, self._sampling.noise, self._patience)
        self._judged = 0.0

    def _read_outputs(self) -> tuple[int, tuple[int, ...]]:
        """Return the counts of the temperature and of the axes, read in one transfer where the chip allows it."""
        if self.together:
            first, last = min(self.axes_at, self.temperature_at), max(self.axes_at + 6, self.temperature_at + 2)
            data = self._registers.block(first, last - first)
            axes, temperature = data[self.axes_at - first :], data[self.temperature_at - first :]
        else:
            axes, temperature = self._registers.block(self.axes_at, 6), self._temperature_bytes()
        counts = tuple(int.from_bytes(axes[at : at + 2], self._sampling.order, signed=True) for at in range(0, 6, 2))
        return self._sampling.temperature_counts(temperature[:2]), counts

    def _temperature_bytes(self) -> bytes:
        """Return the two bytes of the temperature."""
        die = self._registers.other if self.temperature_on_other else None
        return (die or self._registers).block(self.temperature_at, 2)


class Field(Sensor):
    """A magnetometer without a filter; its chip's class says how a sample is read.

    Args:
        registers: of the chip.
        clock: the bench's clock.
        wire: whose settings it has.
        rate: of its measurements [Hz].
        axes: how counts become uT.
        full_scale: the largest field of the range [uT].
        noise: standard deviation in counts that a typical article shows, see `Stillness`.
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
        self._rejudge()

    @reads
    def bandwidth(self) -> Figure:
        """Return half the rate in Hz: each of its measurements has noise of its own."""
        return Figure(value=self._rate / 2.0, unit="Hz")

    @reads
    def resolution(self) -> Figure:
        """Return one count of the chosen range in uT."""
        return Figure(value=self._axes.resolution, unit="uT")

    @reads
    def full_scale(self) -> Figure:
        """Return the largest field of the chosen range in uT."""
        return Figure(value=self._full_scale, unit="uT")

    def _rejudge(self) -> None:
        """Forget the samples from before a start."""
        self._stillness = Stillness(self._device, self._axes, self._noise)
        self._warmed = -math.inf

    def _warmth(self) -> float:
        """Return the temperature in degC, which is read twice a second at most: a die has no quicker ones.

        Where it is not read, the time that it takes passes, so that samples are as far apart as they are taken.
        """
        now = self._clock.now()
        if not self._registers.sparing or now - self._warmed >= _WARMED_S:
            self._celsius, self._warmed = self._read_warmth(), now
            self._warming = self._clock.now() - now
        else:
            self._clock.sleep(self._warming)
        return self._celsius

    @abstractmethod
    def _read_warmth(self) -> float:
        """Read the temperature in degC."""
