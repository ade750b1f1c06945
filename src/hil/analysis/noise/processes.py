"""Noise processes of a sensor: white, flicker, random walk and angle quantisation, in blocks of samples."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import lru_cache
from itertools import accumulate
from math import log, log10, pi, sqrt
from operator import mul
from typing import Any, ClassVar, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["AngleQuantisation", "Flicker", "Normals", "Process", "RandomWalk", "White", "autoregressive"]

_Array: TypeAlias = NDArray[np.float64]

_DECADES = 150
_LONGEST = 512
_UNFELT = 1e-20


class Normals(Protocol):
    """Source of normal random numbers."""

    def normal_block(self, number: int, size: int) -> NDArray[np.float64]:
        """Return the first `size` standard normal numbers of a block, counted from 0, shape (size,)."""
        ...


class Process(ABC):
    """One noise process, generated block by block.

    Attributes:
        carried: names, without their underscore, of the state carried from one block to the next.
    """

    carried: ClassVar[tuple[str, ...]] = ("last",)

    @abstractmethod
    def block(self, number: int) -> NDArray[np.float64]:
        """Return the samples of block `number`, shape (block,); blocks are taken in their order from 0 on."""

    def state(self) -> dict[str, Any]:
        """Return the state carried to the next block, as JSON values."""
        return {name: _copied(getattr(self, f"_{name}")) for name in self.carried}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from what `state` returned."""
        for name in self.carried:
            setattr(self, f"_{name}", _copied(state[name]))


def _copied(value: Any) -> Any:  # noqa: ANN401 - a number, or a list of them
    return list(value) if isinstance(value, list) else value


