"""The measuring half of the simulated LIS3MDL: when conversions end, and what they give."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import sqrt
from typing import Self

from hil.clock.port import NANOSECONDS
from hil.simulation.faults import Faults
from hil.simulation.plants.terminal import SignalPoint
from hil.simulation.seeds import Seeds, Stream
from hil.simulation.truth import Truth

__all__ = ["AXES", "Conversion", "Outputs", "Sensor", "SensorTruth"]

AXES = "xyz"

_SLOW_RATES = (0.625, 1.25, 2.5, 5.0, 10.0, 20.0, 40.0, 80.0)
_FAST_RATES = (1000.0, 560.0, 300.0, 155.0)  # Hz, by performance mode of x and y
_LSB_PER_GAUSS = (6842, 3421, 2281, 1711)
_MICROTESLA_PER_GAUSS = 100.0
_LSB_PER_KELVIN = 8
_ZERO_TEMPERATURE = 25.0
_POWER_DOWN, _SINGLE, _CONTINUOUS = 3, 1, 0
_MOST, _LEAST = 32767, -32768


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorTruth:
    """What this article really is.

    Attributes:
        offset: what it reads in no field, with the jig's own magnetism [uT].
        gain: relative error of the sensitivity per axis.
        noise: rms of one reading in ultra-high-performance mode [uT].
        temperature: of the die where no plant says it [degC].
        temperature_offset: error of the temperature reading [K].
    """

    offset: tuple[float, ...] = (0.0, 0.0, 0.0)
    gain: tuple[float, ...] = (0.0, 0.0, 0.0)
    noise: tuple[float, ...] = (0.32, 0.32, 0.41)
    temperature: float = 25.0
    temperature_offset: float = 0.0

    @classmethod
    def read(cls, truth: Truth) -> Self:
        """Read a truth section; the noise of the datasheet (3.2 and 4.1 mgauss) is what is not said."""
        usual = cls()
        article = cls(
            offset=truth.vector("offset", 3, usual.offset),
            gain=truth.vector("gain", 3, usual.gain),
            noise=truth.vector("noise", 3, usual.noise),
            temperature=truth.number("temperature", usual.temperature, minimum=-40, maximum=125),
            temperature_offset=truth.number("temperature_offset", usual.temperature_offset),
        )
        if min(article.noise) < 0:
            truth.wrong("noise", "expected numbers from 0 up")
        return article


@dataclass(frozen=True, slots=True)
class Outputs:
    """The output registers as signed numbers."""

    axes: tuple[int, ...] = (0, 0, 0)
    temperature: int = 0

    def state(self) -> list[int]:
        """Return them as JSON."""
        return [*self.axes, self.temperature]

    @classmethod
    def restored(cls, state: Sequence[int]) -> Self:
        """Return what `state` was made of."""
        return cls(tuple(state[:3]), state[3])


@dataclass(frozen=True, slots=True, kw_only=True)
class Conversion:
    """What the control registers ask for, and when conversions began.

    Sample n, counted from 1, ends n periods after the start; a single conversion ends after the first.
    """

    mode: int = _POWER_DOWN
    period_ns: int = 0
    lsb_per_gauss: int = _LSB_PER_GAUSS[0]
    performance: int = 0
    performance_z: int = 0
    warm: int = 0
    start_ns: int = 0

    @classmethod
    def from_registers(cls, ctrl1: int, ctrl2: int, ctrl3: int, ctrl4: int) -> Self:
        """Read the control registers; all reserved modes are power-down."""
        performance = ctrl1 >> 5 & 3
        rate = _FAST_RATES[performance] if ctrl1 & 0x02 else _SLOW_RATES[ctrl1 >> 2 & 7]
        mode = ctrl3 & 3
        return cls(
            mode=mode if mode in {_CONTINUOUS, _SINGLE} else _POWER_DOWN,
            period_ns=round(NANOSECONDS / rate),
            lsb_per_gauss=_LSB_PER_GAUSS[ctrl2 >> 5 & 3],
            performance=performance,
            performance_z=ctrl4 >> 2 & 3,
            warm=ctrl1 >> 7,
        )

    @property
    def setting(self) -> Conversion:
        """The same without its start, to compare settings."""
        return replace(self, start_ns=0)

    @property
    def single(self) -> bool:
        """Whether it stops after one sample."""
        return self.mode == _SINGLE

    def started(self, now_ns: int) -> Conversion:
        """Return the same, beginning now."""
        return replace(self, start_ns=now_ns)

    def count(self, now_ns: int) -> int:
        """Return how many samples have ended."""
        if self.mode == _POWER_DOWN:
            return 0
        ended = (now_ns - self.start_ns) // self.period_ns
        return min(ended, 1) if self.single else ended

    def end_ns(self, number: int) -> int:
        """Return when sample `number` ended."""
        return self.start_ns + number * self.period_ns

    def state(self) -> Mapping[str, int]:
        """Return it as JSON."""
        return asdict(self)

    @classmethod
    def restored(cls, state: Mapping[str, int]) -> Self:
        """Return what `state` was made of."""
        return cls(**state)


class Sensor:
    """The sensing element: field, offset, gain and noise of a sample, whoever reads it, and when.

    Args:
        truth: what this article is.
        field: the field's three components [uT], or None for no field.
        temperature: of the die [degC], or None for the one of `truth`.
        faults: what goes wrong.
        seeds: the bench's random numbers.
        name: the device's name.
    """

    def __init__(
        self,
        truth: SensorTruth,
        *,
        field: tuple[SignalPoint, SignalPoint, SignalPoint] | None,
        temperature: SignalPoint | None,
        faults: Faults,
        seeds: Seeds,
        name: str,
    ) -> None:
        self.faults = faults
        self._truth = truth
        self._field = field
        self._temperature = temperature
        self._seeds = seeds
        self._name = name
        self._last: tuple[Conversion, int, Outputs] | None = None
        self._noise_start_ns = -1
        self._noise: list[Stream] = []

    def outputs(self, conversion: Conversion, number: int) -> Outputs:
        """Return the registers after sample `number`, counted from 1."""
        if self._last is None or self._last[:2] != (conversion, number):
            self._start_noise(conversion.start_ns)
            axes = tuple(self._axis(axis, conversion, number) for axis in range(len(AXES)))
            self._last = (conversion, number, Outputs(axes, self._degrees(conversion, number)))
        return self._last[2]

    def _start_noise(self, start_ns: int) -> None:
        # Conversions that start anew must not repeat the noise of the last ones.
        if start_ns != self._noise_start_ns:
            self._noise = [self._seeds.stream(self._name, f"{axis} from {start_ns}") for axis in AXES]
            self._noise_start_ns = start_ns

    def _axis(self, axis: int, conversion: Conversion, number: int) -> int:
        truth, at_ns = self._truth, conversion.end_ns(number)
        field = self._field[axis].observe_at(at_ns) if self._field else 0.0
        saturated = self.faults.now("saturated", at_ns)
        field += saturated.field if saturated else 0.0
        performance = conversion.performance_z if AXES[axis] == "z" else conversion.performance
        noise = truth.noise[axis] * sqrt(_FAST_RATES[performance] / _FAST_RATES[-1])
        reading = field * (1 + truth.gain[axis]) + truth.offset[axis] + noise * self._noise[axis].normal(number)
        return _clipped(reading / _MICROTESLA_PER_GAUSS * conversion.lsb_per_gauss)

    def _degrees(self, conversion: Conversion, number: int) -> int:
        if not conversion.warm:
            return 0
        at_ns = conversion.end_ns(number)
        degrees = self._temperature.observe_at(at_ns) if self._temperature else self._truth.temperature
        return _clipped((degrees + self._truth.temperature_offset - _ZERO_TEMPERATURE) * _LSB_PER_KELVIN)


def _clipped(value: float) -> int:
    return max(_LEAST, min(_MOST, round(value)))
