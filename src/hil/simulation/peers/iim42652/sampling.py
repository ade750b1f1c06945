"""When the simulated IIM-42652 samples, and through which filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import pi, sin
from typing import Self, cast

import numpy as np
from numpy.typing import NDArray

from hil.clock.port import NANOSECONDS
from hil.simulation.peers.iim42652.registers import Register, RegisterFile

__all__ = ["Sampling"]

_RATES = {
    3: 8000.0,
    4: 4000.0,
    5: 2000.0,
    6: 1000.0,
    7: 200.0,
    8: 100.0,
    9: 50.0,
    10: 25.0,
    11: 12.5,
    12: 6.25,
    13: 3.125,
    14: 1.5625,
    15: 500.0,
}
_DEFAULT_RATE = 1000.0
_SLOWEST_GYRO = 12.5
_DIVISORS = {1: 4, 2: 5, 3: 8, 4: 10, 5: 16, 6: 20, 7: 40}
_LEAST_FILTERED_RATE = 400.0
_LOW_NOISE, _LOW_POWER = 3, 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """What the registers ask for, and when it began; sample n, counted from 1, ends n periods after the start.

    Attributes:
        gyro, accel: which of them is on; none of them is sleep.
        rate: of samples, by the sensor's own oscillator [Hz].
        bandwidth: noise bandwidth of the gyroscope's filter [Hz].
        start_ns: when samples began to be counted.
        valid_ns: from when on the gyroscope's numbers are valid.
    """

    gyro: bool = False
    accel: bool = False
    rate: float = _DEFAULT_RATE
    bandwidth: float = _DEFAULT_RATE / 2
    start_ns: int = 0
    valid_ns: int = 0

    @classmethod
    def from_registers(cls, registers: RegisterFile, odr_error: float) -> Self:
        """Read the registers; samples come at the gyroscope's rate, and at the accelerometer's where that is alone."""
        power = registers[Register.PWR_MGMT0]
        gyro, accel = power >> 2 & 3 == _LOW_NOISE, power & 3 in {_LOW_NOISE, _LOW_POWER}
        source = Register.GYRO_CONFIG0 if gyro or not accel else Register.ACCEL_CONFIG0
        rate = _RATES.get(registers[source] & 0x0F, _DEFAULT_RATE)
        if gyro:
            rate = max(rate, _SLOWEST_GYRO)
        order = min(registers[Register.GYRO_CONFIG1] >> 2 & 3, 2) + 1
        bandwidth = _cut_off(rate, registers[Register.GYRO_ACCEL_CONFIG0] & 0x0F) * _noise_factor(order)
        return cls(gyro=gyro, accel=accel, rate=rate * (1 + odr_error), bandwidth=bandwidth)

    @property
    def running(self) -> bool:
        """Whether there are samples at all."""
        return self.gyro or self.accel

    def alike(self, other: Sampling) -> bool:
        """Return whether another one differs in its instants only."""
        mine = (self.gyro, self.accel, self.rate, self.bandwidth)
        return mine == (other.gyro, other.accel, other.rate, other.bandwidth)

    def count(self, now_ns: int) -> int:
        """Return how many samples have ended."""
        if not self.running:
            return 0
        number = int((now_ns - self.start_ns) * self.rate / NANOSECONDS) + 1
        while self.end_ns(number) > now_ns:
            number -= 1
        return number

    def end_ns(self, number: int) -> int:
        """Return when a sample ends."""
        return self.start_ns + round(number * (NANOSECONDS / self.rate))

    def ends_ns(self, first: int, count: int) -> NDArray[np.int64]:
        """Return when `count` samples from `first` on end, shape (count,)."""
        numbers = np.arange(first, first + count, dtype=np.float64)
        return self.start_ns + np.rint(numbers * (NANOSECONDS / self.rate)).astype(np.int64)

    def state(self) -> Mapping[str, object]:
        """Return it as JSON values."""
        return asdict(self)

    @classmethod
    def restored(cls, state: Mapping[str, object]) -> Self:
        """Return what `state` was made of."""
        return cls(
            gyro=bool(state["gyro"]),
            accel=bool(state["accel"]),
            rate=cast("float", state["rate"]),
            bandwidth=cast("float", state["bandwidth"]),
            start_ns=cast("int", state["start_ns"]),
            valid_ns=cast("int", state["valid_ns"]),
        )


def _cut_off(rate: float, code: int) -> float:
    """Return the filter's -3 dB bandwidth for a code of GYRO_UI_FILT_BW."""
    divisor = _DIVISORS.get(code)
    return max(_LEAST_FILTERED_RATE, rate) / divisor if divisor else rate / 2


def _noise_factor(order: int) -> float:
    """Return noise bandwidth over -3 dB bandwidth of a Butterworth filter."""
    angle = pi / (2 * order)
    return angle / sin(angle)
