"""Simulated sensor from a table of its properties: noise, range, resolution, temperature, clock and losses."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.noise.numbers import RandomStream
from hil.analysis.noise.rate_noise import NoiseLevels, RateNoise
from hil.analysis.tracing import traced

__all__ = ["SensorModel", "SensorSamples", "SimulatedSensor", "simulate"]

_PURPOSES = ("white", "flicker", "random walk", "quantisation", "jitter", "lost")


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorModel:
    """Model of one axis of a sensor; `unit` is that of its readings.

    Attributes:
        levels: noise levels.
        rate: sampling rate [Hz].
        bandwidth: noise bandwidth of the pre-sampling filter [Hz]; None for half the rate.
        bias: polynomial in temperature relative to `reference`, lowest power first [unit, unit/K, ...].
        scale: the same for the relative sensitivity error [1, 1/K, ...].
        reference: temperature [degC] at which `bias[0]` and `scale[0]` hold.
        lsb: one count [unit]; 0 for no quantisation.
        full_scale: saturation level, both signs [unit].
        jitter: standard deviation of the timestamps [s].
        lost: share of samples lost.
        lost_run: least number lost in a row.
    """

    levels: NoiseLevels
    rate: float
    bandwidth: float | None = None
    bias: tuple[float, ...] = ()
    scale: tuple[float, ...] = ()
    reference: float = 25.0
    lsb: float = 0.0
    full_scale: float = math.inf
    jitter: float = 0.0
    lost: float = 0.0
    lost_run: int = 1


class SensorSamples(NamedTuple):
    """The samples that were not lost.

    Attributes:
        times: timestamps [s], shape (n,); the first sample ends one period after 0.
        values: readings in the model's unit, shape (n,).
    """

    times: NDArray[np.float64]
    values: NDArray[np.float64]


class SimulatedSensor:
    """A sensor read in pieces; a sample depends only on seed and index, not on the pieces.

    Args:
        model: the sensor model.
        seed: seed of its random numbers; different seeds give independent noise.
    """

    def __init__(self, model: SensorModel, *, seed: int) -> None:
        rate = model.rate
        streams = {name: RandomStream(seed * len(_PURPOSES) + place) for place, name in enumerate(_PURPOSES)}
        self._model = model
        self._noise = RateNoise(
            streams.__getitem__,
            model.levels,
            rate=rate,
            bandwidth=rate / 2 if model.bandwidth is None else model.bandwidth,
        )
        self._jitter, self._losses = _normals(streams["jitter"], rate), _normals(streams["lost"], rate)
        begun = 1.0 - (1.0 - model.lost) ** (1.0 / model.lost_run)
        self._threshold = NormalDist().inv_cdf(1.0 - begun) if begun else math.inf
        self._begun = np.zeros(model.lost_run - 1, dtype=np.bool_)
        self._next = 0

    def read(self, count: int, *, truth: ArrayLike = 0.0, temperature: ArrayLike | None = None) -> SensorSamples:
        """Return the next `count` samples, without the lost ones.

        Args:
            count: number of samples.
            truth: true value of the measurand, a number or shape (count,).
            temperature: sensor temperature [degC], a number or shape (count,); None for its reference.
        """
        model, first = self._model, self._next
        self._next += count
        warmer = np.subtract(model.reference if temperature is None else temperature, model.reference)
        sensed = np.asarray(truth) * (1.0 + np.polyval((*model.scale[::-1],) or (0.0,), warmer))
        values = self._noise.samples(first, count) + sensed + np.polyval((*model.bias[::-1],) or (0.0,), warmer)
        values = np.clip(values, -model.full_scale, model.full_scale)
        if model.lsb:
            most = math.floor(model.full_scale / model.lsb) if model.full_scale < math.inf else math.inf
            values = np.clip(np.rint(values / model.lsb), -most, most) * model.lsb
        times = np.arange(first + 1, first + count + 1) / model.rate
        if model.jitter:
            times = times + model.jitter * self._jitter.samples(first, count)
        there = self._there(first, count)
        return SensorSamples(times[there], values[there])

    def _there(self, first: int, count: int) -> NDArray[np.bool_]:
        """Return which samples are not lost, shape (count,)."""
        if not self._model.lost:
            return np.ones(count, dtype=np.bool_)
        begun = np.concatenate((self._begun, self._losses.samples(first, count) > self._threshold))
        run = self._model.lost_run
        self._begun = begun[begun.size - (run - 1) :]
        return np.asarray(np.convolve(begun, np.ones(run, dtype=np.int64))[run - 1 : run - 1 + count] == 0)


def _normals(stream: RandomStream, rate: float) -> RateNoise:
    """Return standard normal numbers by index, as white noise of suitable level and bandwidth."""
    unit = NoiseLevels(white=1.0 / math.sqrt(rate))
    return RateNoise(lambda _: stream, unit, rate=rate, bandwidth=rate / 2)


@traced
def simulate(
    model: SensorModel, count: int, *, seed: int, truth: ArrayLike = 0.0, temperature: ArrayLike | None = None
) -> SensorSamples:
    """Return the first `count` samples of a simulated sensor.

    Args:
        model: the sensor model.
        count: number of samples.
        seed: seed of its random numbers.
        truth: true value of the measurand in the model's unit, a number or shape (count,).
        temperature: sensor temperature [degC], a number or shape (count,); None for the model's reference.
    """
    return SimulatedSensor(model, seed=seed).read(count, truth=truth, temperature=temperature)