def autoregressive(driver: _Array, coefficient: float, before: float) -> _Array:
    """Return y with y[k] = coefficient * y[k-1] + driver[k], where y[-1] is `before`.

    Within a row of samples, y[k]/coefficient^k is a plain sum; the initial value of a row decays over it. Only sums and
    products of whole arrays are used, whose results are the same on every machine.

    Args:
        driver: input, shape (n,).
        coefficient: between 0 and 1, exclusive.
        before: the value before the first one.
    """
    growing, fading, felt = _weights(coefficient, driver.size)
    rows = -(-driver.size // growing.size)
    line = driver if rows * growing.size == driver.size else np.append(driver, np.zeros(-driver.size % growing.size))
    values = line.reshape(rows, growing.size) * growing
    np.cumsum(values, axis=1, out=values)
    values *= fading
    starts = []
    for last in values[:, -1].tolist():
        starts.append(coefficient * before)
        before = last + fading[-1] * starts[-1]
    values[:, : felt.size] += np.array(starts)[:, np.newaxis] * felt
    return values.reshape(-1)[: driver.size]


@lru_cache(maxsize=64)
def _weights(coefficient: float, size: int) -> tuple[_Array, _Array, _Array]:
    """Return coefficient^-k and coefficient^k for the longest row without overflow, and the weights of the last row."""
    longest = int(min(size, _LONGEST, max(1, _DECADES / -log10(coefficient))))
    fading = np.array(list(accumulate([1.0, *[coefficient] * (longest - 1)], mul)))
    return 1 / fading, fading, fading[fading > _UNFELT]


class White(Process):
    """White noise of level N, two-sided power density S(f) = N^2 (IEEE Std 952-1997, annex C), filtered, then sampled.

    A filter of noise bandwidth BW passes the variance 2 N^2 BW, whatever the sampling rate fs. Data sheets state the
    one-sided density, sqrt(2) N.

    For BW above fs/2 the noise aliases into the band: samples are independent, and their Allan analysis gives
    N sqrt(2 BW/fs). For a smaller BW samples are a first-order autoregression of that variance, whose coefficient
    (r - 1)/(r + 1) with r = fs/(2 BW) keeps N at low frequencies. A bandwidth of fs/2 gives the textbook N sqrt(fs).

    Args:
        stream: source of random numbers.
        level: N, in the unit of the rate per sqrt(Hz).
        rate: sampling rate [Hz].
        bandwidth: noise bandwidth of the filter [Hz].
        block: samples per block.
    """

    def __init__(self, stream: Normals, level: float, *, rate: float, bandwidth: float, block: int) -> None:
        ratio = max(1.0, rate / (2 * bandwidth))
        self._stream = stream
        self._sigma = level * sqrt(2 * bandwidth)
        self._coefficient = (ratio - 1) / (ratio + 1)
        self._block = block
        self._last = 0.0

    def block(self, number: int) -> NDArray[np.float64]:
        """Return the samples of block `number`, shape (block,); blocks are taken in their order from 0 on."""
        if not self._sigma:
            return np.zeros(self._block)
        drivers = self._stream.normal_block(number, self._block)
        drivers *= self._sigma
        if not self._coefficient:
            return drivers
        start = drivers[0]
        drivers *= sqrt(1 - self._coefficient**2)
        if number == 0:
            drivers[0] = start
        values = autoregressive(drivers, self._coefficient, self._last)
        self._last = float(values[-1])
        return values


class RandomWalk(Process):
    """Random walk of the rate, two-sided power density S(f) = (K/(2 pi f))^2 (IEEE Std 952-1997, annex C).

    Each sample adds K/sqrt(fs) times a standard normal number, starting at zero. The Allan variance of the samples is
    K^2 (2 m^2 + 1)/(6 m fs), which tends to K^2 tau/3.

    Args:
        stream: random numbers.
        level: K, in the unit of the rate times sqrt(Hz).
        rate: sampling rate [Hz].
        block: samples of a block.
    """

    def __init__(self, stream: Normals, level: float, rate: float, block: int) -> None:
        self._stream = stream
        self._step = level / sqrt(rate)
        self._block = block
        self._last = 0.0

    def block(self, number: int) -> NDArray[np.float64]:
        """Return the samples of block `number`, shape (block,); blocks are taken in their order from 0 on."""
        if not self._step:
            return np.zeros(self._block)
        steps = self._stream.normal_block(number, self._block)
        steps *= self._step
        steps[0] += self._last
        values = np.cumsum(steps)
        self._last = float(values[-1])
        return values


class AngleQuantisation(Process):
    """Rate error from angle quantisation: sigma^2 = 3 Q^2/tau^2 (IEEE Std 952-1997, annex C).

    A sample of the rate adds fs (e[k] - e[k-1]), with independent errors e of variance Q^2. Quantisation of the rate
    itself is left to the code that rounds the samples.

    Args:
        stream: random numbers.
        level: Q, in the unit of the angle.
        rate: sampling rate [Hz].
        block: samples of a block.
    """

    def __init__(self, stream: Normals, level: float, rate: float, block: int) -> None:
        self._stream = stream
        self._scale = level * rate
        self._block = block
        self._last = 0.0

    def block(self, number: int) -> NDArray[np.float64]:
        """Return the samples of block `number`, shape (block,); blocks are taken in their order from 0 on."""
        if not self._scale:
            return np.zeros(self._block)
        errors = self._scale * self._stream.normal_block(number, self._block)
        before, self._last = self._last, float(errors[-1])
        return np.diff(errors, prepend=before)


_COEFFICIENT = 0.5
_INNOVATION = sqrt(1 - _COEFFICIENT**2)
_SLOW_OCTAVES = 10

# The fastest octave plus white noise of variance 2 form one process: y[k] = y[k-1]/2 + c (w[k] - d w[k-1]), where
# both sides of c^2 |1 - d z|^2 = 3/4 + 2 |1 - z/2|^2 agree for c^2 d = 1 and c^2 (1 + d^2) = 13/4.
_DELAYED = (13 / 4 - sqrt((13 / 4) ** 2 - 4)) / 2
_PRESENT = 1 / sqrt(_DELAYED)


class Flicker(Process):
    """Flicker noise of level B, two-sided power density S(f) = B^2/(2 pi f) (IEEE Std 952-1997, annex C).

    Octave j holds every value of a first-order autoregression (coefficient 1/2) for 2^j samples. All octaves have the
    variance v. The Allan variance of a process, integrated over ln tau, is 2 ln 2 times its variance whatever its
    spectrum is (from IEEE Std 952-1997, annex C, and the integral of sin^4 u/u^3 from 0 to infinity, ln 2), so the sum
    over all octaves is flat at 2 v; the floor 2 ln 2/pi B^2 of flicker noise asks for v = B^2 ln 2/pi. Octaves faster
    than a sample are white noise of variance 2 v, chosen so that the deviation stays within 5 % of its floor 0.664 B
    from two samples on. At one sample it is 22 % above, where flicker noise cut off at half the rate is 9 % above. The
    sum of processes of many time constants is the classical model of 1/f noise (van der Ziel, Physica 16 (1950) 359).

    Ten octaves continue above the block: with 2^14 samples of a block the slowest holds its value for 2^23 samples, and
    the floor is flat up to about 2^21 of them, 5.8 h at 100 Hz. All octaves begin in their stationary state.

    Args:
        stream: random numbers.
        level: B, in the unit of the rate.
        block: samples of a block, a power of two.
    """

    carried: ClassVar[tuple[str, ...]] = ("driver", "last")

    def __init__(self, stream: Normals, level: float, block: int) -> None:
        self._stream = stream
        self._sigma = level * sqrt(log(2) / pi)
        self._sizes = [block >> octave for octave in range(block.bit_length() - 1)]
        self._last = [0.0] * (len(self._sizes) + _SLOW_OCTAVES)
        self._driver = 0.0

    def block(self, number: int) -> NDArray[np.float64]:
        """Return the samples of block `number`, shape (block,); blocks are taken in their order from 0 on."""
        if not self._sigma:
            return np.zeros(self._sizes[0])
        end = sum(self._sizes)
        drivers = self._stream.normal_block(number, end + _SLOW_OCTAVES)
        held = np.array([self._slow(number, drivers[end:])])
        for octave in reversed(range(len(self._sizes))):
            size = self._sizes[octave]
            held = np.repeat(held, size // held.size)
            held += self._octave(number, octave, drivers[end - size : end])
            end -= size
        held *= self._sigma
        return held

    def _octave(self, number: int, octave: int, drivers: NDArray[np.float64]) -> NDArray[np.float64]:
        if octave == 0:
            coming = _PRESENT * drivers
            coming[1:] -= _PRESENT * _DELAYED * drivers[:-1]
            coming[0] -= _PRESENT * _DELAYED * self._driver
            self._driver = float(drivers[-1])
        else:
            coming = _INNOVATION * drivers
            coming[0] = drivers[0] if number == 0 else coming[0]
        values = autoregressive(coming, _COEFFICIENT, self._last[octave])
        self._last[octave] = float(values[-1])
        return values

    def _slow(self, number: int, drivers: NDArray[np.float64]) -> float:
        """Return the sum of the octaves that hold their value for at least one block."""
        total = 0.0
        for octave, driver in enumerate(drivers.tolist()):
            place = len(self._sizes) + octave
            if number == 0:
                self._last[place] = driver
            elif number % (1 << octave) == 0:
                self._last[place] = _COEFFICIENT * self._last[place] + _INNOVATION * driver
            total += self._last[place]
        return total
