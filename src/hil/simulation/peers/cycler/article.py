"""What one simulated cycler is, and what its three inputs see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hil.clock.port import NANOSECONDS
from hil.simulation.plants.terminal import SignalPoint, observing
from hil.simulation.seeds import BLOCK, Stream

__all__ = ["LINE_S", "Article", "Gauge", "Reading"]

LINE_S = 5
"""Seconds of device time from one data line to the next."""

_LINE_NS = LINE_S * NANOSECONDS
_SILENCE = [0.0] * BLOCK

Reading = tuple[int, int, int]
"""Voltage in mV, current in mA, temperature in tenths of a degree Celsius: what a data line can show."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gauge:
    """One measured quantity: the plant's signal, and how wrongly this article reads it.

    Attributes:
        signal: what is measured; None is an open input.
        unconnected: what an open input reads.
        factor: units of the last written digit per unit, as this article has it.
        shift: what it reads too much, in units of the last digit.
        noise: standard deviation in units of the last digit.
        stream: numbers of that noise.
    """

    signal: SignalPoint | None
    unconnected: float
    factor: float
    shift: float
    noise: float
    stream: Stream

    def noises(self, block: int) -> list[float]:
        """Return what noise adds in a block of lines, in units of the last digit."""
        return [self.noise * number for number in self.stream.normals(block)] if self.noise else _SILENCE


@dataclass(frozen=True, slots=True, kw_only=True)
class Article:
    """What this cycler is.

    Attributes:
        extended: whether it speaks level 2.
        cycles: how many a test has, until somebody sets them.
        charge_end: current that ends a charge, in mA.
        discharge_end: voltage that ends a discharge, in mV.
        firmware: version as it says it.
        serial: serial number.
        resets_on_open: whether opening the port resets it.
        boot_ns: what the bootloader takes.
        voltage: its gauge, in mV.
        current: its gauge, in mA.
        temperature: its gauge, in tenths of a degree Celsius.
    """

    extended: bool
    cycles: int
    charge_end: int
    discharge_end: int
    firmware: str
    serial: str
    resets_on_open: bool
    boot_ns: int
    voltage: Gauge
    current: Gauge
    temperature: Gauge

    def measuring(self) -> Callable[[int], Reading]:
        """Return a function of the bench's time [ns], which is now: what the device measures.

        Its noise is by the five seconds of the bench.
        """
        voltage, current, temperature = gauges = self.voltage, self.current, self.temperature
        look = observing([gauge.signal for gauge in gauges], tuple(gauge.unconnected for gauge in gauges))
        per_volt, per_ampere, per_kelvin = (gauge.factor for gauge in gauges)
        more_volts, more_amperes, more_kelvins = (gauge.shift for gauge in gauges)
        known, noises = -1, (_SILENCE, _SILENCE, _SILENCE)

        def measure(now_ns: int) -> Reading:
            nonlocal known, noises
            block, place = divmod(now_ns // _LINE_NS, BLOCK)
            if block != known:
                known, noises = block, (voltage.noises(block), current.noises(block), temperature.noises(block))
            volts, amperes, celsius = look()
            noisy_volts, noisy_amperes, noisy_kelvins = noises
            return (
                round(volts * per_volt + more_volts + noisy_volts[place]),
                round(amperes * per_ampere + more_amperes + noisy_amperes[place]),
                round(celsius * per_kelvin + more_kelvins + noisy_kelvins[place]),
            )

        return measure
