"""What one simulated cycler is, and what its three inputs see."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated

from hil.analysis.noise.numbers import BLOCK, RandomStream
from hil.clock.port import NANOSECONDS
from hil.model.notation import Flag, NotNegative, Number, matching, number, one_of, whole
from hil.simulation.faults import Fault
from hil.simulation.plants.terminal import SignalPoint, observing

__all__ = ["LINE_S", "CyclerTruth", "Gauge", "Make", "Reading", "Spike"]

LINE_S = 5
"""Seconds of device time from one data line to the next."""

_LINE_NS = LINE_S * NANOSECONDS
_LARGEST_DRIFT = 0.01
_Gain = Annotated[float, number(0.5, 2)]

Reading = tuple[int, int, int]
"""Voltage in mV, current in mA, temperature in tenths of a degree Celsius: what a data line can show."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Spike(Fault):
    """The voltage that is measured has some more."""

    name = "spike"

    volts: Number = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class CyclerTruth:
    """One device.

    Attributes:
        level: of the protocol that it speaks.
        clock_drift: of its crystal, relative.
        boots: starts so far.
        cycles: how many a test has, until somebody sets them.
        charge_end: current that ends a charge [A].
        discharge_end: voltage that ends a discharge [V].
        firmware, serial: what it says of itself.
        reset_on_open: whether opening the port resets it.
        boot_time: what the bootloader takes [s].
        voltage_gain, voltage_offset, voltage_noise: of its gauge of the voltage [1, V, V rms]; those of current [A] and
            temperature [degC] likewise.
    """

    level: Annotated[str, one_of("1", "2")] = "2"
    clock_drift: Annotated[float, number(-_LARGEST_DRIFT, _LARGEST_DRIFT)] = 0.0
    boots: Annotated[int, whole(0, 2**31)] = 41
    cycles: Annotated[int, whole(1, 9999)] = 10
    charge_end: Annotated[float, number(0.005, 1)] = 0.05
    discharge_end: Annotated[float, number(2.5, 3.6)] = 2.7
    firmware: Annotated[str, matching(r"\d{1,3}\.\d{1,3}\.\d{1,3}", "a version such as '1.0.0'")] = "1.0.0"
    serial: Annotated[str, matching("[A-Z0-9]{1,8}", "up to eight capital letters and digits")] = "C0001"
    reset_on_open: Flag = True
    boot_time: Annotated[float, number(0.05, 10)] = 1.6
    voltage_gain: _Gain = 1.0
    voltage_offset: Number = 0.0
    voltage_noise: NotNegative = 0.0
    current_gain: _Gain = 1.0
    current_offset: Number = 0.0
    current_noise: NotNegative = 0.0
    temperature_gain: _Gain = 1.0
    temperature_offset: Number = 0.0
    temperature_noise: NotNegative = 0.0

    @property
    def marked_firmware(self) -> str:
        """What it says of its firmware, as long as the version: that it is simulated."""
        return f"SIM{self.firmware[3:]}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Gauge:
    """One measured quantity: the plant's signal, and how wrongly this device reads it.

    Attributes:
        signal: what is measured; None is an open input.
        unconnected: what an open input reads.
        factor: units of the last written digit per unit, as this device has it.
        shift: what it reads too much, in units of the last digit.
        noise: standard deviation in units of the last digit.
        stream: numbers of that noise.
    """

    signal: SignalPoint | None
    unconnected: float
    factor: float
    shift: float
    noise: float
    stream: RandomStream

    def wrong(self, block: int) -> list[float]:
        """Return what it reads too much in each line of a block, shift and noise, in units of the last digit."""
        if not self.noise:
            return [self.shift] * BLOCK
        return [self.shift + self.noise * number for number in self.stream.normals(block)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Make:
    """What this cycler is.

    Attributes:
        truth: what the bench file says of it.
        voltage: its gauge, in mV.
        current: its gauge, in mA.
        temperature: its gauge, in tenths of a degree Celsius.
        spikes: faults that add to the voltage what they say, while they hold.
    """

    truth: CyclerTruth
    voltage: Gauge
    current: Gauge
    temperature: Gauge
    spikes: tuple[Spike, ...] = ()

    @property
    def extended(self) -> bool:
        """Whether it speaks level 2."""
        return self.truth.level == "2"

    def measuring(self) -> Callable[[Sequence[int]], list[Reading]]:
        """Return a function of the bench's times [ns], the first of which is now: what the device will measure then.

        It may tell of the first ones alone. Its noise is by the five seconds of the bench.
        """
        gauges = self.voltage, self.current, self.temperature
        look = observing([gauge.signal for gauge in gauges], tuple(gauge.unconnected for gauge in gauges))
        per_volt, per_ampere, per_kelvin = (gauge.factor for gauge in gauges)
        known, wrong = -1, [(0.0, 0.0, 0.0)]

        def measure(times_ns: Sequence[int]) -> list[Reading]:
            nonlocal known, wrong
            readings = []
            for time_ns, (volts, amperes, celsius) in zip(times_ns, look(times_ns), strict=False):
                number = time_ns // _LINE_NS
                if number // BLOCK != known:
                    known = number // BLOCK
                    wrong = list(zip(*(gauge.wrong(known) for gauge in gauges), strict=True))
                more_volts, more_amperes, more_kelvins = wrong[number % BLOCK]
                readings.append(
                    (
                        round(volts * per_volt + more_volts),
                        round(amperes * per_ampere + more_amperes),
                        round(celsius * per_kelvin + more_kelvins),
                    )
                )
            return readings

        return _spiked(measure, self.spikes) if self.spikes else measure


def _spiked(
    measure: Callable[[Sequence[int]], list[Reading]], spikes: Sequence[Spike]
) -> Callable[[Sequence[int]], list[Reading]]:
    def spiked(times_ns: Sequence[int]) -> list[Reading]:
        return [
            (volts + round(1000 * sum(spike.volts for spike in spikes if spike.holds(time_ns))), amperes, degrees)
            for time_ns, (volts, amperes, degrees) in zip(times_ns, measure(times_ns), strict=False)
        ]

    return spiked
