"""A whole record of noise of exact level, and its expected Allan variance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hil.analysis.noise.rate_noise import NoiseLevels

__all__ = ["expected", "noise"]


def noise(levels: NoiseLevels, count: int, rate: float, generator: np.random.Generator) -> NDArray[np.float64]:
    """Return a record of noise, shape (count,), whose levels are exact (IEEE Std 952-1997, annex C).

    White noise is N sqrt(fs) times normal numbers; flicker noise is shaped in the frequency domain to
    S(f) = B^2/(2 pi f) over twice the record, of which the first half is taken; random walk adds up K/sqrt(fs) times
    normal numbers; quantisation of the angle is fs times the difference of errors that are uniform and have the
    standard deviation Q; the ramp is R t. `expected` says what variance follows.

    Args:
        levels: noise levels.
        count: number of samples.
        rate: sampling rate [Hz].
        generator: random generator; every process draws its numbers even at level 0, so that records of one seed
            differ only in their levels.
    """
    values = levels.white * np.sqrt(rate) * generator.standard_normal(count)
    spectrum = np.fft.rfft(generator.standard_normal(2 * count))
    frequency = np.fft.rfftfreq(2 * count, 1.0 / rate)
    frequency[0] = np.inf
    values += np.fft.irfft(spectrum * levels.flicker * np.sqrt(rate / (2.0 * np.pi * frequency)))[:count]
    values += np.cumsum(levels.random_walk / np.sqrt(rate) * generator.standard_normal(count))
    values += np.diff(generator.uniform(-1.0, 1.0, count + 1)) * np.sqrt(3.0) * levels.quantisation * rate
    return np.asarray(values + levels.ramp * np.arange(count) / rate)


def expected(levels: NoiseLevels, count: int, rate: float, m: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the expected Allan variance of `noise` at averaging factors `m`, in the shape of `m`.

    With tau = m/fs: N^2/tau, K^2 (2 m^2 + 1)/(6 m fs), 3 Q^2/tau^2 and R^2 tau^2/2 (IEEE Std 952-1997, annex C, the
    second for samples instead of a continuous rate); for flicker noise the sum over its lines of
    P(f) 2 sin^4(pi f tau)/(m sin(pi f/fs))^2, which is near its floor 2 ln 2/pi B^2.

    Args:
        levels: noise levels.
        count: samples in the record, which determine the lines of the flicker noise.
        rate: sampling rate [Hz].
        m: averaging factors in samples.
    """
    tau = m / rate
    variance = levels.white**2 / tau + levels.random_walk**2 * (2.0 * m**2 + 1.0) / (6.0 * m * rate)
    variance = variance + 3.0 * levels.quantisation**2 / tau**2 + levels.ramp**2 * tau**2 / 2.0
    if levels.flicker:
        turns = np.arange(1, count + 1) / (2.0 * count)  # f/fs, up to a half
        lines = levels.flicker**2 / (np.pi * turns) / (2.0 * count)  # one-sided density times the distance of lines
        lines[-1] /= 2.0
        for place in np.ndindex(np.shape(m)):
            factor = m[place]
            gain = 2.0 * np.sin(np.pi * turns * factor) ** 4 / (factor * np.sin(np.pi * turns)) ** 2
            variance[place] += float(np.sum(lines * gain))
    return np.asarray(variance)
