"""Averaging of a sensor at rest: optimum averaging time, moving average, and the mean with its uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.allan.deviation import deviation
from hil.analysis.allan.results import AllanCurve, NoiseModel
from hil.analysis.statistics import not_observable
from hil.analysis.tracing import traced
from hil.model.errors import Refused
from hil.model.figure import Figure

__all__ = ["MovingAverage", "best_average", "rest_mean"]

_Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class MovingAverage:
    """Moving average over the last N samples: y[k] = (x[k] + ... + x[k-N+1]) / N.

    Attributes:
        samples: N, the window length.
        rate: sampling rate of input and output [Hz].
    """

    samples: int
    rate: float

    def __post_init__(self) -> None:
        if self.samples < 1 or not self.rate > 0.0:
            raise Refused(
                f"a queue of {self.samples} samples at {self.rate:g} Hz is not possible",
                "give one sample or more, and the samples per second",
            )

    @property
    @traced
    def delay(self) -> float:
        """Group delay in s, the same at all frequencies: (N - 1) / 2 samples."""
        return (self.samples - 1) / (2.0 * self.rate)

    @property
    def settling(self) -> float:
        """Settling time after a step in s: N - 1 samples."""
        return (self.samples - 1) / self.rate

    def step(self, time: ArrayLike) -> _Array:
        """Return the step response at times in s, of their shape; the first sample at or after time 0 sees the step."""
        after = np.floor(np.asarray(time, dtype=np.float64) * self.rate + 1e-9) + 1.0
        return np.clip(after / self.samples, 0.0, 1.0)

    def gain(self, frequency: ArrayLike) -> _Array:
        """Return the amplitude response |sin(pi f N / rate) / (N sin(pi f / rate))|; f in Hz, any shape."""
        angle = np.pi * np.asarray(frequency, dtype=np.float64) / self.rate
        below = self.samples * np.sin(angle)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.sin(self.samples * angle) / below
        return np.where(np.abs(below) < 1e-12, 1.0, np.abs(ratio))

    def filtered(self, data: ArrayLike) -> _Array:
        """Return the output once the window is full; shape (n,) becomes (n - N + 1,)."""
        sums = np.concatenate([[0.0], np.cumsum(np.asarray(data, dtype=np.float64))])
        return np.asarray((sums[self.samples :] - sums[: -self.samples]) / self.samples)

    @traced
    def noise(self, curve: AllanCurve) -> float:
        """Return the deviation between neighbouring averages over sqrt(2), in the curve's unit: its value at N samples.

        Between averaging times the curve is interpolated linearly on log-log axes.

        Raises:
            Refused: the window is longer than the curve's longest averaging time.
        """
        length = self.samples / self.rate
        if length > curve.tau[-1] * (1.0 + 1e-9):
            raise Refused(f"the curve ends at {curve.tau[-1]:g} s and the queue holds {length:g} s", "record longer")
        return float(np.exp(np.interp(math.log(length), np.log(curve.tau), np.log(curve.deviation))))


@traced
def best_average(model: NoiseModel) -> MovingAverage:
    """Return the moving average at the minimum of the Allan deviation, beyond which slow noise dominates.

    The minimum is flat: the uncertainty of `model.averaging_window` spans the windows that are equally good within the
    record's confidence; the shortest of them has the least delay.

    Args:
        model: noise model from `characterise`.

    Raises:
        Refused: the record does not show the minimum.
    """
    window = model.averaging_window
    if not math.isfinite(window.value):
        raise Refused("no averaging time is known to be best", model.remark or "record longer")
    return MovingAverage(samples=max(1, round(window.value * model.curve.rate)), rate=model.curve.rate)


_FEWEST = 16  # samples: two averages in the eighth of the record
_PART = 8  # averaging times up to this part of the record have ten degrees of freedom and more
_POWERS = {-1: 0, -2: 1}  # of tau, in the Allan variance; white noise and bluer ones: -1


@traced
def rest_mean(samples: ArrayLike, rate: float, unit: str, *, systematic: float = 0.0) -> Figure:
    """Return the mean of a record at rest as a measure of the bias.

    u^2 is the Allan variance at the record length T, plus systematic^2. It is extrapolated from tau, the longest octave
    within an eighth of the record, to T by the noise type identified there: factor tau / T for white noise, 1 for
    flicker and T / tau for random walk. For white noise this is s^2 / n; under flicker or random walk, s / sqrt(n)
    would be far too optimistic. Degrees of freedom are those of the Allan variance at tau.

    Args:
        samples: shape (n,), in `unit`; NaN marks a missing sample. With fewer than 16 samples, or all samples equal,
            the mean is NOT_OBSERVABLE.
        rate: sampling rate [Hz].
        unit: unit of samples and result.
        systematic: standard uncertainty common to all samples, in `unit`; taken as exactly known.
    """
    values = np.asarray(samples, dtype=np.float64)
    present = values[np.isfinite(values)]
    if present.size < _FEWEST or present.min() == present.max():
        return not_observable(unit, float(present.mean()) if present.size else math.nan)
    curve = deviation(values, rate, unit=unit, holes=True)
    place = max(0, int((curve.m <= values.size // _PART).sum()) - 1)
    growth = (values.size / int(curve.m[place])) ** _POWERS.get(int(curve.alpha[place]), -1)
    variance = float(curve.deviation[place]) ** 2 * growth
    dof = float(curve.edf[place])
    total = variance + systematic**2
    return Figure(
        value=float(present.mean()),
        unit=unit,
        uncertainty=math.sqrt(total),
        dof=dof * (total / variance) ** 2 if variance > 0.0 else math.inf,
    )
