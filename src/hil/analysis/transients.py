"""Figures of a captured waveform: level crossings, rise time, time beyond a level, peak and charge.

Every function takes times in s and values of one channel, both of shape (n,), times rising. Between samples the signal
is interpolated linearly. Uncertainties are standard uncertainties of sampling and resolution alone (GUM 4.3.7, a
rectangle of half width a has a / sqrt(3)): an instant may lie up to one sample interval away, and a value up to half a
`resolution`, the step of the converter, None or 0 where there is none. Noise is estimated from the samples. The
instrument's certificate is not included. Names of transitions are those of IEEE Std 181-2011, from memory.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.statistics import not_observable
from hil.analysis.tracing import traced
from hil.model.errors import Refused
from hil.model.figure import Figure

__all__ = ["charge", "crossing", "joule_integral", "peak", "rise_time", "time_above", "time_below"]

_ROOT_3, _ROOT_12 = math.sqrt(3.0), math.sqrt(12.0)
_MEDIAN_TO_RMS = 1.4826
_SIGMAS = 3.0
_LEAST_STEPS = 5  # of the converter between base and top, for a rise time


@traced
def crossing(
    time: ArrayLike,
    values: ArrayLike,
    level: float,
    *,
    rising: bool = True,
    after: float = -math.inf,
    resolution: float | None = None,
) -> Figure:
    """Return when a level is first crossed, in s; not observable where it is not.

    Args:
        time: in s, shape (n,).
        values: of the signal, shape (n,).
        level: in the unit of the values.
        rising: whether it is crossed from below.
        after: crossings before are passed over [s].
        resolution: step of the converter, in the unit of the values.

    Raises:
        Refused: the arrays are no waveform.
    """
    times, signal = _waveform(time, values)
    over = signal - level if rising else level - signal
    found = _crossings(over)
    found = found[times[found + 1] >= after]
    if not found.size:
        return not_observable("s")
    return _transit(times, over, resolution or 0.0, first=True, place=int(found[0]))


@traced
def rise_time(
    time: ArrayLike,
    values: ArrayLike,
    *,
    base: float | None = None,
    top: float | None = None,
    low: float = 0.1,
    high: float = 0.9,
    resolution: float | None = None,
) -> Figure:
    """Return how long a transition takes from `low` to `high` of the way from base to top, in s.

    A transition downwards is treated alike. The low level is crossed for the last time before the high one is crossed
    for the first time. Not observable where one of them is not crossed, or base and top are less than five steps apart.

    Args:
        time: in s after the trigger, shape (n,).
        values: of the signal, shape (n,).
        base: where it begins; the median of the samples before the time 0 if it is not given.
        top: where it ends; the median of the last tenth of the samples if it is not given.
        low: share of the way, from 0 to 1.
        high: share of the way, above `low`.
        resolution: step of the converter, in the unit of the values.

    Raises:
        Refused: the arrays are no waveform, the shares are out of order, or the base cannot be determined.
    """
    times, signal = _waveform(time, values)
    if not 0 < low < high < 1:
        raise Refused(
            f"a rise time from {low:g} to {high:g} of the way", "give shares between 0 and 1, low before high"
        )
    before = signal[times < 0]
    if base is None and not before.size:
        raise Refused("no sample before the trigger tells the base", "capture some time before it, or give `base`")
    start = float(np.median(before)) if base is None else base
    end = float(np.median(signal[-max(1, signal.size // 10) :])) if top is None else top
    step = resolution or 0.0
    if not abs(end - start) > _LEAST_STEPS * step:
        return not_observable("s")
    sign = math.copysign(1.0, end - start)
    below, above = (sign * (signal - start - share * (end - start)) for share in (low, high))
    highs = _crossings(above)
    lows = _crossings(below)
    lows = lows[lows <= highs[0]] if highs.size else lows[:0]
    if not lows.size:
        return not_observable("s")
    # Base and top are known to half a step as well, so that the levels are as uncertain as the samples.
    coarse = step * math.sqrt(2.0)
    first = _transit(times, below, coarse, first=False, place=int(lows[-1]))
    last = _transit(times, above, coarse, first=True, place=int(highs[0]))
    return last - first


@traced
def time_above(time: ArrayLike, values: ArrayLike, level: float, *, resolution: float | None = None) -> Figure:
    """Return for how long a signal is at or above a level within the capture, in s.

    Args:
        time: in s, shape (n,).
        values: of the signal, shape (n,).
        level: in the unit of the values.
        resolution: step of the converter, in the unit of the values.

    Raises:
        Refused: the arrays are no waveform.
    """
    times, signal = _waveform(time, values)
    over, steps = signal - level, np.diff(times)
    ends, begins = np.maximum(over[1:], 0.0), np.maximum(over[:-1], 0.0)
    size = np.abs(over[1:]) + np.abs(over[:-1])
    mixed = (over[1:] >= 0) != (over[:-1] >= 0)
    share = np.where(mixed, (ends + begins) / np.where(size > 0, size, 1.0), over[:-1] >= 0)
    places = np.flatnonzero(mixed)
    doubt = math.hypot((resolution or 0.0) / _ROOT_12, _noise(signal))
    parts = [math.hypot(steps[each] / _ROOT_3, doubt * steps[each] / size[each]) for each in places]
    return Figure(value=float((share * steps).sum()), unit="s", uncertainty=math.hypot(*parts))


@traced
def time_below(time: ArrayLike, values: ArrayLike, level: float, *, resolution: float | None = None) -> Figure:
    """Return for how long a signal is at or below a level within the capture, in s. See `time_above`."""
    return time_above(time, -np.asarray(values, dtype=np.float64), -level, resolution=resolution)


@traced
def peak(time: ArrayLike, values: ArrayLike, unit: str, *, resolution: float | None = None) -> Figure:
    """Return the largest value of a capture.

    Between two samples the signal may have been larger, by no more than it falls to the nearer neighbour, which is
    known to a step of the converter: the two are the half width of the uncertainty. Not observable where the largest
    value is that of the first or the last sample alone.

    Args:
        time: in s, shape (n,).
        values: of the signal, shape (n,).
        unit: of the values.
        resolution: step of the converter, in that unit.

    Raises:
        Refused: the arrays are no waveform.
    """
    _, signal = _waveform(time, values)
    largest = np.flatnonzero(signal == signal.max())
    inside = largest[(largest > 0) & (largest < signal.size - 1)]
    if not inside.size:
        return not_observable(unit)
    place = int(inside[0])
    fall = signal[place] - max(signal[place - 1], signal[place + 1])
    step = resolution or 0.0
    uncertainty = math.hypot((float(fall) + step) / _ROOT_3, step / _ROOT_12)
    return Figure(value=float(signal[place]), unit=unit, uncertainty=uncertainty)


@traced
def charge(
    time: ArrayLike,
    values: ArrayLike,
    unit: str,
    *,
    until: float = math.inf,
    baseline: float | None = None,
    resolution: float | None = None,
) -> Figure:
    """Return the integral of a current above its baseline from the trigger on, such as A.s, by the trapezoidal rule.

    The uncertainty has two parts: an offset of the converter that lasts all the time, and the largest jump between two
    samples, which may have been anywhere between them.

    Args:
        time: in s after the trigger, shape (n,).
        values: of the current, shape (n,).
        unit: of the values.
        until: end of the integral [s]; the last sample at most.
        baseline: what flows anyway; the mean of the samples before the time 0 if it is not given, 0 without any.
        resolution: step of the converter, in the unit of the values.

    Raises:
        Refused: the arrays are no waveform, or fewer than two samples are left.
    """
    times, signal = _waveform(time, values)
    before = signal[times < 0]
    floor = baseline if baseline is not None else float(before.mean()) if before.size else 0.0
    # The sample before the trigger belongs to the jump at it.
    first = max(0, int(np.searchsorted(times, 0.0)) - 1)
    last = int(np.searchsorted(times, until, side="right"))
    if last - first < 2:
        raise Refused(f"{max(0, last - first)} samples lie between the trigger and {until:g} s", "integrate for longer")
    times, signal = times[first:last], signal[first:last] - floor
    steps = np.diff(times)
    total = float((steps * (signal[1:] + signal[:-1]) / 2).sum())
    jump = float((np.abs(np.diff(signal)) * steps).max()) / _ROOT_12
    offset = (resolution or 0.0) / _ROOT_12 * float(times[-1] - times[0])
    return Figure(value=total, unit=f"{unit}.s", uncertainty=math.hypot(jump, offset))


@traced
def joule_integral(
    time: ArrayLike, values: ArrayLike, unit: str, *, until: float = math.inf, resolution: float | None = None
) -> Figure:
    """Return the integral of the square of a current from the trigger on, such as A².s, by the trapezoidal rule.

    This is the I²t that heats a fuse or welds a contact. The uncertainty has the parts of `charge`, each with twice the
    current as its sensitivity.

    Args:
        time: in s after the trigger, shape (n,).
        values: of the current, shape (n,).
        unit: of the values.
        until: end of the integral [s]; the last sample at most.
        resolution: step of the converter, in the unit of the values.

    Raises:
        Refused: the arrays are no waveform, or fewer than two samples are left.
    """
    squares = charge(time, np.asarray(values, dtype=np.float64) ** 2, unit, until=until, baseline=0.0)
    offset = charge(time, np.abs(values), unit, until=until, baseline=0.0).value * 2 * (resolution or 0.0) / _ROOT_12
    uncertainty = math.hypot(squares.uncertainty or 0.0, offset)
    return Figure(value=squares.value, unit=f"{unit}².s", uncertainty=uncertainty)


def _waveform(time: ArrayLike, values: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    times, signal = np.asarray(time, dtype=np.float64), np.asarray(values, dtype=np.float64)
    if times.ndim != 1 or times.shape != signal.shape or times.size < 3:
        shapes = f"{times.shape} and {signal.shape}"
        raise Refused(
            f"times and values of shapes {shapes} are no waveform", "give three samples or more, one time each"
        )
    if not (np.isfinite(times).all() and np.isfinite(signal).all()):
        raise Refused("a waveform with samples that are not finite", "look for what the instrument marked invalid")
    if not (np.diff(times) > 0).all():
        raise Refused("the times of a waveform do not rise", "is this the time column?")
    return times, signal


def _crossings(over: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the places of the samples before which a signal is below 0, and not after."""
    return np.flatnonzero((over[:-1] < 0) & (over[1:] >= 0))


