"""A gyroscope with a FIFO: single samples, and what its data sheet says of its numbers."""

from __future__ import annotations

import math
from typing import ClassVar

from hil.clock.port import Clock
from hil.instruments.marks import reads
from hil.instruments.sampled import Channel
from hil.instruments.sensors.recorder import FifoSensor, Sampling
from hil.instruments.sensors.registers import Registers
from hil.instruments.sensors.stillness import Stillness
from hil.model.bench import Wire
from hil.model.errors import NoReply
from hil.model.figure import Figure

__all__ = ["FifoGyroscope"]


class FifoGyroscope(FifoSensor):
    """One gyroscope; fills the role `gyroscope`. Its chip's class defines `_wake` and `_sleep`, and names these.

    Attributes:
        outputs: the first register that is read for a sample, and how many bytes from there on.
        rates_at: place of the first of three rates in these bytes; the temperature is at their beginning.

    Args:
        registers: of the chip.
        clock: the bench's clock.
        wire: whose settings it reads.
        sampling: what they come to.
        full_scale: the largest rate of the range in deg/s.
        bandwidth: noise bandwidth of the filter in Hz.
    """

    measures: ClassVar[tuple[Channel, ...]] = (*(Channel(a, "deg/s") for a in "xyz"), Channel("temperature", "degC"))
    outputs: ClassVar[tuple[int, int]]
    rates_at: ClassVar[int]

    def __init__(
        self,
        registers: Registers,
        clock: Clock,
        wire: Wire,
        sampling: Sampling,
        *,
        full_scale: float,
        bandwidth: float,
    ) -> None:
        super().__init__(registers, clock, wire, sampling)
        self._full_scale = full_scale
        self._bandwidth = bandwidth
        self._stillness = Stillness(self._device, sampling.axes, sampling.noise)
        self._judged = 0.0

    @reads
    def temperature(self) -> Figure:
        """Return the temperature of the sensor's die in degC; its uncertainty is not known.

        Raises:
            NoReply: no acknowledge, or a number that is marked invalid: it sleeps.
        """
        self._require_running()
        temperature = self._sampling.celsius(self._registers.block(self.outputs[0], 2))
        if math.isnan(temperature):
            raise NoReply(
                self._device, "its temperature is marked invalid, it sleeps", "check its power, and start it again"
            )
        return Figure(value=temperature, unit="degC")

    @reads
    def bandwidth(self) -> Figure:
        """Return the noise bandwidth of the filter in Hz."""
        return Figure(value=self._bandwidth, unit="Hz")

    @reads
    def resolution(self) -> Figure:
        """Return one count of the chosen range in deg/s."""
        return Figure(value=self._sampling.axes.resolution, unit="deg/s")

    @reads
    def full_scale(self) -> Figure:
        """Return the largest rate of the chosen range in deg/s."""
        return Figure(value=self._full_scale, unit="deg/s")

    def _sample(self) -> tuple[float, ...]:
        """Read temperature and rates in one transfer; samples at least a period apart must differ."""
        temperature, counts = self._read_outputs()
        now = self._clock.now()
        if now - self._judged >= self._sampling.period:
            self._judged = now
            self._stillness.judge(counts)
        return (*(self._sampling.axes.number(axis) for axis in counts), self._sampling.temperature.number(temperature))

    def _wait_until_valid(self, longest: float, since: str) -> None:
        """Wait until temperature and rates are valid; `since` says what has been done before, for the message."""

        def valid() -> bool:
            temperature, counts = self._read_outputs()
            lowest = self._sampling.temperature.rails[0]
            return min(temperature, *counts) > lowest

        self._stillness = Stillness(self._device, self._sampling.axes, self._sampling.noise)
        self._judged = 0.0
        self._wait_for(valid, longest, self._sampling.period, (f"no valid data {since}", "check the sensor's power"))

    def _read_outputs(self) -> tuple[int, tuple[int, ...]]:
        """Return the counts of the temperature and of the rates."""
        data = self._registers.block(*self.outputs)
        places = (0, *range(self.rates_at, self.rates_at + 6, 2))
        temperature, *rates = (int.from_bytes(data[at : at + 2], self._sampling.order, signed=True) for at in places)
        return temperature, tuple(rates)
