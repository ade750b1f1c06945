"""What one simulated IIM-42652 really is, and how it senses: samples as counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self, cast

import numpy as np
from numpy.typing import NDArray

from hil.simulation.faults import Faults
from hil.simulation.noise.rate_noise import NoiseLevels, RateNoise
from hil.simulation.peers.iim42652.sampling import Sampling
from hil.simulation.plants.terminal import SignalPoint
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth

__all__ = ["AXES", "INVALID", "Article", "ArticleTruth", "Samples"]

AXES = "xyz"
INVALID = -32768

_MOST = 32767
_LSB_PER_DEGREE = (16.4, 32.8, 65.5, 131.0, 262.0, 524.3, 1048.6, 2097.2)
_ZERO_TEMPERATURE = 25.0
_LSB_PER_KELVIN = 132.48
_FIFO_LSB_PER_KELVIN = 2.07
_MISALIGNED = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))

Polynomial = tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ArticleTruth:
    """What this article really is. Polynomials are of the die's temperature above 25 degC, lowest power first.

    Attributes:
        bias: three coefficients per axis [deg/s, deg/s/K, deg/s/K^2].
        scale: three coefficients per axis of the relative error [1, 1/K, 1/K^2].
        misalignment: xy, xz, yx, yz, zx, zy: how much of the second axis' rate the first one sees [rad].
        noise: levels per axis.
        acceleration: what the accelerometer sees [g].
        temperature: of the die where no plant says it [degC].
        temperature_offset: error of the temperature reading [K].
        odr_error: relative error of the oscillator.
    """

    bias: tuple[Polynomial, ...]
    scale: tuple[Polynomial, ...]
    misalignment: tuple[float, ...]
    noise: tuple[NoiseLevels, ...]
    acceleration: tuple[float, ...]
    temperature: float
    temperature_offset: float
    odr_error: float

    @classmethod
    def read(cls, truth: Truth) -> Self:
        """Read a truth section; by default there are no errors.

        The white noise is then that of the ICM-42605's datasheet, 3.8 mdeg/s/sqrt(Hz) one-sided; flicker and random
        walk, which no datasheet tells, are guesses.
        """
        nothing = (0.0, 0.0, 0.0)
        return cls(
            bias=tuple(truth.vector(f"bias_{axis}", 3, nothing) for axis in AXES),
            scale=tuple(truth.vector(f"scale_{axis}", 3, nothing) for axis in AXES),
            misalignment=truth.vector("misalignment", 6, nothing * 2),
            noise=_levels(truth),
            acceleration=truth.vector("acceleration", 3, (0.0, 0.0, 1.0)),
            temperature=truth.number("temperature", 25.0, minimum=-40, maximum=105),
            temperature_offset=truth.number("temperature_offset", 0.0),
            odr_error=truth.number("odr_error", 0.0, minimum=-0.1, maximum=0.1),
        )


def _levels(truth: Truth) -> tuple[NoiseLevels, ...]:
    usual = {"white": 2.7e-3, "flicker": 1e-3, "random_walk": 1e-5, "quantisation": 0.0}
    read = {kind: truth.vector(kind, 3, (level,) * 3) for kind, level in usual.items()}
    for kind, levels in read.items():
        if min(levels) < 0:
            truth.wrong(kind, "expected numbers from 0 up")
    return tuple(NoiseLevels(**{kind: levels[axis] for kind, levels in read.items()}) for axis in range(3))


class Samples(NamedTuple):
    """Some samples in a row, as counts.

    Attributes:
        ends_ns: when they ended, shape (n,).
        gyro: shape (n, 3), from -32767 to 32767, or INVALID.
        temperature: of the data registers, shape (n,).
        fifo_temperature: of the FIFO, shape (n,), 8 bits.
    """

    ends_ns: NDArray[np.int64]
    gyro: NDArray[np.int16]
    temperature: NDArray[np.int16]
    fifo_temperature: NDArray[np.int8]


class Article:
    """The sensing elements: rate, temperature, errors and noise of samples, whoever reads them, and when.

    Args:
        truth: what this article is.
        rate: rate in the sensor's axes [deg/s], or None for rest.
        temperature: of the die [degC], or None for the one of `truth`.
        faults: what goes wrong.
        seeds: the bench's random numbers.
        name: the device's name.
    """

    def __init__(
        self,
        truth: ArticleTruth,
        *,
        rate: tuple[SignalPoint, SignalPoint, SignalPoint] | None,
        temperature: SignalPoint | None,
        faults: Faults,
        seeds: Seeds,
        name: str,
    ) -> None:
        self.truth = truth
        self.faults = faults
        self._rate = rate
        self._temperature = temperature
        self._seeds = seeds
        self._name = name
        self._bias = np.array(truth.bias).T[:, :, np.newaxis]
        self._scale = np.array(truth.scale).T[:, :, np.newaxis]
        self._noise: list[RateNoise] = []

    def begin(self, sampling: Sampling) -> None:
        """Start noise anew: samples that are counted anew must not repeat the noise of the last ones."""
        self._noise = []
        if sampling.gyro:
            self._noise = [self._axis_noise(axis, sampling) for axis in range(len(AXES))]

    def samples(self, sampling: Sampling, first: int, count: int, scale: int) -> Samples:
        """Return samples `first` and following, counted from 1, for a code of GYRO_FS_SEL; they have ended lately."""
        ends_ns = sampling.ends_ns(first, count)
        degrees = self._degrees(ends_ns)
        gyro = np.full((count, len(AXES)), INVALID, dtype=np.int16)
        if sampling.gyro:
            measured = self._measured(self._rates(ends_ns), degrees - _ZERO_TEMPERATURE)
            for axis, noise in enumerate(self._noise):
                measured[axis] += noise.samples(first - 1, count)
            measured *= _LSB_PER_DEGREE[scale]
            gyro[:] = _limited(measured, -_MOST, _MOST).T
            if ends_ns[0] < sampling.valid_ns:
                gyro[ends_ns < sampling.valid_ns] = INVALID
        return self._with_temperature(ends_ns, gyro, degrees)

    def state(self) -> list[Mapping[str, object]]:
        """Return the state of the noise of every axis."""
        return [noise.state() for noise in self._noise]

    def restore(self, sampling: Sampling, state: Sequence[object]) -> None:
        """Go on from what `state` returned for this sampling."""
        self.begin(sampling)
        for noise, carried in zip(self._noise, state, strict=True):
            noise.restore(cast("Mapping[str, object]", carried))

    def _axis_noise(self, axis: int, sampling: Sampling) -> RateNoise:
        prefix = f"{AXES[axis]} from {sampling.start_ns}"
        return RateNoise(
            lambda kind: self._seeds.stream(self._name, f"{prefix} {kind}"),
            self.truth.noise[axis],
            rate=sampling.rate,
            bandwidth=sampling.bandwidth,
        )

    def _rates(self, ends_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return what turns the sensor in its frame, shape (3, n) [deg/s]."""
        rates = np.zeros((len(AXES), ends_ns.size))
        for axis, point in enumerate(self._rate or ()):
            rates[axis] = point.observe_many(ends_ns)
        for fault in self.faults.of("saturated"):
            rates[:, (ends_ns >= fault.start_ns) & (ends_ns < fault.end_ns)] += fault.field
        return rates

    def _measured(self, rates: NDArray[np.float64], warmer: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what the axes see without noise, shape (3, n) [deg/s]."""
        seen = rates.copy()
        for (here, other), share in zip(_MISALIGNED, self.truth.misalignment, strict=True):
            if share:
                seen[here] += share * rates[other]
        seen *= 1 + _polynomial(self._scale, warmer)
        seen += _polynomial(self._bias, warmer)
        return seen

    def _degrees(self, ends_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        if self._temperature is None:
            return np.full(ends_ns.size, self.truth.temperature)
        return self._temperature.observe_many(ends_ns)

    def _with_temperature(
        self, ends_ns: NDArray[np.int64], gyro: NDArray[np.int16], degrees: NDArray[np.float64]
    ) -> Samples:
        counts = (degrees + self.truth.temperature_offset - _ZERO_TEMPERATURE) * _LSB_PER_KELVIN
        for fault in self.faults.of("temperature-raw"):
            counts[(ends_ns >= fault.start_ns) & (ends_ns < fault.end_ns)] = fault.number
        short = counts * (_FIFO_LSB_PER_KELVIN / _LSB_PER_KELVIN)
        return Samples(
            ends_ns,
            gyro,
            _limited(counts, -_MOST, _MOST).astype(np.int16),
            _limited(short, -128, 127).astype(np.int8),
        )


def _polynomial(coefficients: NDArray[np.float64], argument: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return polynomials with coefficients of shape (3, m, 1), lowest power first, shape (m, n)."""
    constant, linear, square = coefficients
    return np.asarray(constant + argument * (linear + argument * square))


def _limited(counts: NDArray[np.float64], least: int, most: int) -> NDArray[np.float64]:
    """Return whole numbers within bounds."""
    return np.asarray(np.minimum(np.maximum(np.rint(counts), least), most))