def _noise(signal: NDArray[np.float64]) -> float:
    """Return the rms noise of samples, from the median of their second differences: a smooth signal has none."""
    return float(np.median(np.abs(np.diff(signal, 2)))) * _MEDIAN_TO_RMS / math.sqrt(6.0)


def _transit(times: NDArray[np.float64], over: NDArray[np.float64], step: float, *, first: bool, place: int) -> Figure:
    """Return when a signal rises through 0, in s.

    Noise lets it cross several times: it has left the level once it is farther away than noise and a step of the
    converter. The middle of the first and the last crossing between is taken.

    Args:
        times: in s.
        over: the signal less the level.
        step: of the converter.
        first: whether the transit that begins at `place` is meant; else that which ends there.
        place: the sample before a crossing.
    """
    noise = _noise(over)
    away = _SIGMAS * noise + step
    below = np.flatnonzero(over[: place + 1] <= -away)
    begin = int(below[-1]) if below.size else 0
    above = np.flatnonzero(over[place + 1 :] >= away)
    end = place + 1 + int(above[0]) if above.size else len(over) - 1
    if first and above.size and (again := np.flatnonzero(over[place:end] <= -away)).size:
        begin = place + int(again[-1])
    places = begin + _crossings(over[begin : end + 1])
    one, last = (_between(times, over, int(each)) for each in (places[0], places[-1]))
    slope = abs(over[end] - over[begin]) / (times[end] - times[begin])
    doubt = math.hypot(step / _ROOT_12, noise) / slope if slope > 0 else float(times[end] - times[begin])
    interval = float(times[place + 1] - times[place])
    uncertainty = math.hypot(interval / _ROOT_3, float(doubt), (last - one) / 2 / _ROOT_3)
    return Figure(value=(one + last) / 2, unit="s", uncertainty=uncertainty)


def _between(times: NDArray[np.float64], over: NDArray[np.float64], place: int) -> float:
    """Return when the straight line from a sample to the next is 0, in s."""
    share = over[place] / (over[place] - over[place + 1])
    return float(times[place] + share * (times[place + 1] - times[place]))
