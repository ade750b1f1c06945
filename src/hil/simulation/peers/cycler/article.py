"""What one simulated cycler is, and what its three inputs see."""

from __future__ import annotations

from dataclasses import dataclass

from hil.clock.port import NANOSECONDS
from hil.simulation.plants.terminal import SignalPoint
from hil.simulation.seeds import Stream

__all__ = ["LINE_S", "Article", "Gauge", "Reading"]

LINE_S = 5
"""Seconds of device time from one data line to the next."""

_LINE_NS = LINE_S * NANOSECONDS

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

    def read(self, line: int) -> int:
        """Return what is measured now, in units of the last digit; `line` counts the five seconds of the bench."""
        point = self.signal
        value = self.unconnected if point is None else point.plant.observe(point.name)
        if self.noise:
            return round(value * self.factor + self.shift + self.noise * self.stream.normal(line))
        return round(value * self.factor + self.shift)


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

    def measure(self, now_ns: int) -> Reading:
        """Return what the device measures now."""
        line = now_ns // _LINE_NS
        return self.voltage.read(line), self.current.read(line), self.temperature.read(line)
